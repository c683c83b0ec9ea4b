"""The watchdog: interrupts code of a plan that reaches no checkpoint.

It looks from a thread of its own, shared by all runs of the process, and interferes only when code has computed for as
long as the host allows, or has waited for that long without computing, or when Ctrl-C was pressed twice and the plan's
code does not come back to the scheduler. Computing is measured in the run's own processor time, so that a machine that
is busy with other things does not decide how a plan ends. Nothing of it is told in a trace.
"""

from __future__ import annotations

import ctypes
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from types import FrameType, TracebackType

from planlang.kernel.core import Scheduler
from planlang.kernel.errors import Overdue
from planlang.kernel.listing import is_own

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

    def __init__(self, scheduler: Scheduler, period: float | None, by_signal: bool = False) -> None:
        self.scheduler = scheduler
        self.period = period
        self.by_signal = by_signal
        """Ctrl-C is handled here, in the main thread: the run can be interrupted by a signal."""
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
        """Of the thread that the run is in [s]; 0 where it cannot be told: then only time that passes counts."""
        if not hasattr(time, "pthread_getcpuclockid"):
            return 0.0
        return time.clock_gettime(time.pthread_getcpuclockid(self._thread))  # it lives as long as it is watched

    def _summon(self, kind: type[BaseException]) -> None:
        frame = sys._current_frames().get(self._thread)
        if frame is None or is_own(frame.f_code.co_filename) or (kind is Overdue and _debugged(frame)):
            return
        self._summons = kind, self._mark
        if self.by_signal and hasattr(signal, "pthread_kill"):
            signal.pthread_kill(self._thread, signal.SIGINT)
        else:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._thread), ctypes.py_object(kind))

    def answer(self, frame: FrameType | None) -> bool:
        """In the signal handler: False if the signal is a Ctrl-C; else raise what was meant, if it still applies."""
        if self._summons is None:
            return False
        (kind, mark), self._summons = self._summons, None
        applies = self.scheduler.interrupted if kind is KeyboardInterrupt else mark == self.scheduler.progress()
        if applies and frame is not None and not is_own(frame.f_code.co_filename):
            raise kind
        return True


def _debugged(frame: FrameType | None) -> bool:
    """Return whether the code stands in a debugger."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).partition(".")[0] in _DEBUGGERS:
            return True
        frame = frame.f_back
    return False


def where(traceback: TracebackType | None) -> str:
    """``file.py:12`` of the innermost line that is not ours."""
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
