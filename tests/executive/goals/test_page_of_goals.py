"""The table of tolerances in the reference is that of the code.

``python -m tests.executive.goals.test_page_of_goals`` writes it.
"""

from __future__ import annotations

from pathlib import Path

from sim.tolerances import TABLE

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "goals.md"
HEAD = "| goal | holds if |\n|---|---|\n"


def table() -> str:
    """Return the table of the page."""
    return HEAD + "".join(f"| {goal} | {meaning} |\n" for goal, meaning in TABLE)


def test_the_table_of_tolerances_is_that_of_the_code() -> None:
    assert f"\n\n{table()}\n" in PAGE.read_text(encoding="utf-8")


def rewrite() -> None:
    """Write the table into the page."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(HEAD)
    lines = rest.splitlines(keepends=True)
    after = next(number for number, line in enumerate(lines) if not line.startswith("|"))
    PAGE.write_text(before + table() + "".join(lines[after:]), encoding="utf-8")


if __name__ == "__main__":
    rewrite()
