"""Suspension by count: a held task runs no code, its timers stand still, and what came true is looked at again."""

from __future__ import annotations

from typing import TYPE_CHECKING

from planlang.kernel.errors import Evaporated, PlanStructureError
from planlang.kernel.task import Status, Task

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler


class Recheck:
    """A wait whose condition is looked at again when its task is no longer held."""

    scheduler: Scheduler

    def recheck(self) -> None:
        """Wake the task if the condition is true now."""
        raise NotImplementedError


def suspend(scheduler: Scheduler, task: Task) -> bool:
    """Hold a subtree; True if this changed something.

    Raises PlanStructureError when a task would hold itself or an ancestor of its own.
    """
    if task.dead or task.cancelled:
        return False
    runner = scheduler.current
    while runner is not None:
        if runner is task:
            raise PlanStructureError(f"a task cannot suspend itself or what waits for it: {task.path}")
        runner = runner.group.owner if runner.group is not None else None
    task.count += 1
    if task.count > 1:
        return True
    held: list[Task] = []
    for one in _subtree(task):
        one.holds += 1
        if one.holds == 1:
            held.append(one)
            if one.watched is not None:
                one.watched.set(Status.SUSPENDED)
            for timer in one.timers or ():
                timer.freeze()
    for one in reversed(held):  # children first
        for hook in reversed(one.hooks or ()):
            one.context.copy().run(hook)
    return True


def wake_up(scheduler: Scheduler, task: Task) -> bool:
    """Undo one suspension; True if this changed something."""
    if task.dead or task.cancelled or not task.count:
        return False
    task.count -= 1
    if not task.count:
        for one in _subtree(task):
            one.holds -= 1
            if not one.holds:
                _let_go(scheduler, one)
    return True


def unhold(scheduler: Scheduler, task: Task) -> None:
    """An evaporated task is never held: only its cleanup runs, with all that it has started inside a shield."""
    if task.shields:
        for one in _subtree(task, cancelled=True):
            if one.holds:
                one.holds = one.count = 0
                _let_go(scheduler, one)
        return
    if not task.holds:
        return
    task.holds = task.count = 0
    if task.woken:
        if task.begun and not _must_be_seen(task):
            task.error, task.value = Evaporated(), None
        if not task.in_queue:
            scheduler.enqueue(task)


def _must_be_seen(task: Task) -> bool:
    return task.error is not None or (task.scope is not None and task.scope.crash is not None)


def _let_go(scheduler: Scheduler, task: Task) -> None:
    for timer in task.timers or ():
        if not timer.passed and timer.due is None:
            timer.thaw()
    if task.watched is not None and not task.cancelled:
        task.watched.set(task.status)
    if task.woken:
        if not task.in_queue:
            scheduler.enqueue(task)
    elif isinstance(task.wait, Recheck):
        task.wait.recheck()


def _subtree(task: Task, cancelled: bool = False) -> list[Task]:
    """The task and its live descendants, parents first; without what is being evaporated, unless asked for."""
    found: list[Task] = []
    stack = [task]
    while stack:
        one = stack.pop()
        if one.cancelled and not cancelled:
            continue
        found.append(one)
        if one.scope is not None:
            stack.extend(reversed(one.scope.live))
    return found
