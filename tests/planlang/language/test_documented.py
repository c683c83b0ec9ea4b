"""The examples of docs/reference/language.md and docs/guides/resuming.md run as they are written there."""

from __future__ import annotations

import linecache
import re
from pathlib import Path
from typing import Any

import planlang
from planlang import *
from planlang import failures
from planlang.runs.recorded_run import BOOKKEEPING
from tests.support.codes import CODES

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "language.md"


def test_the_examples_of_the_page_hold() -> None:
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    assert len(blocks) == 14
    space: dict[str, Any] = {"__name__": "documented"}
    for number, block in enumerate(blocks):
        name = f"<example {number}>"
        linecache.cache[name] = (len(block), None, block.splitlines(keepends=True), name)
        exec(compile(block, name, "exec"), space)
    assert {
        "both_arms",
        "bounded",
        "shift",
        "watch",
        "feel",
        "blocking_and_asyncio",
        "Bell",
        "exploration",
        "tree",
        "careful",
        "takes_both",
        "forgetful",
    } <= set(space)


def test_every_name_in_the_page_that_looks_like_one_of_ours_exists() -> None:
    words = set(re.findall(r"`([A-Za-z_]+)(?:\(|`)", PAGE.read_text(encoding="utf-8")))
    others = {"planlang", "async", "partial", "await", "transitions", "check", "recover", "clean_up"}
    others |= {
        "ValueError",
        "TypeError",
        "handle",
        "b",
        "body",
        "with",
        "otherwise",
        "until",
        "recoveries",
        "alternatives",
        "takes",
        "fetch",
        "open_wider",
    }
    others |= {"and", "if", "not", "or"}
    homes = (planlang, failures, planlang.Handle, planlang.Plan, planlang.ProcessModule)
    assert sorted(word for word in words - others if not any(hasattr(home, word) for home in homes)) == []


def test_every_function_of_the_language_stands_in_the_page() -> None:
    page = PAGE.read_text(encoding="utf-8")
    names = [name for name in planlang.__all__ if name.islower()]
    missing = [name for name in [*names, "changed", "pulsed", "post"] if not re.search(rf"\b{name}\b", page)]
    # descriptions are in docs/guides/locations.md and in compiled plans, the other in modules.md there
    assert sorted(missing) == ["a_device", "a_person", "process_module"]


RESUMING = (Path(__file__).resolve().parents[3] / "docs" / "guides" / "resuming.md").read_text(encoding="utf-8")


def test_the_examples_of_resuming_hold() -> None:
    for block in re.findall(r"^```python\n(.*?)^```$", RESUMING, re.M | re.S):
        space: dict[str, Any] = {"__name__": "documented"}
        exec(compile(block, "<resuming>", "exec"), space)
    assert len(space["done"]) == 3, "once in the run, not in the resumed one, and once in each replay"


def test_the_page_tells_of_codes_that_exist_and_of_all_records() -> None:
    assert set(re.findall(r"`(X\d+)`", RESUMING)) <= set(CODES)
    assert set(re.findall(r"^\| `(\w+)` \|", RESUMING, re.M)) == set(BOOKKEEPING)
