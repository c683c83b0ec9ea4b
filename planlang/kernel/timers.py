"""Timers: integer due steps, frozen while their task is held. Deadlines are timers that fire when a step is at rest."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from typing import Protocol


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
        """Never fire."""
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
