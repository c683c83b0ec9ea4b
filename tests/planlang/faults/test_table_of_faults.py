"""The table of docs/reference/faults.md is that of planlang.faults.kinds: running this file writes it."""

from __future__ import annotations

import re
from pathlib import Path

import planlang.failures as failures
from planlang.faults.kinds import KINDS

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "faults.md"
BEGIN, END = "<!-- begin of the table of faults -->\n", "<!-- end of the table of faults -->"


def table() -> str:
    rows = ["| Fault | at | what happens | shown first by | failures |", "|---|---|---|---|---|"]
    for one in KINDS:
        shows = ", ".join(f"`{name}`" for name in one.shows)
        cells = (f"`{one.stated}`", one.opportunity.value, one.happens + one.chance, one.sense.value, shows)
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def rewritten(text: str) -> str:
    return re.sub(f"(?s){BEGIN}.*?{END}", lambda _: f"{BEGIN}{table()}\n{END}", text)


def test_the_page_lists_the_kinds_of_faults_that_there_are() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == rewritten(text), f"run python {Path(__file__).name} to write the table"


def test_a_fault_shows_in_failures_that_there_are() -> None:
    assert [name for one in KINDS for name in one.shows if not hasattr(failures, name)] == []


if __name__ == "__main__":
    PAGE.write_text(rewritten(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
