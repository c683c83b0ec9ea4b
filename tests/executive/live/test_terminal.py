"""The tree in the terminal: the nodes that the page shows."""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

from executive.live.terminal import TerminalTree

ABSENT = {"type": "ObjectNotFound", "message": "object not found: bottle1", "cause": None}
NODES = (
    (1, None, "plan", "fetch", 0, 725, True),
    (2, 1, "with_failure_handling", "with_failure_handling", 0, 725, True),
    (3, 2, "at_location", "at_location", 0, 0, True),
    (4, 2, "at_location", "at_location#2", 0, 65, False),
    (5, 4, "perform", "ComeNear", 0, 65, False),
    (6, 5, "plan", "come_near", 0, 65, False),
    (7, 6, "perform", "Drive", 0, 65, False),
    (8, 2, "perform", "GraspIt", 65, 725, True),
    (9, 8, "budget", "budget", 65, 725, True),
    (10, 9, "perform", "Approach", 65, 725, True),
)


def records() -> Iterator[dict[str, Any]]:
    yield {"event": "header", "step": 0, "rate": 30, "schema": 5}
    moments = [(begin, 0, node) for node, _, _, _, begin, _, _ in NODES]
    moments += [(end, 1, -node) for node, _, _, _, _, end, _ in NODES]
    for step, _, number in sorted(moments):
        node, parent, kind, name, _, _, has_failed = NODES[abs(number) - 1]
        told = {"node": node, "parent": parent, "kind": kind, "name": name, "step": step}
        if number > 0:
            yield {**told, "event": "started"}
        else:
            ended = {"status": "failed", "failure": ABSENT} if has_failed else {"status": "succeeded"}
            yield {**told, "event": "ended", **ended}


def test_the_last_tree_shows_failed_constructs_and_what_others_around_have_done() -> None:
    out = io.StringIO()
    with TerminalTree(out) as tree:
        for record in records():
            tree.heard(record, None)
    marked = [line.strip("│├└─ ").split("  ")[0] for line in out.getvalue().splitlines() if "s" in line]
    names = [line for line in marked if line[:1] in "✓✗"]
    assert names == ["✗ fetch", "✗ at_location", "✓ ComeNear", "✓ come_near", "✗ GraspIt", "✗ Approach"]
    assert out.getvalue().count(f"{ABSENT['type']}: {ABSENT['message']}") == 2, "by the innermost of each"
