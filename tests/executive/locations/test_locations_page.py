"""docs/locations.md says what the code says: the relations, the words, what the command prints.

``python tests/executive/locations/test_locations_page.py`` writes tables and outputs into the page anew.
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

from executive.cli.app import app
from planlang.phrases.lexicon import GRASP_FORMS
from planlang.relations import RELATIONS

CHECKOUT = Path(__file__).resolve().parents[3]
FILE = CHECKOUT / "docs" / "locations.md"
PAGE = FILE.read_text(encoding="utf-8")
BLOCK = re.compile(r"```console\n\$ planlang (.+)\n((?:(?!```).*\n)*)```")
FOUND = [match.groups() for match in BLOCK.finditer(PAGE)]


def relations() -> str:
    """What each relation denotes."""
    lines = ["| relation | OWL property | for a base | for a hand | for an object |", "|---|---|---|---|---|"]
    for name, relation in RELATIONS.items():
        cells = [meaning.text if meaning else "-" for meaning in (relation.base, relation.hand, relation.thing)]
        lines.append(f"| `{name}` | {relation.owl} | {' | '.join(cells)} |")
    return "\n".join(lines)


def forms() -> str:
    """How each relation and each grasp is said."""
    lines = ["| relation, grasp | said | also |", "|---|---|---|"]
    for name, (first, *others) in {
        **{name: relation.forms for name, relation in RELATIONS.items()},
        **GRASP_FORMS,
    }.items():
        lines.append(f"| `{name}` | {first} | {', '.join(others) or '-'} |")
    return "\n".join(lines)


TABLES = {"table of relations": relations, "table of forms": forms}


def shown(title: str) -> str:
    """What stands between the marks of a table."""
    found = re.search(rf"<!-- {title} -->\n(.*?)<!-- end -->", PAGE, re.DOTALL)
    assert found, f"docs/locations.md has no {title}"
    return found[1].strip()


def output(command: str) -> str:
    """What the command prints, stderr too, but for what only a first run prints."""
    lines = CliRunner().invoke(app, shlex.split(command)).output.splitlines(keepends=True)
    return "".join(line for line in lines if not line.startswith("building the reachability map"))


@pytest.mark.parametrize("title", TABLES)
def test_a_table_of_the_page_is_that_of_the_code(title: str) -> None:
    assert shown(title) == TABLES[title]()


@pytest.mark.parametrize(("command", "printed"), FOUND, ids=[command for command, _ in FOUND])
def test_an_output_of_the_page_is_what_its_command_prints(command: str, printed: str) -> None:
    assert output(command) == printed, "python tests/executive/locations/test_locations_page.py writes it anew"


def rewrite() -> None:
    """Write tables and outputs into the page anew."""
    text = PAGE
    for title, table in TABLES.items():
        text = re.sub(
            rf"(<!-- {title} -->\n).*?(<!-- end -->)", lambda m, t=table: f"{m[1]}{t()}\n{m[2]}", text, flags=re.DOTALL
        )
    text = BLOCK.sub(lambda m: f"```console\n$ planlang {m[1]}\n{output(m[1])}```", text)
    FILE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    rewrite()
