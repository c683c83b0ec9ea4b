"""Evaporation, shields and suspension.

Evaporation works from the leaves upwards: a task that waits for a construct is left alone until all branches of the
construct are dead; then Evaporated is raised where the task waits. Suspensions are counted. A held task runs no code,
its timers are frozen, and its wait is checked again when it is resumed.
"""

from __future__ import annotations

import types
import warnings
from collections.abc import Generator
from types import TracebackType
from typing import Any

from planlang.kernel.core import Scheduler, Task, here, park
from planlang.kernel.errors import CleanupOverrun, CutShort, Evaporated, PlanStructureError
from planlang.kernel.hosts import Timer
from planlang.kernel.signals import Wait
from planlang.kernel.tracebacks import place_of, user_frame
from planlang.kernel.tree import EVAPORATED, Status
from planlang.misuse import Usage

STUCK = object()
"""Yielded by a task that swallowed Evaporated too often; it is never resumed."""
MAX_DELIVERIES = 100
"""Deliveries of Evaporated after which a task counts as stuck, as code is that catches BaseException in a loop. Far
above what unshielded awaits in ``finally`` blocks need: one delivery each."""


def evaporate(scheduler: Scheduler, root: Task, through_shields: bool = False) -> bool:
    """Evaporate a subtree, children first; True if this changed anything.

    A task that has not begun never begins. A shielded task, and all that it started inside the shield, continues until
    the shield ends.
    """
    changed = False
    stack = [root]
    while stack:
        task = stack.pop()
        if task.dead:
            continue
        if not task.cancelled:
            task.cancelled = changed = True
            unhold(scheduler, task)
            task.show(Status.EVAPORATING)
        if not task.begun:
            scheduler.finish(task, EVAPORATED)
            continue
        # Tasks that are shielded or evaporating already are left alone; only a drain overrides that.
        if (task.shields or task.doomed) and not through_shields:
            continue
        task.doomed = True
        _reach(scheduler, task, stack, through_shields)
    return changed


def heed_interrupts(scheduler: Scheduler, root: Task) -> None:
    """Evaporate the plan at the first Ctrl-C, so that its cleanups run; drain it at the second."""
    if scheduler.interrupts != scheduler.heeded and not scheduler.draining:
        scheduler.heeded = scheduler.interrupts
        if scheduler.interrupts > 1:
            raise KeyboardInterrupt
        if scheduler.observer is not None:
            scheduler.observer.write(scheduler.now, "interrupted")
        evaporate(scheduler, root)


def _reach(scheduler: Scheduler, task: Task, stack: list[Task], through_shields: bool) -> None:
    """Raise Evaporated where a task waits, or evaporate the branches that it waits for first."""
    scope = task.scope
    if scope is not None and not scope.complete:
        # The branches come first. When they are dead the scope wakes the task with Evaporated.
        scope.over = True
        stack.extend(reversed(scope.live))
    elif task is not scheduler.current and not task.woken:
        # The task waits. A task that is running, or queued to run, receives Evaporated at its next checkpoint instead.
        if through_shields or not _uninterruptible(task):
            scheduler.throw(task, pending_error(task, scheduler.draining))
    elif through_shields and task.woken and not task.in_queue:
        # Woken while it was held: a drain resumes it all the same.
        scheduler.enqueue(task)


def _uninterruptible(task: Task) -> bool:
    return isinstance(task.wait, Wait) and task.wait.uninterruptible


def pending_error(task: Task, draining: bool) -> BaseException:
    """Error to raise in a doomed task: the error that breaks it off, if there is one, or else Evaporated."""
    if task.overrun is not None:
        error, task.overrun = task.overrun, None
        _update_doomed(task, draining)
        return error
    return Evaporated()


def _update_doomed(task: Task, draining: bool) -> None:
    """Update ``doomed`` after a change of anything that it depends on."""
    task.doomed = draining or task.overrun is not None or (task.cancelled and not task.shields)


def break_off(scheduler: Scheduler, task: Task, error: BaseException) -> None:
    """Raise an error where the task waits, after evaporating any branches it waits for, or at its next checkpoint."""
    task.overrun = error
    task.doomed = True
    scope = task.scope
    if scope is not None and not scope.complete:
        scope.close()
    elif not task.woken and not _uninterruptible(task):
        scheduler.throw(task, pending_error(task, scheduler.draining))


@types.coroutine
def deliver(task: Task) -> Generator[object, Any, None]:
    """Raise the pending error of a doomed task at a checkpoint."""
    scheduler = here()[0]
    if task.overrun is not None:
        raise pending_error(task, scheduler.draining)
    task.deliveries += 1
    if task.deliveries > MAX_DELIVERIES:
        yield STUCK
    if task.thrown and not scheduler.draining:  # delivered before: this await is in a cleanup without a shield
        _warn_cut_short(task)
    task.thrown = True
    raise Evaporated


async def checkpoint() -> None:
    """Let the other tasks of this step run; a point where evaporation and suspension take effect."""
    scheduler, task = here()
    if task.doomed:
        await deliver(task)
    scheduler.wake(task)
    await park("its turn")
    if task.doomed:  # evaporated while it was queued, when nothing could be raised in it
        await deliver(task)


_SHIELD = Usage("with shield", {}, {"within": "30"})


class shield:  # noqa: N801 - used like a function: with shield(within=10)
    """``with shield(within=10):`` protects a block from evaporation by code outside it.

    The protection covers the task and everything that it starts inside the block. If the block takes longer than
    ``within`` [s] of plan time, :class:`CleanupOverrun` is raised in it. Evaporation from inside works as usual.
    """

    def __init__(self, within: float = 10.0) -> None:
        self.within = within
        self._timers: list[Timer] = []
        self._error: CleanupOverrun | None = None

    def __enter__(self) -> None:
        self._scheduler, self._task = scheduler, task = here()
        steps = scheduler.steps(self.within, _SHIELD, "within")
        task.shields += 1
        _update_doomed(task, scheduler.draining)
        self._timers.append(scheduler.deadline(task, steps, self._overrun))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._timers.pop().drop()
        if self._task.overrun is self._error:  # still pending, as an outer shield's error was raised first
            self._task.overrun = None
        self._task.shields -= 1
        _update_doomed(self._task, self._scheduler.draining)

    def _overrun(self) -> None:
        task = self._task
        if isinstance(task.error, CleanupOverrun):  # an outer shield expired in this step: one error is enough
            return
        where = f"in {task.path} took longer than {self.within} s{place_of(task)}"
        advice = "allow more time with unwind_protect(body, cleanup, within=30) or shield(within=30)"
        self._error = CleanupOverrun(f"shielded code {where}; {advice}")
        break_off(self._scheduler, task, self._error)


def _warn_cut_short(task: Task) -> None:
    """Warn that an evaporating task awaits without a shield."""
    frame = user_frame()
    warnings.warn_explicit(
        f"{task.path} is being evaporated, so this await is cut short; put cleanup that waits into "
        "unwind_protect(body, cleanup) or a shield()",
        CutShort,
        frame.f_code.co_filename,
        frame.f_lineno,
        registry=frame.f_globals.setdefault("__warningregistry__", {}),  # once per line, as Python's own warnings
    )


def suspend(scheduler: Scheduler, task: Task) -> bool:
    """Hold a subtree; True if this changed anything.

    Raises PlanStructureError if a task would hold itself or one of its ancestors. If a hook raises, the remaining hooks
    still run, the suspension is undone, and the first error is raised: a suspension takes effect or fails, never both.
    """
    if task.dead or task.cancelled:
        return False
    runner = scheduler.current
    while runner is not None:
        if runner is task:
            raise PlanStructureError(f"a task cannot suspend itself or a task that waits for it: {task.path}")
        runner = runner.group.owner if runner.group is not None else None
    task.count += 1
    if task.count > 1:  # the subtree is held already
        return True
    newly_held: list[Task] = []
    error: Exception | None = None
    for member in _subtree(task):
        member.holds += 1
        if member.holds == 1:  # no ancestor holds it already
            newly_held.append(member)
            member.show(Status.SUSPENDED)
            for timer in member.timers or ():
                timer.freeze()
    for member in reversed(newly_held):  # children first
        for hook in reversed(member.hooks or ()):
            try:
                member.context.copy().run(hook)
            except Exception as raised:  # the other hooks still have to stop their devices
                error = error or raised
    if error is not None:
        wake_up(scheduler, task)
        raise error
    return True


def wake_up(scheduler: Scheduler, task: Task) -> bool:
    """Undo one suspension; True if this changed anything."""
    if task.dead or task.cancelled or not task.count:
        return False
    task.count -= 1
    if not task.count:
        for member in _subtree(task):
            member.holds -= 1
            if not member.holds:
                _resume(scheduler, member)
    return True


def unhold(scheduler: Scheduler, task: Task) -> None:
    """Lift all suspensions of an evaporated task, so that its cleanup and its shielded branches can run."""
    if task.shields:
        for member in _subtree(task, cancelled=True):
            if member.holds:
                member.holds = member.count = 0
                _resume(scheduler, member)
        return
    if not task.holds:
        return
    task.holds = task.count = 0
    if task.woken:
        # A result that arrived while the task was held is replaced by Evaporated; an error is kept.
        has_crashed_branch = task.scope is not None and task.scope.crash is not None
        if task.begun and task.error is None and not has_crashed_branch:
            task.error, task.value = Evaporated(), None
        if not task.in_queue:
            scheduler.enqueue(task)


def _resume(scheduler: Scheduler, task: Task) -> None:
    """Resume a task that is no longer held."""
    for timer in task.timers or ():
        if not timer.fired and timer.due is None:
            timer.thaw()
    if not task.cancelled:
        task.show(task.status)
    if task.woken:
        if not task.in_queue:
            scheduler.enqueue(task)
    # What it waits for may have become true and false again while it was held: only the present value counts.
    elif isinstance(task.wait, Wait):
        task.wait.recheck()


def _subtree(task: Task, cancelled: bool = False) -> list[Task]:
    """List the task and its live descendants, parents first; evaporating ones only if ``cancelled``."""
    members: list[Task] = []
    stack = [task]
    while stack:
        member = stack.pop()
        if member.cancelled and not cancelled:
            continue
        members.append(member)
        if member.scope is not None:
            stack.extend(reversed(member.scope.live))
    return members
