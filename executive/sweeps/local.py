"""Sweeps on this machine: each thread supervises one worker process."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pkgutil import resolve_name
from queue import SimpleQueue
from typing import Any

from executive.processes.workers import Ending, Limits, Performs, Reply, Source, Worker
from executive.sweeps.records import CRASHED, Done, Task, World, columns_of
from planlang.diagnostics import BadInput
from planlang.temporary import temporary_folder


@contextmanager
def worlds_done(worlds: Sequence[World], task: Task) -> Iterator[Iterator[Done]]:
    """Run a task in all worlds, ``task.processes`` at a time. BadInput raised by the job ends the sweep."""
    resolve_name(task.job)  # a wrong name raises here, instead of failing in each world
    with temporary_folder() as folder:
        path = [os.path.abspath(one) for one in sys.path]
        source = Source("executive.sweeps.local:prepared", task.job, str(folder), *path)
        supervision = _Supervision(worlds, task, source)
        try:
            yield supervision.results()
        finally:
            supervision.stop()


class _Supervision:
    """Threads that take worlds from a queue and run each in a worker process."""

    def __init__(self, worlds: Sequence[World], task: Task, source: Source) -> None:
        self._waiting, self._task, self._source = iter(worlds), task, source
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
        self._source.close()
        for one in self._threads:
            one.join()

    def _supervise(self) -> None:
        workers: dict[str, Worker] = {}
        try:
            while (world := self._next()) is not None:
                programs = world.get("programs", "")
                if programs not in workers:
                    workers[programs] = Worker(self._source, self._task.limits)
                reply = workers[programs].call(do, self._task.job, dict(world))
                if self._is_stopped:
                    return
                self._results.put(_done(world, reply, self._task.limits))
        except BaseException as problem:
            self._results.put(problem)
        finally:
            for worker in workers.values():
                worker.close()

    def _next(self) -> World | None:
        with self._lock:
            return None if self._is_stopped else next(self._waiting, None)


def _done(world: World, reply: Reply, limits: Limits) -> Done:
    """Build the row of a world from a worker's reply. Raises BadInput if the job did."""
    known = columns_of(world)
    match reply.ending:
        case Ending.DONE:
            return Done({**known, **json.loads(reply.answer)}, reply.seconds)
        case Ending.REFUSED:
            raise BadInput(reply.answer)
        case Ending.FAILED:
            kind, message = str(reply.answer).partition(": ")[0], str(reply.answer)
        case Ending.MEMORY:
            kind, message = "OutOfMemory", reply.beyond(limits)
        case Ending.LATE:
            kind, message = "OutOfTime", reply.beyond(limits)
        case Ending.LOST:
            kind, message = "ProcessEnded", reply.beyond(limits)
    return Done({**known, "outcome": CRASHED, "failure": [kind], "message": message}, reply.seconds)


# in the worker processes


def prepared(job: str, folder: str, *path: str) -> Performs:
    """Import the job before processes are forked. Temporary files go to ``folder``, which the supervisor removes."""
    sys.path += [one for one in path if one not in sys.path]
    tempfile.tempdir = folder
    resolve_name(job)
    return lambda function, arguments: function(*arguments)


def do(job: str, world: dict[str, Any]) -> str:
    """Run the job in a world and encode its row as JSON."""
    return json.dumps(resolve_name(job)(world))
