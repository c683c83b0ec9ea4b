"""Running a plan to its end, the shutdown of a run that cannot go on, and the process around a run.

A coroutine that a plan makes and never awaits: Python warns of it when it is freed, and a run that went well otherwise
fails for it. One that outlives the run, as in a global list, stays Python's warning.

The watchdog interrupts code of a plan that reaches no checkpoint. It looks from a thread of its own, shared by all runs
of the process, and interferes only when code has computed for as long as the host allows, or has waited for that long
without computing, or when Ctrl-C was pressed twice and the plan's code does not come back to the scheduler. Computing
is measured in the run's own processor time, so that a machine that is busy with other things does not decide how a plan
ends. Nothing of it is written into a trace.
"""

from __future__ import annotations

import ctypes
import gc
import os
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from queue import Empty, SimpleQueue
from types import FrameType, TracebackType
from typing import Any

from planlang.kernel.cancel import evaporate
from planlang.kernel.core import Scheduler, Task, running
from planlang.kernel.errors import NoProgress, Overdue, PlanStructureError
from planlang.kernel.event_loop import ORIGINS, adopt, keep, loop, rest
from planlang.kernel.hosts import WATCHDOG
from planlang.kernel.listing import is_own
from planlang.kernel.tree import name_of
from planlang.misuse import contrast

YOUNG = 500_000
"""Allocations before the collector looks: live tasks are no garbage, and looking at them costs more than they do.

Enough for 100,000 tasks at a time; what refers to itself and is garbage waits as long."""


@contextmanager
def quiet_collector() -> Iterator[None]:
    """Raise the collector's threshold, and restore it."""
    before = gc.get_threshold()
    if before[0] and before[0] < YOUNG:
        gc.set_threshold(YOUNG, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that may end a run in order."""


@contextmanager
def signals(is_answered: Callable[[FrameType | None], bool], interrupt: Callable[[], None]) -> Iterator[int | None]:
    """In the main thread, let each signal whose handler raises KeyboardInterrupt call ``interrupt`` instead.

    Python's own handler of SIGINT does so, and those that a program sets for SIGTERM or SIGHUP may. Signals that
    ``is_answered`` takes were sent by the watchdog. Ignored signals stay ignored. Yields a signal that is handled here.
    """
    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: handler for number in ENDING if callable(handler := signal.getsignal(number))}

    def handle(number: int, frame: FrameType | None) -> None:
        if not is_answered(frame):
            try:
                before[number](number, frame)
            except KeyboardInterrupt:
                interrupt()

    for number in before:
        signal.signal(number, handle)
    try:
        yield next(iter(before), None)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


_WARNING = re.compile(r"coroutine '(.+)' was never awaited")
_MADE_AT = re.compile(r'^  File "(.+)", line (\d+), in .*(?:\n    (.*))?$', re.MULTILINE)


class _Found(threading.local):
    errors: list[PlanStructureError] | None = None
    """Of the run in this thread."""


_found = _Found()
_lock = threading.Lock()
_runs = 0
_before = warnings.catch_warnings()
_show: Callable[..., Any] = warnings.showwarning


def _showwarning(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
    error = _error(str(message)) if _found.errors is not None and category is RuntimeWarning else None
    if error is None or _found.errors is None:
        _show(message, category, *where, **more)
    else:
        _found.errors.append(error)


def _error(message: str) -> PlanStructureError | None:
    """Return the error for a warning; None if it is another one, or is about what was made before the run."""
    warning = _WARNING.match(message)
    places = [place for place in _MADE_AT.findall(message) if not is_own(place[0])]
    if warning is None or not places:
        return None
    file, line, source = places[-1]  # the innermost
    name = warning[1].rpartition(".")[2]
    text = f"{os.path.basename(file)}:{line} calls {name}() without await, so nothing was done"
    return PlanStructureError(contrast(text, source or f"{name}(...)", f"await {name}(...)"))


@contextmanager
def unawaited_are_errors() -> Iterator[None]:
    """Raise PlanStructureError at the end of the block if it ends well, and a coroutine was made and not awaited.

    Filters of warnings belong to the process: the first of the runs that go on in it changes them, the last one
    restores them.
    """
    global _runs, _before, _show
    with _lock:
        _runs += 1
        if _runs == 1:
            _before = warnings.catch_warnings()
            _before.__enter__()
            _show, warnings.showwarning = warnings.showwarning, _showwarning
            warnings.filterwarnings("always", _WARNING.pattern, RuntimeWarning)
    depth = sys.get_coroutine_origin_tracking_depth()
    sys.set_coroutine_origin_tracking_depth(ORIGINS)
    errors = _found.errors = []
    try:
        yield
    finally:
        _found.errors = None
        sys.set_coroutine_origin_tracking_depth(depth)
        with _lock:
            _runs -= 1
            if not _runs:
                _before.__exit__(None, None, None)
    if errors:
        first, *others = errors
        for other in others:
            first.add_note(f"so it is here: {str(other).partition(',')[0]}")
        raise first


# -- the watchdog

GRACE = 0.1
"""Seconds in which a plan has to come back to the scheduler after the second Ctrl-C."""
INSIST = 0.02
"""Seconds between attempts to interrupt: code of the scheduler itself is let through first."""
WAITS = 0.01
"""Code that gets less than this share of a processor waits for something."""
_IDLE_LOOKS = 5
_DEBUGGERS = ("bdb", "pdb", "pydevd", "_pydevd_bundle", "debugpy")


class Watch:
    """One run as the watchdog sees it."""

    def __init__(self, scheduler: Scheduler, period: float | None, signal_number: int | None = None) -> None:
        self.scheduler = scheduler
        self.period = period
        self.signal_number = signal_number
        """Signal that is handled here, in the main thread, so that it can interrupt the run."""
        self._thread = threading.get_ident()
        self._mark: tuple[int, ...] = ()
        self._computed = 0.0
        """Processor time of the run when it last moved [s]."""
        self._waiting = 0.0, 0.0
        """Since when it has computed next to nothing, and its processor time then [s]."""
        self._pressed: float | None = None
        self._summons: tuple[type[BaseException], tuple[int, ...]] | None = None

    def look(self, now: float) -> float:
        """Look at the run at ``now`` [s], interrupt it if need be, and say how long to wait until the next look [s]."""
        scheduler, period = self.scheduler, self.period
        mark, computed = scheduler.progress(), self._processor_time()
        if mark != self._mark or scheduler.idle:
            self._mark, self._computed = mark, computed
            self._waiting = now, computed
        elif period is not None:
            since, before = self._waiting
            if computed - before >= WAITS * period:
                self._waiting = since, _ = now, computed
            if max(computed - self._computed, now - since) >= period:
                self._summon(Overdue)
                return INSIST
        if scheduler.interrupts > 1 and scheduler.interrupted:
            if self._pressed is None:
                self._pressed = now
            elif now - self._pressed >= GRACE:
                self._summon(KeyboardInterrupt)
            return INSIST
        self._pressed = None
        return 1.0 if period is None else min(1.0, period / 10)

    def _processor_time(self) -> float:
        """Return that of the run's thread [s]; 0 where it is unknown: then only time that passes counts."""
        if not hasattr(time, "pthread_getcpuclockid"):
            return 0.0
        return time.clock_gettime(time.pthread_getcpuclockid(self._thread))  # it lives as long as it is watched

    def _summon(self, kind: type[BaseException]) -> None:
        frame = sys._current_frames().get(self._thread)
        if frame is None or is_own(frame.f_code.co_filename) or (kind is Overdue and _debugged(frame)):
            return
        self._summons = kind, self._mark
        if self.signal_number is not None and hasattr(signal, "pthread_kill"):
            signal.pthread_kill(self._thread, self.signal_number)
        else:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._thread), ctypes.py_object(kind))

    def answer(self, frame: FrameType | None) -> bool:
        """Return False if the watchdog did not send the signal; else raise what it meant, if that still applies."""
        if self._summons is None:
            return False
        (kind, mark), self._summons = self._summons, None
        applies = self.scheduler.interrupted if kind is KeyboardInterrupt else mark == self.scheduler.progress()
        if applies and frame is not None and not is_own(frame.f_code.co_filename):
            raise kind
        return True


@contextmanager
def unwatched() -> Iterator[None]:
    """Let the block compute for as long as it takes: the watchdog does not count it, if a run goes on in this thread.

    For what has an end but takes long, once, in code that cannot wait. In a plan: ``await in_thread(f)``.
    """
    scheduler = running.scheduler
    if scheduler is None:
        yield
        return
    scheduler.idle = True
    try:
        yield
    finally:
        scheduler.idle = False


def is_interrupted() -> bool:
    """Return whether Ctrl-C has asked the run that goes on in this thread to end."""
    return running.scheduler is not None and running.scheduler.interrupts > 0


def _debugged(frame: FrameType | None) -> bool:
    """Return whether the code stands in a debugger."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).partition(".")[0] in _DEBUGGERS:
            return True
        frame = frame.f_back
    return False


def where(traceback: TracebackType | None) -> str:
    """Return ``file.py:12`` of the innermost line that is not ours."""
    place = "an unknown line"
    while traceback is not None:
        code = traceback.tb_frame.f_code
        if not is_own(code.co_filename):
            place = f"{code.co_filename.rpartition('/')[2]}:{traceback.tb_lineno}"
        traceback = traceback.tb_next
    return place


class _Watchdog:
    """The thread that looks. It ends by itself when there is no run for a few seconds."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._watches: dict[Watch, None] = {}
        self._nudges: SimpleQueue[None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._pace = 1.0

    @contextmanager
    def watching(self, watch: Watch) -> Iterator[None]:
        """Look at a run while the block lasts."""
        with self._lock:
            self._watches[watch] = None
            if self._thread is None or not self._thread.is_alive():
                self._thread = threading.Thread(target=self._loop, name="planlang watchdog", daemon=True)
                self._thread.start()
        if watch.period is not None and watch.period / 10 < self._pace:
            self.nudge()
        try:
            yield
        finally:
            with self._lock:
                del self._watches[watch]

    def nudge(self) -> None:
        """Look now. Signal handlers may call this."""
        self._nudges.put(None)

    def _loop(self) -> None:
        idle = 0
        while True:
            with suppress(Empty):
                self._nudges.get(timeout=self._pace)
            with self._lock:
                now = time.monotonic()
                self._pace = min((watch.look(now) for watch in self._watches), default=1.0)
                idle = 0 if self._watches else idle + 1
                if idle > _IDLE_LOOKS:
                    self._thread = None
                    return


watchdog = _Watchdog()


def run_plan(scheduler: Scheduler, branch: Callable[[], Any]) -> Any:
    """Run a plan to its end and return its result, or raise what left it."""
    if running.scheduler is not None:
        raise PlanStructureError("a plan is running already; await the inner plan instead of running it")
    with unawaited_are_errors():
        return _run(scheduler, Task(None, None, name_of(branch), branch, 0))


def _run(scheduler: Scheduler, root: Task) -> Any:
    observer = scheduler.observer
    running.begin(scheduler)
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
        running.begin(None)
        if observer is not None:
            observer.end()
    return _outcome(scheduler, root)


def _watched(scheduler: Scheduler, root: Task) -> None:
    """Drive the run, with a watchdog and handlers of signals."""
    period = getattr(scheduler.host, "watchdog", WATCHDOG)
    watch = Watch(scheduler, period)
    with signals(watch.answer, partial(_interrupt, scheduler)) as watch.signal_number, watchdog.watching(watch):
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


def _interrupt(scheduler: Scheduler) -> None:
    """Take note of a Ctrl-C between byte codes; the watchdog insists where the plan does not react."""
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
