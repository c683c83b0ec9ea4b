"""Every public name has an example in the documentation, and names that pages mention exist."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import planlang
from planlang import failures, testing
from planlang.plan_failure import PlanFailure
from planlang.runs.recorded_run import BOOKKEEPING
from tests.support.codes import CODES

DOCS = Path(__file__).resolve().parents[3] / "docs"
REFERENCE = [
    DOCS / "reference" / f"{name}.md"
    for name in (
        "language",
        "control_flow",
        "failure_handling",
        "failures",
        "fluents",
        "tasks_and_time",
        "designators",
        "performing",
        "hosts",
        "planlang_testing",
    )
]
"""The pages that are about names."""
BLOCK = re.compile(r'^```(\w+)(?: title="(.+?)")?\n(.*?)^```$', re.M | re.S)


def names_used() -> set[str]:
    """The names that are used, not only imported, in Python blocks of the documentation."""
    pages = [page.read_text(encoding="utf-8") for page in sorted(DOCS.rglob("*.md"))]
    blocks = [match[3] for page in pages for match in BLOCK.finditer(page) if match[1] == "python"]
    return {node.id for block in blocks for node in ast.walk(ast.parse(block)) if isinstance(node, ast.Name)}


def test_every_public_name_is_used_in_an_example() -> None:
    classes = {name for name, value in vars(failures).items() if isinstance(value, type)}
    of_failures = {name for name in classes if issubclass(getattr(failures, name), (PlanFailure, failures.Where))}
    public = {*planlang.__all__, *testing.__all__, *of_failures}
    assert sorted(public - names_used()) == []


def test_the_table_of_the_language_names_every_public_name_once() -> None:
    table = REFERENCE[0].read_text(encoding="utf-8").partition("## ")[0]
    named = re.findall(r"`([A-Za-z_]+)`", "\n".join(line for line in table.splitlines() if line.startswith("| [")))
    strategies = {name for name in planlang.__all__ if getattr(planlang, name).__module__ == "planlang.recoveries"}
    assert sorted(set(planlang.__all__) - set(named) - strategies - {"PlanStructureError"}) == []
    assert sorted(name for name in set(named) if named.count(name) > 1) == []


@pytest.mark.parametrize("page", REFERENCE, ids=lambda page: page.stem)
def test_every_function_that_a_page_mentions_exists(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    homes = (planlang, failures, testing, planlang.Handle, planlang.Plan, planlang.TaskTree, planlang.Trace)
    known = {name for home in homes for name in dir(home)} | names_used()
    words = set(re.findall(r"`([A-Za-z_]+)\(", text))
    assert sorted(words - known) == []


RESUMING = (DOCS / "guides" / "resuming.md").read_text(encoding="utf-8")


def test_the_page_tells_of_codes_that_exist_and_of_all_records() -> None:
    assert set(re.findall(r"`(X\d+)`", RESUMING)) <= set(CODES)
    assert set(re.findall(r"^\| `(\w+)` \|", RESUMING, re.M)) == set(BOOKKEEPING)
