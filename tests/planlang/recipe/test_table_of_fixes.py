"""The codes that have fixes, and their table in docs/reference/fixes.md."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from planlang.recipe.fixes import ACCEPTABLE, SAFE, WITHOUT
from planlang.recipe.fixes.fixing import fix_recipe
from planlang.words import COMMAND_LINE, said
from tests.support.codes import CODES
from tests.support.examples import some

DIAGNOSTICS = Path(__file__).parents[2] / "diagnostics"


def test_every_code_of_recipes_has_a_fix_or_a_reason_for_having_none() -> None:
    fixing = {*SAFE, *ACCEPTABLE}
    assert not fixing & WITHOUT.keys()
    assert {code for code in fixing | WITHOUT.keys() if code.startswith("R")} == {
        code for code in CODES if code.startswith("R")
    }


@pytest.mark.parametrize("path", some(sorted(DIAGNOSTICS.glob("R*.omn")), every=6), ids=lambda path: path.stem)
def test_fixes_are_of_the_codes_that_say_so(path: Path) -> None:
    found = fix_recipe(path)
    assert {fix.code for fix in (*found.done, *(fix for fix, _ in found.impossible))} <= {*SAFE}
    assert {fix.code for fix in found.unaccepted} <= {*ACCEPTABLE}


FILE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "fixes.md"


PAGE = FILE.read_text(encoding="utf-8")


TABLE = re.compile(r"(?<=<!-- table of fixes -->\n).*?(?=<!-- end -->)", re.DOTALL)


def table() -> str:
    """A row for each code that has fixes or a reason for having none."""
    lines = [
        "| code | meaning | fixed without asking | with `--accept` | not fixed, because |",
        "|---|---|---|---|---|",
    ]
    for code in sorted({*SAFE, *ACCEPTABLE, *WITHOUT}):
        unasked, asked = ("yes" if code in codes else "" for codes in (SAFE, ACCEPTABLE))
        lines.append(
            f"| `{code}` | {CODES[code]} | {unasked} | {asked} | {said(WITHOUT.get(code, ''), COMMAND_LINE)} |"
        )
    return "\n".join(lines) + "\n"


def test_the_table_of_fixes_is_the_programs() -> None:
    found = TABLE.search(PAGE)
    assert found
    assert found[0] == table()


if __name__ == "__main__":
    FILE.write_text(TABLE.sub(lambda _: table(), PAGE), encoding="utf-8")
