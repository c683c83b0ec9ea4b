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
from tests.support.pages import all_pages, blocks

REFERENCE = Path(__file__).resolve().parents[3] / "docs" / "reference"
LANGUAGE = (REFERENCE / "language.md").read_text(encoding="utf-8").partition("\n## ")[0]
"""The table of the pages about names."""
PAGES = ["language.md", *re.findall(r"^\| \[.+?\]\((?!api)(\w+\.md)\)", LANGUAGE, re.M)]
RESUMING = (REFERENCE.parent / "guides" / "resuming.md").read_text(encoding="utf-8")


def names_used() -> set[str]:
    """The names that are used, not only imported, in Python blocks of the documentation."""
    found = [block for page in all_pages() for block in blocks(page.read_text(encoding="utf-8"))]
    trees = [ast.parse(block.text) for block in found if block.language == "python"]
    return {node.id for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Name)}


def test_every_public_name_is_used_in_an_example() -> None:
    classes = {name for name, value in vars(failures).items() if isinstance(value, type)}
    of_failures = {name for name in classes if issubclass(getattr(failures, name), (PlanFailure, failures.Where))}
    public = {*planlang.__all__, *testing.__all__, *of_failures}
    assert sorted(public - names_used()) == []


def test_the_table_of_the_language_names_every_public_name_once() -> None:
    named = re.findall(r"`([A-Za-z_]+)`", "\n".join(line for line in LANGUAGE.splitlines() if line.startswith("| [")))
    strategies = {name for name in planlang.__all__ if getattr(planlang, name).__module__ == "planlang.recoveries"}
    assert sorted(set(planlang.__all__) - set(named) - strategies - {"PlanStructureError"}) == []
    assert sorted(name for name in set(named) if named.count(name) > 1) == []


@pytest.mark.parametrize("page", PAGES)
def test_every_function_that_a_page_mentions_exists(page: str) -> None:
    homes = (planlang, failures, testing, planlang.Handle, planlang.Plan, planlang.TaskTree, planlang.Trace)
    known = {name for home in homes for name in dir(home)} | names_used()
    words = set(re.findall(r"`([A-Za-z_]+)\(", (REFERENCE / page).read_text(encoding="utf-8")))
    assert sorted(words - known) == []


def test_the_page_tells_of_codes_that_exist_and_of_all_records() -> None:
    assert set(re.findall(r"`(X\d+)`", RESUMING)) <= set(CODES)
    assert set(re.findall(r"^\| `(\w+)` \|", RESUMING, re.M)) == set(BOOKKEEPING)
