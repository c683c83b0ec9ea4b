"""Plan time: hosts advance it in steps, timers fire at steps.

A real-time host follows a clock and has an inbox for calls from other threads. Timers are due at integer steps and
frozen while their task is held. Deadlines are timers that fire when no task of the step can run any more.
"""

from __future__ import annotations

import functools
import heapq
import time
from collections import deque
from collections.abc import Callable
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any, Protocol, Self, runtime_checkable

from planlang.misuse import Usage, WrongValue, amount


class TimerOwner(Protocol):
    """The part of a task that its timers need."""

    timers: list[Timer] | None

    @property
    def depth(self) -> int:
        """Number of constructs around the task."""


class Timer:
    """One-shot timer of a task: fires ``left`` steps from now unless dropped; frozen while the task is held.

    Only the running task creates and drops its timers, so that the task is not held then.
    """

    __slots__ = ("deadline", "due", "fire", "left", "queue", "task", "ticket")

    def __init__(
        self, queue: TimerQueue, task: TimerOwner, steps: int, fire: Callable[[], object], deadline: bool
    ) -> None:
        self.queue = queue
        self.task = task
        self.fire = fire
        self.deadline = deadline
        self.left = steps
        self.due: int | None = None
        self.ticket = 0
        if task.timers is None:
            task.timers = [self]
        else:
            task.timers.append(self)
        self.thaw()

    def freeze(self) -> None:
        """Stop the countdown."""
        if self.due is not None:
            self.left = self.due - self.queue.now
            self.due = None
            self.queue.forget()

    def thaw(self) -> None:
        """Continue the countdown."""
        queue = self.queue
        self.due = queue.now + max(0, self.left)
        queue.ticket += 1
        self.ticket = queue.ticket
        heapq.heappush(queue.deadlines if self.deadline else queue.alarms, (self.due, self.ticket, self))

    def drop(self) -> None:
        """Cancel the timer."""
        assert self.task.timers is not None
        self.task.timers.remove(self)
        if self.due is not None:
            self.due = None
            self.queue.forget()

    @property
    def fired(self) -> bool:
        """True once it has fired."""
        return self.left < 0

    def __str__(self) -> str:
        return f"step {self.due}" if self.due is not None else f"a stopped timer with {self.left} steps left"


class TimerQueue:
    """The timers of a run, by due step, then by start. Entries of frozen and dropped timers are removed lazily."""

    def __init__(self) -> None:
        self.now = 0
        self.ticket = 0
        self.alarms: list[tuple[int, int, Timer]] = []
        self.deadlines: list[tuple[int, int, Timer]] = []
        self._stale = 0

    def forget(self) -> None:
        """Count a stale entry; rebuild the heaps when most entries are stale, so that they do not grow."""
        self._stale += 1
        if self._stale > 1000 and self._stale * 2 > len(self.alarms) + len(self.deadlines):
            self._stale = 0
            for heap in (self.alarms, self.deadlines):
                heap[:] = [entry for entry in heap if entry[2].ticket == entry[1] and entry[2].due is not None]
                heapq.heapify(heap)

    def next_due(self) -> int | None:
        """Earliest step at which a timer fires; None without timers."""
        first: int | None = None
        for heap in (self.alarms, self.deadlines):
            while heap and (heap[0][2].due is None or heap[0][2].ticket != heap[0][1]):
                heapq.heappop(heap)
            if heap and (first is None or heap[0][0] < first):
                first = heap[0][0]
        return first

    def ring(self) -> None:
        """Fire all alarms that are due."""
        heap = self.alarms
        while heap and heap[0][0] <= self.now:
            _, ticket, timer = heapq.heappop(heap)
            if timer.due is not None and timer.ticket == ticket:
                _fire(timer)

    def expire(self) -> bool:
        """Fire the due deadlines of the most deeply nested tasks; False if none is due."""
        heap = self.deadlines
        if not heap or heap[0][0] > self.now:
            return False
        due: list[tuple[int, int, Timer]] = []
        while heap and heap[0][0] <= self.now:
            entry = heapq.heappop(heap)
            if entry[2].due is not None and entry[2].ticket == entry[1]:
                due.append(entry)
        if not due:
            return False
        deepest = max(entry[2].task.depth for entry in due)
        for entry in due:
            if entry[2].task.depth == deepest:
                _fire(entry[2])
            else:
                heapq.heappush(heap, entry)
        return True


def _fire(timer: Timer) -> None:
    timer.due = None
    timer.left = -1
    timer.fire()


WATCHDOG = 10.0
"""Time [s] that code may compute or block without reaching a checkpoint before it is interrupted."""
VIRTUAL_HOST = Usage("VirtualHost", {"rate": "240"}, {"watchdog": "10.0"})
SIMULATION_HOST = Usage("SimulationHost", {"world": "world"}, {"rate": "240", "watchdog": "10.0"})


class Steps(Protocol):
    """A world that is advanced in steps, ``rate`` per second."""

    rate: int

    def step(self) -> None:
        """Advance by one step."""


class Host(Protocol):
    """Source of plan time. An attribute ``watchdog`` limits how long code may run without a checkpoint [s]."""

    rate: int
    """Steps per second."""
    jumps: bool
    """True if the host can skip steps in which nothing is due."""

    def advance(self, steps: int) -> int | None:
        """Let this many steps pass; called only when no task can run.

        Returns the number of steps passed if the host comes back early; None means all of them.
        """


class VirtualHost:
    """Plan time without a world: jumps to the next step in which something is due."""

    jumps = True

    def __init__(self, rate: int = 240, *, watchdog: float | None = WATCHDOG) -> None:
        self.rate = checked(VIRTUAL_HOST, rate, watchdog)
        self.watchdog = watchdog

    def advance(self, steps: int) -> None:
        """Do nothing: there is no world to step."""


class SimulationHost:
    """Plan time of a simulated world, which is stepped once per step."""

    jumps = False

    def __init__(self, world: Steps, *, watchdog: float | None = WATCHDOG) -> None:
        if isinstance(world, type) or not hasattr(world, "rate") or not hasattr(world, "step"):
            raise SIMULATION_HOST.wrong("world", world, "a world with a rate and a step()")
        self.world = world
        self.rate = checked(SIMULATION_HOST, world.rate, watchdog)
        self.watchdog = watchdog
        self._step = world.step

    def advance(self, steps: int) -> None:
        """Step the world."""
        for _ in range(steps):
            self._step()


def checked(function: Usage, rate: int, watchdog: float | None) -> int:
    """Check the arguments of a host and return the rate."""
    rate = function.whole("rate", rate, 1, "steps per second")
    if watchdog is not None and not amount(watchdog):
        raise function.wrong("watchdog", watchdog, "a time > 0 [s], or None to switch it off", WrongValue)
    return rate


# -- real time


Item = Callable[[], object]
PATIENCE = 0.1
"""Longest uninterrupted wait [s]: the delay of Ctrl-C on systems where signals do not interrupt a lock."""


class Inbox:
    """FIFO queue of calls from threads, signal handlers and tests to the thread that runs the plan.

    Any thread may :meth:`put`; only the run's own thread waits and takes. It is a ``SimpleQueue`` because a signal
    handler may ``put`` while the same thread is inside ``get``.
    """

    def __init__(self) -> None:
        self._queue: SimpleQueue[Item | None] = SimpleQueue()
        self._received: deque[Item | None] = deque()  # items that wait() has removed from the queue

    def put(self, item: Item | None) -> None:
        """Queue a call for the run's thread; None only wakes it."""
        self._queue.put(item)

    @property
    def filled(self) -> bool:
        """True if the inbox is not empty."""
        return bool(self._received) or not self._queue.empty()

    def wait(self, seconds: float = PATIENCE) -> None:
        """Wait for an item, at most ``seconds`` and at most :data:`PATIENCE`."""
        try:
            self._received.append(self._queue.get(timeout=min(seconds, PATIENCE)))
        except Empty:
            return

    def take(self) -> list[Item]:
        """Remove and return the present items; those that arrive meanwhile are left for the next call."""
        received = self._received
        for _ in range(self._queue.qsize()):
            received.append(self._queue.get())
        items = [item for item in received if item is not None]
        received.clear()
        return items


@runtime_checkable
class LiveHost(Host, Protocol):
    """A host whose time passes by itself, and through which other threads act on the run."""

    inbox: Inbox
    sources: dict[Source, None]
    """Open sources; while there is one, a plan that waits is not a deadlock."""

    def begin(self) -> None:
        """Start a run: step 0 is now."""


_REAL_TIME = Usage(
    "RealTimeHost", {"rate": "240"}, {"clock": "time.monotonic", "sleep": "time.sleep", "watchdog": "10.0"}
)


class RealTimeHost:
    """Plan time at the pace of a clock, ``rate`` steps per second.

    Threads act on the plan with :meth:`post`: the function, such as ``fluent.set``, is called at once in the plan's
    thread, between two steps of its tasks. A plan that is late catches up: no step is skipped. A plan that waits for
    fluents set by threads is kept alive only while a :meth:`source` is open; otherwise it is a deadlock, as on any
    other host.

    ``clock`` returns seconds and never goes back. ``sleep`` waits at most the given seconds; without it the host waits
    for the inbox. ``watchdog`` is the longest time [s] that code may run without reaching a checkpoint; None switches
    the watchdog off.
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
        _REAL_TIME.plain("clock", clock, "a function that returns seconds and never goes back")
        if sleep is not None:
            _REAL_TIME.plain("sleep", sleep, "a function that waits at most the given seconds")
        self.watchdog = watchdog
        self.inbox = Inbox()
        self.sources: dict[Source, None] = {}
        self._clock = clock
        self._sleep = sleep
        self._start = 0.0
        self._passed = 0

    def begin(self) -> None:
        """Start a run: step 0 is now."""
        self._start = self._clock()
        self._passed = 0

    def post(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call ``function(*arguments)`` in the plan's thread, between two steps of its tasks.

        May be called from any thread. If the function raises, the run ends with that error.
        """
        self.inbox.put(functools.partial(function, *arguments))

    def source(self, name: str) -> Source:
        """Announce a thread or driver that posts; the run waits until the source is closed."""
        return Source(self, name)

    def advance(self, steps: int) -> int:
        """Let ``steps`` pass, fewer if an item arrives in the inbox; return the number of steps passed."""
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
    """A thread or driver that may still post calls. Open from its creation to :meth:`close`; a context manager."""

    def __init__(self, host: RealTimeHost, name: str) -> None:
        self.name = name
        self._host = host
        host.sources[self] = None

    def post(self, function: Callable[..., object], *arguments: Any) -> None:
        """Call a function in the plan's thread, see :meth:`RealTimeHost.post`."""
        self._host.post(function, *arguments)

    def close(self) -> None:
        """Close the source after all calls that it posted; from any thread, more than once if need be."""
        self._host.post(self._host.sources.pop, self, None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
