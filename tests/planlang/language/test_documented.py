"""The names in docs/reference/language.md, and the codes and records in docs/guides/resuming.md, exist."""

from __future__ import annotations

import re
from pathlib import Path

import planlang
from planlang import failures
from planlang.runs.recorded_run import BOOKKEEPING
from tests.support.codes import CODES

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "language.md"


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
    # descriptions are in docs/guides/locations.md and in compiled plans, the others in modules.md and sweeping.md there
    assert sorted(missing) == ["a_device", "a_person", "process_module", "sweep"]


RESUMING = (Path(__file__).resolve().parents[3] / "docs" / "guides" / "resuming.md").read_text(encoding="utf-8")


def test_the_page_tells_of_codes_that_exist_and_of_all_records() -> None:
    assert set(re.findall(r"`(X\d+)`", RESUMING)) <= set(CODES)
    assert set(re.findall(r"^\| `(\w+)` \|", RESUMING, re.M)) == set(BOOKKEEPING)
