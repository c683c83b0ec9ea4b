"""Cancellation and suspension: which tasks evaporation reaches, shields, and tasks that are held.

Evaporation goes to the leaves: a task that waits for a construct is not touched before all branches of the construct
are dead; then it is raised where the task waits. Suspension counts: a held task runs no code, its timers stand still,
and what came true meanwhile is looked at again when it is woken up.
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
from planlang.kernel.listing import place_of, user_frame
from planlang.kernel.signals import Wait
from planlang.kernel.tree import EVAPORATED, Status
from planlang.misuse import Usage

STUCK = object()
"""Yielded by a task that swallowed its evaporation too often; it is never resumed."""
MAX_DELIVERIES = 100
"""Deliveries of evaporation after which a task counts as stuck: code that catches BaseException in a loop would go on
for ever; a plan that awaits that often in its ``finally`` blocks without a shield has not been met."""


def evaporate(scheduler: Scheduler, root: Task, through_shields: bool = False) -> bool:
    """Evaporate a subtree, children first; True if this changed something.

    A task that has not begun never begins; a shielded one goes on until its shield ends, with all it started inside.
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
        # What a shield keeps, or what was reached before, is left alone; a drain comes through everything.
        if (task.shields or task.doomed) and not through_shields:
            continue
        task.doomed = True
        _reach(scheduler, task, stack, through_shields)
    return changed


def heed_interrupts(scheduler: Scheduler, root: Task) -> None:
    """Evaporate the plan at the first Ctrl-C, so that its cleanups run; drain it at the second one."""
    if scheduler.interrupts != scheduler.heeded and not scheduler.draining:
        scheduler.heeded = scheduler.interrupts
        if scheduler.interrupts > 1:
            raise KeyboardInterrupt
        if scheduler.observer is not None:
            scheduler.observer.write(scheduler.now, "interrupted")
        evaporate(scheduler, root)


def _reach(scheduler: Scheduler, task: Task, stack: list[Task], through_shields: bool) -> None:
    """Raise evaporation where a task waits, or have its branches evaporated first."""
    scope = task.scope
    if scope is not None and not scope.complete:
        # Its branches first; when they are dead the scope releases the task, and evaporation is raised there.
        scope.over = True
        stack.extend(reversed(scope.live))
    elif task is not scheduler.current and not task.woken:
        # It waits. What runs, or is about to with a value that it was woken with, meets it at the next checkpoint.
        if through_shields or not _undisturbed(task):
            scheduler.throw(task, delivery(task, scheduler.draining))
    elif through_shields and task.woken and not task.in_queue:
        # Woken while it was held: a drain lets it go on.
        scheduler.enqueue(task)


def _undisturbed(task: Task) -> bool:
    return isinstance(task.wait, Wait) and task.wait.undisturbed


def delivery(task: Task, draining: bool) -> BaseException:
    """Return what is raised in a doomed task: what breaks it off, or evaporation."""
    if task.overrun is not None:
        error, task.overrun = task.overrun, None
        _review(task, draining)
        return error
    return Evaporated()


def _review(task: Task, draining: bool) -> None:
    """Work out again whether evaporation reaches the task now."""
    task.doomed = draining or task.overrun is not None or (task.cancelled and not task.shields)


def break_off(scheduler: Scheduler, task: Task, error: BaseException) -> None:
    """Raise an error where the task waits, once what it waits for is dead, or else at its next checkpoint."""
    task.overrun = error
    task.doomed = True
    scope = task.scope
    if scope is not None and not scope.complete:
        scope.close()
    elif not task.woken and not _undisturbed(task):  # else the error waits for the next checkpoint
        scheduler.throw(task, delivery(task, scheduler.draining))


@types.coroutine
def deliver(task: Task) -> Generator[object, Any, None]:
    """Raise what is due at a checkpoint of a doomed task."""
    scheduler = here()[0]
    if task.overrun is not None:
        raise delivery(task, scheduler.draining)
    task.deliveries += 1
    if task.deliveries > MAX_DELIVERIES:
        yield STUCK
    if task.thrown and not scheduler.draining:  # not the first time: code of a cleanup awaits without a shield
        _warn_cut_short(task)
    task.thrown = True
    raise Evaporated


async def checkpoint() -> None:
    """Let the other tasks of this step run; a delivery point for evaporation and suspension."""
    scheduler, task = here()
    if task.doomed:
        await deliver(task)
    scheduler.wake(task)
    await park("its turn")
    if task.doomed:  # since it was in the queue already, evaporation could not be raised where it waited
        await deliver(task)


_SHIELD = Usage("with shield", {}, {"within": "30"})


class shield:  # noqa: N801 - used like a function: with shield(within=10)
    """``with shield(within=10):`` keeps evaporation from outside away until the block ends.

    It reaches neither the task nor what the task starts inside. When the block has not ended after ``within`` seconds
    of plan time, :class:`CleanupOverrun` is raised in it. Evaporation from inside works as usual.
    """

    def __init__(self, within: float = 10.0) -> None:
        self.within = within
        self._timers: list[Timer] = []
        self._error: CleanupOverrun | None = None

    def __enter__(self) -> None:
        self._scheduler, self._task = scheduler, task = here()
        steps = scheduler.steps(self.within, _SHIELD, "within")
        task.shields += 1
        _review(task, scheduler.draining)
        self._timers.append(scheduler.deadline(task, steps, self._overrun))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._timers.pop().drop()
        if self._task.overrun is self._error:  # not raised any more: an outer shield's error came before it
            self._task.overrun = None
        self._task.shields -= 1
        _review(self._task, self._scheduler.draining)

    def _overrun(self) -> None:
        task = self._task
        if isinstance(task.error, CleanupOverrun):  # of an outer shield, in this step: one cleans up, one is enough
            return
        where = f"in {task.path} took longer than {self.within} s{place_of(task)}"
        advice = "a cleanup that needs more says so: unwind_protect(body, cleanup, within=30), shield(within=30)"
        self._error = CleanupOverrun(f"shielded code {where}; {advice}")
        break_off(self._scheduler, task, self._error)


def _warn_cut_short(task: Task) -> None:
    """Warn that code after the delivery of evaporation awaits without a shield."""
    frame = user_frame()
    warnings.warn_explicit(
        f"{task.path} is being evaporated, so this await is cut short; cleanup that waits belongs into "
        "unwind_protect(body, cleanup) or a shield()",
        CutShort,
        frame.f_code.co_filename,
        frame.f_lineno,
        registry=frame.f_globals.setdefault("__warningregistry__", {}),  # once a line, unless it is asked for always
    )


def suspend(scheduler: Scheduler, task: Task) -> bool:
    """Hold a subtree; True if this changed something.

    Raises PlanStructureError when a task would hold itself or an ancestor of its own. What a hook raises is raised when
    all hooks have run, and nothing is held then: a suspension takes effect or fails, never both.
    """
    if task.dead or task.cancelled:
        return False
    runner = scheduler.current
    while runner is not None:
        if runner is task:
            raise PlanStructureError(f"a task cannot suspend itself or what waits for it: {task.path}")
        runner = runner.group.owner if runner.group is not None else None
    task.count += 1
    if task.count > 1:  # it is held already, with all below it
        return True
    held: list[Task] = []
    error: Exception | None = None
    for one in _subtree(task):
        one.holds += 1
        if one.holds == 1:  # not held by a suspension of an ancestor before
            held.append(one)
            one.show(Status.SUSPENDED)
            for timer in one.timers or ():
                timer.freeze()
    for one in reversed(held):  # children first
        for hook in reversed(one.hooks or ()):
            try:
                one.context.copy().run(hook)
            except Exception as raised:  # the others still have to stop what they are for
                error = error or raised
    if error is not None:
        wake_up(scheduler, task)
        raise error
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
    """Let an evaporated task go on: what runs of it is its cleanup, with all that it has started inside a shield."""
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
        # What it was woken with while it was held has not taken effect: evaporation comes before it, errors do not
        # get lost.
        if task.begun and not _must_be_seen(task):
            task.error, task.value = Evaporated(), None
        if not task.in_queue:
            scheduler.enqueue(task)


def _must_be_seen(task: Task) -> bool:
    """Return whether the task was woken with an error, or a branch of what it waits for has crashed."""
    return task.error is not None or (task.scope is not None and task.scope.crash is not None)


def _let_go(scheduler: Scheduler, task: Task) -> None:
    """Let a task go on that nothing holds any more."""
    for timer in task.timers or ():
        if not timer.passed and timer.due is None:  # it has not fired, and stands still
            timer.thaw()
    if not task.cancelled:
        task.show(task.status)
    if task.woken:
        if not task.in_queue:
            scheduler.enqueue(task)
    # What it waits for may have come true, and false again, while it was held: only what is true now counts.
    elif isinstance(task.wait, Wait):
        task.wait.recheck()


def _subtree(task: Task, cancelled: bool = False) -> list[Task]:
    """Return the task and its live descendants, parents first; without what is being evaporated, unless asked for."""
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
