"""How a run ends: with what its top-level task gave, or drained because it cannot go on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from planlang.kernel.errors import NoProgress
from planlang.kernel.evaporation import evaporate
from planlang.kernel.rounds import rest
from planlang.kernel.watchdog import Overdue, where

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.task import Task


def outcome_of(scheduler: Scheduler, root: Task) -> Any:
    """What the run returns or raises, when its top-level task is dead."""
    if root.crash is not None:
        raise root.crash
    if scheduler.interrupts:
        raise KeyboardInterrupt
    if root.failure is not None:
        raise root.failure
    return root.result


def unresponsive(scheduler: Scheduler, period: float | None, error: Overdue) -> NoProgress:
    """The error of a run that the watchdog has interrupted."""
    task = "the run" if scheduler.overdue is None else scheduler.overdue.path
    return NoProgress(
        f"{task} did not reach a checkpoint for more than {period} s, at {where(error.__traceback__)}; "
        "blocking code belongs into await in_thread(f), long loops await checkpoint() now and then"
    )


def drain(scheduler: Scheduler, root: Task, cause: BaseException) -> None:
    """Evaporate everything, shields or not; time stands still and every wait raises."""
    if scheduler.trace is not None and not isinstance(cause, Overdue):
        scheduler.trace.write(scheduler.now, "drained", because=type(cause).__name__)
    scheduler.draining = True
    scheduler.idle = False
    scheduler.fatal = None
    scheduler.heeded = scheduler.interrupts
    stuck: BaseException | None = None
    while not root.dead:
        evaporate(scheduler, root, through_shields=True)
        try:
            rest(scheduler, root)
        except BaseException as error:  # of a task that would not end; all others still have to
            scheduler.heeded = scheduler.interrupts
            if error is not cause:  # which passes each construct around the branch that raised it
                stuck = stuck or error
    if stuck is not None:
        raise stuck from cause
