"""How a run has ended, in the few lines that stand below its picture and at the end of its video."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby

from executive.pictures.steps import in_words
from planlang.report import Told
from planlang.report.failures import Failures
from planlang.runs.run_tree import TaskNode

MOST = 12
"""Steps that are listed; of more their number is stated."""


def ending_of(told: Told, outcome: str, message: str, seconds: float, state: Iterable[str]) -> tuple[str, ...]:
    """Return lines: the outcome with the plan time; why it failed, else the steps that succeeded; the final state.

    The reason is the headline of the page's failure, which says what to change, else the first line of ``message``.
    """
    first = f"{outcome} after {seconds:.2f} s"
    if outcome == "failed":
        failures, root = Failures(told.tree, told.reasons), told.tree.roots[0].number if told.tree.roots else 0
        place = failures.index.get(root)
        return first, str(failures.table[place]["headline"]) if place is not None else message.partition("\n")[0]
    steps = [name for name, _ in groupby(in_words(node.name) for node in _steps(told.tree.roots))]
    listed = [*steps[:MOST], *([f"{len(steps) - MOST} more"] if len(steps) > MOST else [])]
    return tuple(line for line in (first, ", ".join(listed), "; ".join(state)) if line)


def _steps(nodes: Iterable[TaskNode]) -> Iterator[TaskNode]:
    """Yield the outermost actions that succeeded, in the order in which they began."""
    for node in nodes:
        if node.kind != "perform":
            yield from _steps(node.children)
        elif node.status == "succeeded":
            yield node
