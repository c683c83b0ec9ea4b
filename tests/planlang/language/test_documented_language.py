"""The examples of docs/language.md run as they are written there."""

from __future__ import annotations

import linecache
import re
from pathlib import Path
from typing import Any

PAGE = Path(__file__).resolve().parents[3] / "docs" / "language.md"


def test_the_examples_of_the_page_hold() -> None:
    blocks = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    assert len(blocks) == 6
    space: dict[str, Any] = {"__name__": "documented"}
    for number, block in enumerate(blocks):
        name = f"<example {number}>"
        linecache.cache[name] = (len(block), None, block.splitlines(keepends=True), name)
        exec(compile(block, name, "exec"), space)
    assert {"exploration", "tree", "careful", "takes_both", "forgetful"} <= set(space)


def test_every_name_in_the_page_that_looks_like_one_of_ours_exists() -> None:
    import planlang
    from planlang import failures

    words = set(re.findall(r"`([A-Za-z_]+)(?:\(|`)", PAGE.read_text(encoding="utf-8")))
    others = {
        "planlang",
        "async",
        "partial",
        "await",
        "transitions",
        "check",
        "recover",
        "clean_up",
        "ValueError",
        "TypeError",
    }
    unknown = sorted(word for word in words - others if not hasattr(planlang, word) and not hasattr(failures, word))
    assert unknown == []
