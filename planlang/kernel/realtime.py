"""Real time: plan time follows a clock, and threads talk to the plan through an inbox.

The inbox takes what threads, signal handlers and tests hand over to the thread that runs the plan.
"""

from __future__ import annotations

import functools
import time
from collections import deque
from collections.abc import Callable
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Protocol, Self, runtime_checkable

from planlang.kernel.hosts import WATCHDOG, Host, checked
from planlang.misuse import Usage

Item = Callable[[], object]

PATIENCE = 0.1
"""Longest uninterrupted wait [s]; where locks cannot be interrupted by signals, Ctrl-C is noticed this often."""


class Inbox:
    """First in, first out; any thread may :meth:`put`, only the run's own thread waits and takes.

    A ``SimpleQueue``, because its ``put`` may interrupt its ``get`` in the same thread, as a signal handler does.
    """

    def __init__(self) -> None:
        self._queue: SimpleQueue[Item | None] = SimpleQueue()
        self._seen: deque[Item | None] = deque()  # taken out of the queue by waiting for it

    def put(self, item: Item | None) -> None:
        """Hand over what is to be called in the run's thread; None only wakes it."""
        self._queue.put(item)

    @property
    def filled(self) -> bool:
        """True if something is there."""
        return bool(self._seen) or not self._queue.empty()

    def wait(self, seconds: float = PATIENCE) -> None:
        """Wait until something is there, but not longer than ``seconds`` and :data:`PATIENCE`."""
        try:
            self._seen.append(self._queue.get(timeout=min(seconds, PATIENCE)))
        except Empty:
            return

    def take(self) -> list[Item]:
        """Return what is there now; what comes meanwhile stays for the next time."""
        seen = self._seen
        for _ in range(self._queue.qsize()):
            seen.append(self._queue.get())
        items = [item for item in seen if item is not None]
        seen.clear()
        return items


@runtime_checkable
class LiveHost(Host, Protocol):
    """A host whose time passes by itself, and to which things happen that no task has done."""

    inbox: Inbox
    sources: dict[Source, None]
    """Sources that are open: as long as there is one, something may still wake a waiting plan."""

    def begin(self) -> None:
        """A run begins: step 0 is now."""


_REAL_TIME = Usage(
    "RealTimeHost", {"rate": "240"}, {"clock": "time.monotonic", "sleep": "time.sleep", "watchdog": "10.0"}
)


class RealTimeHost:
    """Plan time at the pace of a clock, ``rate`` steps per second.

    Between steps the plan reacts at once to what threads hand in with :meth:`post`: functions that are called in the
    plan's thread, such as ``fluent.set``. A plan that is late catches up: each step comes, in order, without waiting.
    Wait fluents that threads set keep the run alive only while a :meth:`source` is open; without one, a plan in which
    nothing can go on is a deadlock as on every other host.

    ``clock`` gives seconds and never goes back; ``sleep`` waits at most the seconds it is given. Without ``sleep`` the
    host waits for the inbox itself. ``watchdog`` is the longest time [s] in which code may run without reaching a
    checkpoint; None switches the watchdog off.
    """

    jumps = True

    def __init__(
        self,
        rate: int = 240,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], object] | None = None,
        watchdog: float | None = WATCHDOG,
    ) -> None:
        self.rate = checked(_REAL_TIME, rate, watchdog)
        _REAL_TIME.plain("clock", clock, "a function that gives seconds and never goes back")
        if sleep is not None:
            _REAL_TIME.plain("sleep", sleep, "a function that waits at most the seconds it is given")
        self.watchdog = watchdog
        self.inbox = Inbox()
        self.sources: dict[Source, None] = {}
        self._clock = clock
        self._sleep = sleep
        self._start = 0.0
        self._passed = 0

    def begin(self) -> None:
        """Step 0 is now."""
        self._start = self._clock()
        self._passed = 0

    def post(self, function: Callable[..., object], *arguments: Any) -> None:
        """From any thread: have ``function(*arguments)`` called in the plan's thread, between two steps of its tasks.

        What it raises ends the run.
        """
        self.inbox.put(functools.partial(function, *arguments))

    def source(self, name: str) -> Source:
        """Announce a thread or driver that posts; the run waits for it until it is closed."""
        return Source(self, name)

    def advance(self, steps: int) -> int:
        """Let ``steps`` pass, fewer when something comes into the inbox; returns how many have passed."""
        inbox = self.inbox
        due = (self._passed + steps) / self.rate
        while True:
            elapsed = self._clock() - self._start
            if elapsed >= due:
                passed = steps
                break
            if inbox.filled:
                passed = min(max(0, int(elapsed * self.rate) - self._passed), steps - 1)
                break
            if self._sleep is None:
                inbox.wait(due - elapsed)
            else:
                self._sleep(min(due - elapsed, PATIENCE))
        self._passed += passed
        return passed


class Source:
    """Something outside the plan that may still happen. Open from its creation to :meth:`close`; a context manager."""

    def __init__(self, host: RealTimeHost, name: str) -> None:
        self.name = name
        self._host = host
        host.sources[self] = None

    def post(self, function: Callable[..., object], *arguments: Any) -> None:
        """As :meth:`RealTimeHost.post`."""
        self._host.post(function, *arguments)

    def close(self) -> None:
        """Nothing will come any more. From any thread, after what it posted; closing twice is allowed."""
        self._host.post(self._host.sources.pop, self, None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
