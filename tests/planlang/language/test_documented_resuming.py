"""The example of docs/resuming.md runs as it is written there, and its codes and records exist."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from planlang.diagnostics import CODES
from planlang.runs.recorded_run import BOOKKEEPING

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "resuming.md").read_text(encoding="utf-8")


def test_the_example_of_the_page_holds() -> None:
    (block,) = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)
    space: dict[str, Any] = {"__name__": "documented"}
    exec(compile(block, "<resuming>", "exec"), space)
    assert len(space["done"]) == 3, "once in the run, not in the resumed one, and once in each replay"


def test_the_page_tells_of_codes_that_exist_and_of_all_records() -> None:
    assert set(re.findall(r"`(X\d+)`", PAGE)) <= set(CODES)
    assert set(re.findall(r"^\| `(\w+)` \|", PAGE, re.M)) == set(BOOKKEEPING)
