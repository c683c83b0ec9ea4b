"""Two traces side by side."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from planlang.runs import with_paths
from planlang.testing.history import History

WIDTH = 58
BEFORE = 3
LONGEST = 60


def side_by_side(usual: History, other: History) -> str:
    """The traces of two runs in two columns, from a little before they differ; differing lines are marked ``|``."""
    left, right = _lines(usual), _lines(other)
    rows: list[tuple[str, str, str]] = []
    matcher = difflib.SequenceMatcher(None, left, right, autojunk=False)
    for what, a, b, c, d in matcher.get_opcodes():
        ours, theirs = left[a:b], right[c:d]
        for number in range(max(len(ours), len(theirs))):
            one = ours[number] if number < len(ours) else ""
            two = theirs[number] if number < len(theirs) else ""
            rows.append((one, " " if what == "equal" else "|", two))
    first = next((number for number, row in enumerate(rows) if row[1] == "|"), len(rows))
    begin = max(0, first - BEFORE)
    shown = rows[begin : begin + LONGEST]
    lines = [f"{'first come, first served':{WIDTH}}   with these choices"]
    if begin:
        lines.append(f"... {begin} lines are the same")
    lines.extend(f"{_cut(one):{WIDTH}} {mark} {_cut(two)}".rstrip() for one, mark, two in shown)
    if begin + LONGEST < len(rows):
        lines.append(f"... {len(rows) - begin - LONGEST} more lines")
    return "\n".join(lines)


def _lines(run: History) -> list[str]:
    return [_line(event, run.rate) for event in with_paths(run.events) if event["event"] != "header"]


def _line(event: Mapping[str, Any], rate: int) -> str:
    known = ("step", "event", "path", "status", "failure")
    place = ("node", "parent", "kind", "name") if "node" in event else ()
    parts = [f"{event['step'] / rate:6.3f} s", _short(str(event.get("path", "")))]
    parts.append(event.get("status") or event["event"])
    if "failure" in event:
        parts.append(f"{event['failure']['type']}: {event['failure']['message']}")
    parts.extend(f"{key} {value}" for key, value in event.items() if key not in (*known, *place))
    return " ".join(part for part in parts if part)


def _short(path: str) -> str:
    names = path.split("/")
    return path if len(names) <= 3 else "../" + "/".join(names[-3:])


def _cut(text: str) -> str:
    return text if len(text) <= WIDTH else text[: WIDTH - 3] + "..."
