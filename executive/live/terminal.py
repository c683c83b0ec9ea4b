"""Live view of a run's task tree in the terminal."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TextIO

from rich.console import Console
from rich.live import Live
from rich.text import Text
from rich.tree import Tree

from planlang.kernel.tree import Node
from planlang.report.tree import PLUMBING, is_minor
from planlang.runs.run_tree import RunTree, TaskNode
from planlang.visible import visible

PERIOD = 0.125
"""Shortest time between two refreshes [s], since each takes milliseconds of the run."""
OPEN = 2
"""Depth down to which ended tasks are expanded (the plan and its steps); below it only running and failed ones are."""
_STYLES = {"running": "bold cyan", "succeeded": "green", "failed": "bold red", "evaporated": "dim"}
_MARKS = {"running": "▶", "succeeded": "✓", "failed": "✗", "evaporated": "-"}


class TerminalTree:
    """Context manager and trace listener that draws the task tree: running tasks expanded, ended ones collapsed.

    If the output is not a terminal, only the final tree is printed.
    """

    def __init__(self, out: TextIO | None = None, *, inner: bool = False) -> None:
        """Set up the view; ``inner`` also shows the tasks of process modules inside the plan's actions."""
        self._console = Console(file=out, highlight=False)
        self._run = RunTree()
        self._inner = inner
        self._live = Live(console=self._console, get_renderable=self.tree, auto_refresh=False)
        self._drawn = 0.0

    def __enter__(self) -> TerminalTree:
        self._live.start()
        return self

    def __exit__(self, *failure: object) -> None:
        self._live.refresh()
        self._live.stop()
        if not self._console.is_terminal:
            self._console.line()

    def heard(self, record: Mapping[str, Any], node: Node | None) -> None:
        """Process a record of the trace."""
        self._run.add(record)
        if self._console.is_terminal and time.monotonic() - self._drawn > PERIOD:
            self._live.refresh()
            self._drawn = time.monotonic()

    def tree(self) -> Tree:
        """Build the view; rows at the top are left out if it is higher than the terminal."""
        room = max(3, self._console.size.height - 2)
        ends = (time for node in self._run.numbered.values() for time in (node.start, node.end) if time is not None)
        shown = Tree(Text(f"plan time {max(ends, default=0.0):.2f} s", "bold"), guide_style="dim")
        rows = list(self._rows(self._run.roots, 0))
        reasons, left_out = _reasons(rows), max(0, len(rows) - room)
        places: dict[int, Tree] = {-1: shown}
        if left_out:
            shown.add(Text(f"{left_out} earlier lines", "dim"))
        for depth, node in rows[left_out:]:
            above = next(places[one] for one in range(depth - 1, -2, -1) if one in places)
            places = {one: place for one, place in places.items() if one < depth}
            places[depth] = above.add(_line(node, reasons[node.number]))
        return shown

    def lines(self) -> Iterator[str]:
        """Yield the whole view as plain text."""
        rows = list(self._rows(self._run.roots, 0))
        reasons = _reasons(rows)
        yield from (f"{'  ' * depth}{_line(node, reasons[node.number]).plain}" for depth, node in rows)

    def _rows(self, nodes: Iterable[TaskNode], depth: int) -> Iterable[tuple[int, TaskNode]]:
        """Yield visible nodes with their depths."""
        for node in list(nodes):
            is_drawn = not (is_minor(node) and (not self._inner or node.kind in PLUMBING))
            if is_drawn:
                yield depth, node
            if not is_drawn or node.status in ("running", "failed") or depth < OPEN:
                yield from self._rows(node.children, depth + is_drawn)


def _reasons(rows: Sequence[tuple[int, TaskNode]]) -> dict[int, str]:
    """Failures to tell, by the numbers of nodes: of nested tasks that fail for one reason, the innermost tells it."""
    reasons: dict[int, str] = {}
    around: list[tuple[int, TaskNode]] = []
    for depth, node in rows:
        around = [(other, one) for other, one in around if other < depth]
        reasons.update((one.number, "") for _, one in around if one.reason == node.reason)
        reasons[node.number] = node.reason
        around.append((depth, node))
    return reasons


def _line(node: TaskNode, reason: str) -> Text:
    style = _STYLES.get(node.status, "")
    line = Text(visible(f"{_MARKS.get(node.status, ' ')} {node.action or node.name}", breaks=""), style)
    if node.start is not None:
        end = f"{node.end - node.start:.2f} s" if node.end is not None else "..."
        line.append(f"  {end}", "dim")
    if reason:
        line.append(visible(f"  {reason}"), "red")
    return line
