"""Faults: a step fails because the test wants it, at an attempt, at a time, whatever the step would have done."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from functools import partial

from planlang.action_classes import ancestors_of
from planlang.designators import Action
from planlang.kernel import Scheduler, Task
from planlang.kernel.cancel import break_off
from planlang.kernel.core import here
from planlang.kernel.tree import Node
from planlang.records import dataclass

Raises = type[BaseException] | BaseException | Callable[[], BaseException]


def made(failure: Raises) -> BaseException:
    """Return a fresh failure: of a class, by a function, or a copy of an example."""
    return copy.copy(failure) if isinstance(failure, BaseException) else failure()


@dataclass(frozen=True)
class Fault:
    """Let a step fail.

    ``step`` is a name in the task tree, ``parent/name``, or the class of a performed action; ``attempt`` counts its
    beginnings from 1, None is every one. The step fails as it begins, ``after`` seconds later, or ``at`` a plan time
    [s] if it runs then: what it does is evaporated, cleanup included, then ``raises`` is raised where it waits. A
    step that has ended by then is left alone.
    """

    step: str
    raises: Raises
    attempt: int | None = None
    after: float | None = None
    at: float | None = None

    def __str__(self) -> str:
        what = self.raises.__name__ if isinstance(self.raises, type) else repr(self.raises)
        which = "" if self.attempt is None else f", attempt {self.attempt}"
        when = f" at {self.at:g} s" if self.at is not None else ""
        when += f" after {self.after:g} s" if self.after is not None else ""
        return f"{what} in {self.step}{which}{when}"


class Injector:
    """Follows the steps of one run and lets them fail."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._faults = tuple(faults)
        self._begun = [0] * len(self._faults)
        self._happened = [False] * len(self._faults)

    @property
    def unused(self) -> tuple[Fault, ...]:
        """Faults that did not happen."""
        return tuple(f for f, happened in zip(self._faults, self._happened, strict=True) if not happened)

    @property
    def unmatched(self) -> tuple[Fault, ...]:
        """Faults of steps that did not begin."""
        return tuple(fault for fault, begun in zip(self._faults, self._begun, strict=True) if not begun)

    def __call__(self, node: Node) -> None:
        """Let a node of the tree fail as it begins, in its task, or set an alarm for it."""
        mine = [number for number, fault in enumerate(self._faults) if _called(node, fault.step)]
        for number in mine:
            self._begun[number] += 1
        for number in mine:
            fault = self._faults[number]
            if fault.attempt is None or fault.attempt == self._begun[number]:
                self._set(number, fault, node)

    def _set(self, number: int, fault: Fault, node: Node) -> None:
        """Let the node fail now, or when it is time."""
        scheduler, task = here()
        delay = 0 if fault.after is None else scheduler.steps(fault.after)
        if fault.at is not None:
            at = scheduler.steps(fault.at)
            if at < scheduler.now:
                return
            delay = max(delay, at - scheduler.now)
        if delay:
            scheduler.alarm(task, delay, partial(self._break, number, node, task, scheduler))
        else:
            self._happened[number] = True
            raise made(fault.raises)

    def _break(self, number: int, node: Node, task: Task, scheduler: Scheduler) -> None:
        open_: Node | None = None if task.dead else task.node
        while open_ is not None and open_ is not node:
            open_ = open_.parent
        if open_ is not None and not task.cancelled:
            self._happened[number] = True
            break_off(scheduler, task, made(self._faults[number].raises))


def _called(node: Node, step: str) -> bool:
    """Return True for a node that a fault means; an action in a branch or a state of its name is meant with that."""
    around, action = node.parent, getattr(node, "action", None)
    is_inside = around is not None and around.kind in ("branch", "state") and around.base_name == node.base_name
    if isinstance(action, Action) and step in ancestors_of(action.type, lambda cls: (cls,)):
        return not (is_inside and step == node.base_name)
    if is_inside:
        return False
    open_: Node | None = node
    for wanted in reversed(step.split("/")):
        if open_ is None or wanted not in (open_.name, open_.base_name):
            return False
        open_ = open_.parent
    return True
