"""Running a plan to its end, and the shutdown of a run that cannot go on."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from types import FrameType
from typing import Any

from planlang.kernel.cancel import evaporate
from planlang.kernel.core import Scheduler, Task, running
from planlang.kernel.environment import Watch, quiet_collector, signals, unawaited_are_errors, watchdog, where
from planlang.kernel.errors import NoProgress, Overdue, PlanStructureError
from planlang.kernel.event_loop import adopt, keep, loop, rest
from planlang.kernel.hosts import WATCHDOG
from planlang.kernel.tree import name_of


def run_plan(scheduler: Scheduler, branch: Callable[[], Any]) -> Any:
    """Run a plan to its end and return its result, or raise what left it."""
    if running.scheduler is not None:
        raise PlanStructureError("a plan is running already; await the inner plan instead of running it")
    with unawaited_are_errors():
        return _run(scheduler, Task(None, None, name_of(branch), branch, 0))


def _run(scheduler: Scheduler, root: Task) -> Any:
    observer = scheduler.observer
    running.scheduler = scheduler
    hooks = sys.get_asyncgen_hooks()
    sys.set_asyncgen_hooks(firstiter=partial(adopt, scheduler), finalizer=keep)
    try:
        if observer is not None:
            observer.begin(root, partial(_spoil, scheduler))
        with quiet_collector():
            _watched(scheduler, root)
    finally:
        scheduler.over = True
        sys.set_asyncgen_hooks(*hooks)
        running.scheduler = None
        if observer is not None:
            observer.end()
    return _outcome(scheduler, root)


def _watched(scheduler: Scheduler, root: Task) -> None:
    """Drive the run, with a watchdog and a handler for Ctrl-C."""
    period = getattr(scheduler.host, "watchdog", WATCHDOG)
    watch = Watch(scheduler, period)
    with signals(partial(_interrupt, scheduler, watch)) as watch.by_signal, watchdog.watching(watch):
        scheduler.enqueue(root)
        if scheduler.live is not None:
            scheduler.live.begin()
        try:
            loop(scheduler, root)
        except BaseException as error:
            _drain(scheduler, root, error)
            if isinstance(error, Overdue):
                raise _unresponsive(scheduler, period, error) from None
            raise


def _spoil(scheduler: Scheduler, error: BaseException) -> None:
    """End a run that cannot be observed any further, for nobody could tell what it did."""
    error.add_note(f"raised by the trace at world step {scheduler.now}; the run was ended")
    scheduler.spoilt = scheduler.spoilt or error


def _interrupt(scheduler: Scheduler, watch: Watch, frame: FrameType | None) -> None:
    """Ctrl-C, called between byte codes: only takes note. The watchdog insists where the plan does not react."""
    if not watch.answer(frame):
        scheduler.interrupts += 1
        scheduler.inbox.put(None)
        if scheduler.interrupts > 1:
            watchdog.nudge()


def _outcome(scheduler: Scheduler, root: Task) -> Any:
    """Return what the run returns or raises, when its top-level task is dead."""
    if root.crash is not None:  # a programming error beats the Ctrl-C that may have brought it to light
        raise root.crash
    if scheduler.interrupts:
        raise KeyboardInterrupt
    if root.failure is not None:
        raise root.failure
    return root.result


def _unresponsive(scheduler: Scheduler, period: float | None, error: Overdue) -> NoProgress:
    """Return the error of a run that the watchdog has interrupted."""
    task = "the run" if scheduler.overdue is None else scheduler.overdue.path
    return NoProgress(
        f"{task} did not reach a checkpoint for more than {period} s, at {where(error.__traceback__)}; "
        "blocking code belongs into await in_thread(f), long loops await checkpoint() now and then"
    )


def _drain(scheduler: Scheduler, root: Task, cause: BaseException) -> None:
    """Evaporate everything, shields or not; time stands still and every wait raises."""
    if scheduler.observer is not None and not isinstance(cause, Overdue):
        scheduler.observer.write(scheduler.now, "drained", because=type(cause).__name__)
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
