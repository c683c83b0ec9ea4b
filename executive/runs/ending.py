"""The end of a run in a few lines, for its picture and its video."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby

from executive.pictures.steps import capital
from planlang.report import Told as Told
from planlang.report.failures import Failures
from planlang.report.wording import Wording
from planlang.runs.run_tree import TaskNode

MOST = 12
"""Maximum number of steps listed; the rest is counted."""


def ending_of(
    told: Told, wording: Wording, outcome: str, message: str, seconds: float, state: Iterable[str]
) -> tuple[str, ...]:
    """Lines for the outcome with the plan time; the reason of the failure, or the completed steps and the final state.

    The reason is the headline of the failure on the page, with its advice, else the first line of ``message``.
    """
    first = f"{outcome} after {seconds:.2f} s"
    if outcome == "failed":
        failures, root = Failures(told.tree, told.reasons), told.tree.roots[0].number if told.tree.roots else 0
        place = failures.index.get(root)
        return first, str(failures.table[place]["headline"]) if place is not None else message.partition("\n")[0]
    said = message.partition("\n")[0] if message != outcome else ""  # a goal does not hold
    if outcome == "interrupted":
        going_on = (node for node in told.tree.numbered.values() if node.ended in (None, told.last))
        stopped = [one for one in going_on if one.kind == "perform" and not one.inner and one.status != "succeeded"]
        said = f"at this step: {wording.of(stopped[-1])}" if stopped else said
    steps = [name for name, _ in groupby(wording.step(node) for node in _steps(told.tree.roots))]
    listed = [*steps[:MOST], *([f"{len(steps) - MOST} more"] if len(steps) > MOST else [])]
    return tuple(line for line in (first, said, capital("; ".join(listed)), "; ".join(state)) if line)


def _steps(nodes: Iterable[TaskNode]) -> Iterator[TaskNode]:
    """Yield the outermost actions that succeeded, in the order of their start."""
    for node in nodes:
        if node.kind != "perform":
            yield from _steps(node.children)
        elif node.status == "succeeded":
            yield node
