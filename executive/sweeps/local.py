"""Sweeps on this machine: each thread supervises one worker process."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pkgutil import resolve_name
from queue import SimpleQueue

from executive.sweeps.records import Done, Task, Workers, World
from executive.sweeps.supervised import Slot, Supervisor
from planlang.temporary import temporary_folder


@contextmanager
def workers(task: Task) -> Iterator[Workers]:
    """Start worker processes on demand, ``task.slots`` at most."""
    resolve_name(task.job)  # a wrong name raises here, instead of failing in each world
    with temporary_folder() as folder:
        path = [os.path.abspath(one) for one in sys.path]
        own = _Workers(task.slots, Supervisor(task.job, task.limits, folder, path))
        try:
            yield own
        finally:
            own.close()


class _Workers:
    """Slots for worlds, whose processes are kept from one batch to the next."""

    def __init__(self, number: int, supervisor: Supervisor) -> None:
        self._number, self._supervisor = number, supervisor
        self._idle: list[Slot] = []

    @contextmanager
    def done(self, worlds: Sequence[World]) -> Iterator[Iterator[Done]]:
        """Run the task in worlds, and yield results in the order in which they finish."""
        number = min(self._number, len(worlds))
        slots = [self._idle.pop() if self._idle else self._supervisor.slot() for _ in range(number)]
        batch = _Batch(worlds, slots)
        try:
            yield batch.results()
        finally:
            self._idle += batch.stop()

    def close(self) -> None:
        """End the processes."""
        self._supervisor.close()
        for one in self._idle:
            one.close()


class _Batch:
    """Threads that take worlds from a queue and run each in a slot of their own."""

    def __init__(self, worlds: Sequence[World], slots: Sequence[Slot]) -> None:
        self._waiting, self._number = iter(worlds), len(worlds)
        self._changed = threading.Condition()
        self._results: SimpleQueue[tuple[Slot, Done | BaseException]] = SimpleQueue()
        self._is_stopped = False
        self._running: set[Slot] = set()
        self._unseen: set[Slot] = set()
        """Slots whose last result may end the batch: they take no further world until it was looked at."""
        self._slots = list(slots)
        self._threads = [threading.Thread(target=self._supervise, args=(one,), daemon=True) for one in slots]
        for one in self._threads:
            one.start()

    def results(self) -> Iterator[Done]:
        """Yield results in the order in which worlds finish."""
        for _ in range(self._number):
            slot, result = self._results.get()
            if isinstance(result, BaseException):
                raise result
            yield result
            with self._changed:
                self._unseen.discard(slot)
                self._changed.notify_all()

    def stop(self) -> list[Slot]:
        """End the processes of unfinished worlds, which are not reported; return the slots that can be used again."""
        with self._changed:
            self._is_stopped, stopped = True, set(self._running)
            for slot in stopped:
                slot.stop()
            self._changed.notify_all()
        for one in self._threads:
            one.join()
        return [slot for slot in self._slots if slot not in stopped]

    def _supervise(self, slot: Slot) -> None:
        while (world := self._next(slot)) is not None:
            result: Done | BaseException
            try:
                result = slot.done(world)
            except BaseException as problem:
                result = problem
            with self._changed:
                self._running.discard(slot)
                self._unseen.add(slot)
            self._results.put((slot, result))

    def _next(self, slot: Slot) -> World | None:
        """Take a world, once the last result of a slot was looked at; None if there is none."""
        with self._changed:
            self._changed.wait_for(lambda: self._is_stopped or slot not in self._unseen)
            world = None if self._is_stopped else next(self._waiting, None)
            if world is not None:
                self._running.add(slot)
            return world
