"""Real time: plan time follows a clock, and threads talk to the plan through an inbox."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Protocol, Self, runtime_checkable

from planlang.kernel.hosts import WATCHDOG, Host, checked
from planlang.kernel.inbox import PATIENCE, Inbox
from planlang.misuse import Usage


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
