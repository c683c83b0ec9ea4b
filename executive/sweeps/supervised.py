"""Supervision of worlds: each runs in a worker process, and whatever happens to that becomes the row of the world.

Every backend runs worlds like this, on this machine and on others.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from executive.processes.workers import Ending, Limits, Performs, Reply, Source, Worker
from executive.sweeps.records import CRASHED, Done, World, columns_of, of_variant
from planlang.diagnostics import BadInput


class Supervisor:
    """Runs a job in worlds, each in a worker process of one source. Thread-safe."""

    def __init__(
        self, job: str, limits: Limits, folder: Path, path: Sequence[str], environment: Mapping[str, str] | None = None
    ) -> None:
        """``folder`` is for temporary files of the job; ``path`` is where it may be imported from.

        ``environment`` are variables that the processes have besides those of this one; ``PWD`` is their current
        folder.
        """
        self._job, self._limits, self._folder = job, limits, folder
        self._source = source_of(job, folder, path, environment)
        self._lock = threading.Lock()
        self._others: dict[str, Source] = {}
        """Interpreters of other installations -> their sources."""

    def start(self) -> None:
        """Start the source, so that it is prepared when the first world comes."""
        self._source.start()

    def slot(self) -> Slot:
        """Return a place for one world at a time; close it in the end."""
        return Slot(self._source_for, self._job, self._limits)

    def _source_for(self, world: World) -> Source:
        python = world.get("python")
        if python is None:
            return self._source
        with self._lock:
            if python not in self._others:
                self._others[python] = source_of(self._job, self._folder, (), python=python)
            return self._others[python]

    def close(self) -> None:
        """End all processes; the worlds that run in them are lost."""
        with self._lock:
            for source in (self._source, *self._others.values()):
                source.close()


def source_of(
    job: str,
    folder: Path,
    path: Sequence[str],
    environment: Mapping[str, str] | None = None,
    python: str | None = None,
) -> Source:
    """Return a source of processes for a job; arguments are those of :class:`Supervisor` and :class:`Source`."""
    given = json.dumps({"path": list(path), "environment": dict(environment or {})})
    return Source("executive.sweeps.supervised:prepared", job, str(folder), given, python=python)


class Slot:
    """Runs one world at a time. Worlds of other installations or programs of users have processes of their own."""

    def __init__(self, source_for: Callable[[World], Source], job: str, limits: Limits) -> None:
        self._source_for, self._job, self._limits = source_for, job, limits
        self._workers: dict[tuple[str, str], Worker] = {}
        self._lock = threading.Lock()
        self._current: Worker | None = None
        self._is_stopped = False

    def done(self, world: World) -> Done:
        """Run the job in a world and return its row. Raises BadInput if the job did."""
        key = world.get("python", ""), world.get("programs", "")
        if key not in self._workers:
            self._workers[key] = Worker(self._source_for(world), self._limits)
        with self._lock:
            self._current = self._workers[key]
            if self._is_stopped:
                self._current.stop()
        return _done(world, self._current.call(do, self._job, dict(world)), self._limits)

    def stop(self) -> None:
        """End the process of the world that runs, whose row means nothing then, and run no further one. Thread-safe."""
        with self._lock:
            self._is_stopped = True
            if self._current is not None:
                self._current.stop()

    def close(self) -> None:
        """End the processes after their current world."""
        for worker in self._workers.values():
            worker.close()


def _done(world: World, reply: Reply, limits: Limits) -> Done:
    """Build the row of a world from a worker's reply. Raises BadInput if the job did."""
    match reply.ending:
        case Ending.DONE:
            return Done({**columns_of(world), **json.loads(reply.answer)}, reply.seconds)
        case Ending.REFUSED:
            problem, variant = BadInput(reply.answer), world.get("columns", {}).get("variant")
            raise problem if variant is None else of_variant(variant, problem)
        case Ending.FAILED:
            kind, message = str(reply.answer).partition(": ")[0], str(reply.answer)
        case Ending.MEMORY:
            kind, message = "OutOfMemory", reply.beyond(limits)
        case Ending.LATE:
            kind, message = "OutOfTime", reply.beyond(limits)
        case Ending.LOST:
            kind, message = LOST, reply.beyond(limits)
    return crashed(world, kind, message, reply.seconds)


LOST = "ProcessEnded"
"""Failure of a world in which processes died."""


def crashed(world: World, kind: str, message: str, seconds: float = 0.0) -> Done:
    """Build the row of a world whose job did not end."""
    return Done({**columns_of(world), "outcome": CRASHED, "failure": [kind], "message": message}, seconds)


# in the worker processes


def prepared(job: str, folder: str, given: str) -> Performs:
    """Import the job before processes are forked. Temporary files go to ``folder``, which the supervisor removes."""
    surroundings = json.loads(given)
    sys.path += [one for one in surroundings["path"] if one not in sys.path]
    os.environ.update(surroundings["environment"])
    if "PWD" in surroundings["environment"]:
        os.chdir(os.environ["PWD"])
    tempfile.tempdir = folder
    resolve_name(job)
    return lambda function, arguments: function(*arguments)


def do(job: str, world: dict[str, Any]) -> str:
    """Run the job in a world and encode its row as JSON."""
    return json.dumps(resolve_name(job)(world))
