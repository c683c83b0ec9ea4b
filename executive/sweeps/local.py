"""Sweeps on this machine: each thread supervises one worker process."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pkgutil import resolve_name
from queue import SimpleQueue

from executive.sweeps.records import Done, Task, World
from executive.sweeps.supervised import Supervisor
from planlang.temporary import temporary_folder


@contextmanager
def worlds_done(worlds: Sequence[World], task: Task) -> Iterator[Iterator[Done]]:
    """Run a task in all worlds, ``task.processes`` at a time. BadInput raised by the job ends the sweep."""
    resolve_name(task.job)  # a wrong name raises here, instead of failing in each world
    with temporary_folder() as folder:
        path = [os.path.abspath(one) for one in sys.path]
        supervision = _Supervision(worlds, task, Supervisor(task.job, task.limits, folder, path))
        try:
            yield supervision.results()
        finally:
            supervision.stop()


class _Supervision:
    """Threads that take worlds from a queue and run each in a worker process."""

    def __init__(self, worlds: Sequence[World], task: Task, supervisor: Supervisor) -> None:
        self._waiting, self._supervisor = iter(worlds), supervisor
        self._number = len(worlds)
        self._lock = threading.Lock()
        self._results: SimpleQueue[Done | BaseException] = SimpleQueue()
        self._is_stopped = False
        self._threads = [
            threading.Thread(target=self._supervise, daemon=True) for _ in range(min(task.processes, len(worlds)))
        ]
        for one in self._threads:
            one.start()

    def results(self) -> Iterator[Done]:
        """Yield results in the order in which worlds finish."""
        for _ in range(self._number):
            result = self._results.get()
            if isinstance(result, BaseException):
                raise result
            yield result

    def stop(self) -> None:
        """End the processes; unfinished worlds are not reported."""
        self._is_stopped = True
        self._supervisor.close()
        for one in self._threads:
            one.join()

    def _supervise(self) -> None:
        slot = self._supervisor.slot()
        try:
            while (world := self._next()) is not None:
                done = slot.done(world)
                if self._is_stopped:
                    return
                self._results.put(done)
        except BaseException as problem:
            self._results.put(problem)
        finally:
            slot.close()

    def _next(self) -> World | None:
        with self._lock:
            return None if self._is_stopped else next(self._waiting, None)
