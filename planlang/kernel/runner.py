"""Running a plan to its end, shutting down after an error, and the process-wide state during a run.

A coroutine that a plan never awaits: Python warns when it is garbage-collected, and an otherwise successful run raises
an error. For a coroutine that outlives the run, as in a global list, only Python's own warning remains.

The watchdog interrupts code of a plan that does not reach a checkpoint. It runs in one thread for all runs of the
process, and interferes only if code has computed for as long as the host allows, or has blocked for that long, or if
Ctrl-C was pressed twice and the plan does not return to the scheduler. Computing is measured in processor time of the
run's thread, so that other load of the machine does not change the outcome of a plan. The trace does not show the
watchdog.
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
from types import FrameType
from typing import Any

from planlang.kernel.cancel import evaporate
from planlang.kernel.core import Scheduler, Task, running
from planlang.kernel.errors import NoProgress, Overdue, PlanStructureError
from planlang.kernel.event_loop import ORIGINS, adopt, keep, loop, rest
from planlang.kernel.hosts import WATCHDOG
from planlang.kernel.tracebacks import is_own, lines_of
from planlang.kernel.tree import name_of
from planlang.misuse import contrast

YOUNG = 500_000
"""Allocations before the garbage collector runs: scanning live tasks again and again costs more than running them.

Enough for 100,000 live tasks; the price is that cyclic garbage is freed later."""


@contextmanager
def quiet_collector() -> Iterator[None]:
    """Raise the threshold of the garbage collector for the block."""
    before = gc.get_threshold()
    if before[0] and before[0] < YOUNG:
        gc.set_threshold(YOUNG, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


TERMINATION_SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
"""Signals that end a run with its cleanups."""


@contextmanager
def handle_signals(
    from_watchdog: Callable[[FrameType | None], bool], interrupt: Callable[[], None]
) -> Iterator[int | None]:
    """Call ``interrupt`` for each signal whose handler raises KeyboardInterrupt; in the main thread only.

    Python's own handler of SIGINT raises it, and a program's handlers of SIGTERM and SIGHUP may. ``from_watchdog``
    answers signals that the watchdog sent. Ignored signals stay ignored. Yields one of the handled signals, if any.
    """
    handlers: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: handler for number in TERMINATION_SIGNALS if callable(handler := signal.getsignal(number))}

    def handle(number: int, frame: FrameType | None) -> None:
        if not from_watchdog(frame):
            try:
                handlers[number](number, frame)
            except KeyboardInterrupt:
                interrupt()

    for number in handlers:
        signal.signal(number, handle)
    try:
        yield next(iter(handlers), None)
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)


_WARNING = re.compile(r"coroutine '(.+)' was never awaited")
_MADE_AT = re.compile(r'^  File "(.+)", line (\d+), in .*(?:\n    (.*))?$', re.MULTILINE)


class _Unawaited(threading.local):
    errors: list[PlanStructureError] | None = None
    """Errors of the run in this thread."""


_unawaited = _Unawaited()
_lock = threading.Lock()
_active_runs = 0
_saved_filters = warnings.catch_warnings()
_original_showwarning: Callable[..., Any] = warnings.showwarning


def _showwarning(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
    error = _unawaited_error(str(message)) if _unawaited.errors is not None and category is RuntimeWarning else None
    if error is None or _unawaited.errors is None:
        _original_showwarning(message, category, *where, **more)
    else:
        _unawaited.errors.append(error)


def _unawaited_error(message: str) -> PlanStructureError | None:
    """Convert Python's warning to an error; None for other warnings, and for coroutines created before the run."""
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
    """Raise PlanStructureError at the end of a successful block in which a coroutine was created but not awaited.

    Filters of warnings are process-wide: the first of several runs in different threads changes them, the last one
    restores them.
    """
    global _active_runs, _saved_filters, _original_showwarning
    with _lock:
        _active_runs += 1
        if _active_runs == 1:
            _saved_filters = warnings.catch_warnings()
            _saved_filters.__enter__()
            _original_showwarning, warnings.showwarning = warnings.showwarning, _showwarning
            warnings.filterwarnings("always", _WARNING.pattern, RuntimeWarning)
    depth = sys.get_coroutine_origin_tracking_depth()
    sys.set_coroutine_origin_tracking_depth(ORIGINS)
    errors = _unawaited.errors = []
    try:
        yield
    finally:
        _unawaited.errors = None
        sys.set_coroutine_origin_tracking_depth(depth)
        with _lock:
            _active_runs -= 1
            if not _active_runs:
                _saved_filters.__exit__(None, None, None)
    if errors:
        first, *others = errors
        for other in others:
            first.add_note(f"another one: {str(other).partition(',')[0]}")
        raise first


# -- the watchdog

GRACE = 0.1
"""Time [s] that a plan has to return to the scheduler after the second Ctrl-C."""
INSIST = 0.02
"""Time [s] between attempts to interrupt, repeated because code of the scheduler itself is never interrupted."""
WAITS = 0.01
"""Share of a processor below which code counts as blocked."""
_IDLE_LOOKS = 5
_DEBUGGERS = ("bdb", "pdb", "pydevd", "_pydevd_bundle", "debugpy")


class Watch:
    """State of one run for the watchdog."""

    def __init__(self, scheduler: Scheduler, period: float | None, signal_number: int | None = None) -> None:
        self.scheduler = scheduler
        self.period = period
        self.signal_number = signal_number
        """Signal that interrupts the run; None outside the main thread."""
        self._thread = threading.get_ident()
        self._progress: tuple[int, ...] = ()
        self._computed = 0.0
        """Processor time of the run at its last progress [s]."""
        self._blocked_since = 0.0, 0.0
        """Time since which the run has hardly computed, and its processor time then [s]."""
        self._pressed_at: float | None = None
        self._request: tuple[type[BaseException], tuple[int, ...]] | None = None

    def look(self, now: float) -> float:
        """Check the run at time ``now`` [s], interrupt it if necessary; return the time until the next check [s]."""
        scheduler, period = self.scheduler, self.period
        progress, computed = scheduler.progress(), self._processor_time()
        if progress != self._progress or scheduler.idle:
            self._progress, self._computed = progress, computed
            self._blocked_since = now, computed
        elif period is not None:
            since, before = self._blocked_since
            if computed - before >= WAITS * period:
                self._blocked_since = since, _ = now, computed
            if max(computed - self._computed, now - since) >= period:
                self._interrupt(Overdue)
                return INSIST
        if scheduler.interrupts > 1 and scheduler.interrupted:
            if self._pressed_at is None:
                self._pressed_at = now
            elif now - self._pressed_at >= GRACE:
                self._interrupt(KeyboardInterrupt)
            return INSIST
        self._pressed_at = None
        return 1.0 if period is None else min(1.0, period / 10)

    def _processor_time(self) -> float:
        """Processor time of the run's thread [s]; 0 where the system does not measure it, so that only time counts."""
        if not hasattr(time, "pthread_getcpuclockid"):
            return 0.0
        return time.clock_gettime(time.pthread_getcpuclockid(self._thread))  # the thread outlives its watch

    def _interrupt(self, kind: type[BaseException]) -> None:
        frame = sys._current_frames().get(self._thread)
        if frame is None or is_own(frame.f_code.co_filename) or (kind is Overdue and _debugged(frame)):
            return
        self._request = kind, self._progress
        if self.signal_number is not None and hasattr(signal, "pthread_kill"):
            signal.pthread_kill(self._thread, self.signal_number)
        else:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._thread), ctypes.py_object(kind))

    def answer(self, frame: FrameType | None) -> bool:
        """Handle a signal; False if the watchdog did not send it. Raises the requested error, if it still applies."""
        if self._request is None:
            return False
        (kind, progress), self._request = self._request, None
        applies = self.scheduler.interrupted if kind is KeyboardInterrupt else progress == self.scheduler.progress()
        if applies and frame is not None and not is_own(frame.f_code.co_filename):
            raise kind
        return True


@contextmanager
def unwatched() -> Iterator[None]:
    """Exempt a block from the watchdog of the run in this thread, if there is one.

    For a single long computation in code that cannot await; a plan uses ``await in_thread(f)`` instead.
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
    """Check whether Ctrl-C was pressed during the run in this thread."""
    return running.scheduler is not None and running.scheduler.interrupts > 0


def interrupter() -> Callable[[], None] | None:
    """Return a function that interrupts the run in this thread as Ctrl-C does; None without a run.

    Any thread may call it, also where SIGINT is ignored, as in commands that a script starts in the background.
    """
    return None if running.scheduler is None else partial(_interrupt, running.scheduler)


def _debugged(frame: FrameType | None) -> bool:
    """Check whether the code runs in a debugger."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).partition(".")[0] in _DEBUGGERS:
            return True
        frame = frame.f_back
    return False


class _Watchdog:
    """Thread that checks all runs of the process. It ends by itself after a few seconds without a run."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._watches: dict[Watch, None] = {}
        self._nudges: SimpleQueue[None] = SimpleQueue()
        self._thread: threading.Thread | None = None
        self._pace = 1.0

    @contextmanager
    def watching(self, watch: Watch) -> Iterator[None]:
        """Check a run during the block."""
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
        """Check all runs now; safe in signal handlers."""
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
    """Run a plan to its end; return its result or raise its failure or error."""
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
    """Run the event loop with the watchdog and the signal handlers."""
    period = getattr(scheduler.host, "watchdog", WATCHDOG)
    watch = Watch(scheduler, period)
    interrupt = partial(_interrupt, scheduler)
    with handle_signals(watch.answer, interrupt) as watch.signal_number, watchdog.watching(watch):
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
    """End a run that can no longer be recorded."""
    error.add_note(f"raised by the trace at world step {scheduler.now}; the run was ended")
    scheduler.spoilt = scheduler.spoilt or error


def _interrupt(scheduler: Scheduler) -> None:
    """Count a Ctrl-C, in the signal handler or another thread; at the second, the watchdog interrupts the plan."""
    scheduler.interrupts += 1
    scheduler.inbox.put(None)
    if scheduler.interrupts > 1:
        watchdog.nudge()


def _outcome(scheduler: Scheduler, root: Task) -> Any:
    """Return the result of the top-level task, or raise its error or failure."""
    if root.crash is not None:  # a programming error takes precedence over the Ctrl-C that may have caused it
        raise root.crash
    if scheduler.interrupts:
        raise KeyboardInterrupt
    if root.failure is not None:
        raise root.failure
    return root.result


def _unresponsive(scheduler: Scheduler, period: float | None, error: Overdue) -> NoProgress:
    """Error for a run that the watchdog interrupted."""
    task = "the run" if scheduler.overdue is None else scheduler.overdue.path
    place = next((f"{file}:{line}" for file, line in reversed(lines_of(error))), "an unknown line")
    return NoProgress(
        f"{task} did not reach a checkpoint for more than {period} s, at {place}; "
        "call blocking code with await in_thread(f), and await checkpoint() in long loops"
    )


def _drain(scheduler: Scheduler, root: Task, cause: BaseException) -> None:
    """Evaporate all tasks in spite of shields; plan time does not advance, and every wait raises."""
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
        except BaseException as error:  # a task that does not end; the others still have to be evaporated
            scheduler.heeded = scheduler.interrupts
            if error is not cause:  # the cause itself is raised again in each construct around its branch
                stuck = stuck or error
    if stuck is not None:
        raise stuck from cause
