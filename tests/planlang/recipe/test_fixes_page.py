"""docs/fixes.md says of each code of recipes how it is fixed, or why it is not.

``python tests/planlang/recipe/test_fixes_page.py`` writes the table into the page anew.
"""

from __future__ import annotations

import re
from pathlib import Path

from planlang.diagnostics import CODES
from planlang.recipe.fixes import ACCEPTABLE, SAFE, WITHOUT

FILE = Path(__file__).resolve().parents[3] / "docs" / "fixes.md"
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
        lines.append(f"| `{code}` | {CODES[code]} | {unasked} | {asked} | {WITHOUT.get(code, '')} |")
    return "\n".join(lines) + "\n"


def test_the_table_of_fixes_is_the_programs() -> None:
    found = TABLE.search(PAGE)
    assert found
    assert found[0] == table()


if __name__ == "__main__":
    FILE.write_text(TABLE.sub(lambda _: table(), PAGE), encoding="utf-8")
