"""Plan time: hosts say what a step of it is, timers wake tasks at steps.

In real time a host follows a clock, and an inbox takes what threads hand over. Timers are due at integer steps, frozen
while their task is held. Deadlines are timers that fire when a step is at rest.
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
    """Fires once ``left`` steps from now, unless dropped; stands still while its task is held.

    The task makes it itself: it runs then, and is not held. It drops it itself too, once.
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
        """Stand still."""
        if self.due is not None:
            self.left = self.due - self.queue.now
            self.due = None
            self.queue.forget()

    def thaw(self) -> None:
        """Go on."""
        queue = self.queue
        self.due = queue.now + max(0, self.left)
        queue.ticket += 1
        self.ticket = queue.ticket
        heapq.heappush(queue.deadlines if self.deadline else queue.alarms, (self.due, self.ticket, self))

    def drop(self) -> None:
        """Stop for good: it never fires."""
        assert self.task.timers is not None
        self.task.timers.remove(self)
        if self.due is not None:
            self.due = None
            self.queue.forget()

    @property
    def passed(self) -> bool:
        """True once it has fired."""
        return self.left < 0

    def __str__(self) -> str:
        return f"step {self.due}" if self.due is not None else f"a timer that stands still, {self.left} steps left"


class TimerQueue:
    """All live timers, by due step, then in order of starting. Frozen and dropped ones are skipped lazily."""

    def __init__(self) -> None:
        self.now = 0
        self.ticket = 0
        self.alarms: list[tuple[int, int, Timer]] = []
        self.deadlines: list[tuple[int, int, Timer]] = []
        self._stale = 0

    def forget(self) -> None:
        """Note a stale entry; rebuild the heaps when most are, so that they stay as large as what is live."""
        self._stale += 1
        if self._stale > 1000 and self._stale * 2 > len(self.alarms) + len(self.deadlines):
            self._stale = 0
            for heap in (self.alarms, self.deadlines):
                heap[:] = [entry for entry in heap if entry[2].ticket == entry[1] and entry[2].due is not None]
                heapq.heapify(heap)

    def next_due(self) -> int | None:
        """Return the earliest step at which something fires."""
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
"""Seconds that code may compute, or be blocked, without reaching a checkpoint before it is interrupted."""
VIRTUAL_HOST = Usage("VirtualHost", {"rate": "240"}, {"watchdog": "10.0"})
SIMULATION_HOST = Usage("SimulationHost", {"world": "world"}, {"rate": "240", "watchdog": "10.0"})


class Steps(Protocol):
    """The part of a world that a host needs: its time."""

    rate: int

    def step(self) -> None:
        """Advance by one step."""


class Host(Protocol):
    """Gives plan time its rate and its steps."""

    rate: int
    """Steps per second."""
    jumps: bool
    """True if steps in which nothing is due may be taken at once."""

    def advance(self, steps: int) -> int | None:
        """Let this many steps pass; called only when no task can run.

        A host that came back early returns the number of steps that have passed; None means all of them. Its attribute
        ``watchdog``, if there is one, is the longest time [s] that code may run without reaching a checkpoint.
        """


class VirtualHost:
    """Time without a world: it jumps to the next step in which something is due."""

    jumps = True

    def __init__(self, rate: int = 240, *, watchdog: float | None = WATCHDOG) -> None:
        self.rate = checked(VIRTUAL_HOST, rate, watchdog)
        self.watchdog = watchdog

    def advance(self, steps: int) -> None:
        """Do nothing: no world has to be stepped."""


class SimulationHost:
    """Steps a world, once per step of plan time."""

    jumps = False

    def __init__(self, world: Steps, *, watchdog: float | None = WATCHDOG) -> None:
        if isinstance(world, type) or not hasattr(world, "rate") or not hasattr(world, "step"):
            raise SIMULATION_HOST.wrong("world", world, "a world, which has a rate and a step()")
        self.world = world
        self.rate = checked(SIMULATION_HOST, world.rate, watchdog)
        self.watchdog = watchdog
        self._step = world.step

    def advance(self, steps: int) -> None:
        """Step the world."""
        for _ in range(steps):
            self._step()


def checked(function: Usage, rate: int, watchdog: float | None) -> int:
    """Return the rate, if it and the watchdog's time are what they should be."""
    rate = function.whole("rate", rate, 1, "steps per second")
    if watchdog is not None and not amount(watchdog):
        meant = "None, or a time > 0 [s] for code that does not wait"
        raise function.wrong("watchdog", watchdog, meant, WrongValue)
    return rate


# -- real time


Item = Callable[[], object]
PATIENCE = 0.1
"""Longest uninterrupted wait [s]; where locks cannot be interrupted by signals, Ctrl-C is noticed this often."""


class Inbox:
    """Queue from threads, signal handlers and tests to the thread that runs the plan, first in, first out.

    Any thread may :meth:`put`, only the run's own thread waits and takes.

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
        """Begin a run: step 0 is now."""


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
        """Begin a run: step 0 is now."""
        self._start = self._clock()
        self._passed = 0

    def post(self, function: Callable[..., object], *arguments: Any) -> None:
        """Let ``function(*arguments)`` be called in the plan's thread, between two steps of its tasks.

        May be called from any thread. What the function raises ends the run.
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
        """Hand a call over, as :meth:`RealTimeHost.post` does."""
        self._host.post(function, *arguments)

    def close(self) -> None:
        """State that nothing will come any more. From any thread, after what it posted; closing twice is allowed."""
        self._host.post(self._host.sources.pop, self, None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
