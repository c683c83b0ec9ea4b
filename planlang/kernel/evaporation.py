"""Evaporation: who is reached, shields, and the warning for cleanup code that forgot its shield."""

from __future__ import annotations

import warnings
from types import TracebackType
from typing import TYPE_CHECKING

from planlang.kernel.errors import CleanupOverrun, CutShort
from planlang.kernel.listing import place_of, user_frame
from planlang.kernel.park import here
from planlang.kernel.suspension import unhold
from planlang.kernel.task import Status, Task
from planlang.misuse import Usage

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.timers import Timer


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
            if task.watched is not None:
                task.watched.set(Status.EVAPORATING)
        if not task.begun:
            scheduler.finish(task, Status.EVAPORATED)
            continue
        if task.shields and not through_shields:
            continue
        if task.doomed and not through_shields:
            continue
        task.doomed = True
        scope = task.scope
        if scope is not None and not scope.complete:
            scope.over = True
            stack.extend(reversed(scope.live))
        elif task is not scheduler.current and not task.woken:
            if through_shields or not scheduler.calls.holds(task):
                scheduler.throw(task, scheduler.delivery(task))
        elif through_shields and task.woken and not task.in_queue:
            scheduler.enqueue(task)
    return changed


def review(scheduler: Scheduler, task: Task) -> None:
    """Work out again whether evaporation reaches the task now."""
    task.doomed = scheduler.draining or task.overrun is not None or (task.cancelled and not task.shields)


def break_off(scheduler: Scheduler, task: Task, error: BaseException) -> None:
    """Raise an error where the task waits, once what it waits for is dead, or else at its next checkpoint."""
    task.overrun = error
    task.doomed = True
    scope = task.scope
    if scope is not None and not scope.complete:
        scope.close()
    elif not task.woken and not scheduler.calls.holds(task):
        scheduler.throw(task, scheduler.delivery(task))


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
        review(scheduler, task)
        self._timers.append(scheduler.deadline(task, steps, self._overrun))

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._timers.pop().drop()
        if self._task.overrun is self._error:  # not raised any more: an outer shield's error came before it
            self._task.overrun = None
        self._task.shields -= 1
        review(self._scheduler, self._task)

    def _overrun(self) -> None:
        task = self._task
        if isinstance(task.error, CleanupOverrun):  # of an outer shield, in this step: one cleans up, one is enough
            return
        where = f"in {task.path} took longer than {self.within} s{place_of(task)}"
        advice = "a cleanup that needs more says so: unwind_protect(body, cleanup, within=30), shield(within=30)"
        self._error = CleanupOverrun(f"shielded code {where}; {advice}")
        break_off(self._scheduler, task, self._error)


def warn_cut_short(task: Task) -> None:
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
