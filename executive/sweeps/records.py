"""Data of a sweep: worlds, rows of results, and the task of a backend."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any, Protocol

from executive.processes.workers import Limits
from planlang.diagnostics import BadInput
from planlang.records import dataclass
from planlang.words import Text

World = Mapping[str, Any]
"""Input of a job (JSON): ``world``, a unique key (number or text), and whatever else the job needs.

``repeat``, the command line that repeats this world, and the entries of ``columns`` are copied into its row. Worlds
with other ``programs`` (a text: code of users) share no process, as one might change what the other runs. ``python`` is
the interpreter of another installation of planlang that runs the world, on this machine. ``report`` is
the path of a page that the job may write.
"""
Row = dict[str, Any]
"""Result of a job in a world (JSON), after ``world`` and ``repeat``. Sweeps use these optional keys:

``outcome`` ("done", "failed", ...; "crashed" if the job did not end), ``reached`` (whether the goals hold in the world,
if there are any) with ``claimed`` beside it (whether the plan ended as "done"), ``failure`` (class of the failure, then
of its causes), ``message``, and ``duration`` [s of plan time].
"""
LONGEST_MESSAGE = 2000
"""Maximum length of a message in a row [characters]."""
DONE, CRASHED, REFUSED = "done", "crashed", "refused"
"""Outcomes of a world whose plan ended without a failure, of one whose job did not end (exception, crash, limits), and
of one that cannot begin with changes."""

LIMITS = Limits(seconds=120, memory=2_000_000_000, wall=600.0)
"""Limits of one world."""


@dataclass(frozen=True, slots=True)
class Done:
    """Result of a finished world."""

    row: Row
    seconds: float
    """CPU time [s]; 0 if the process crashed."""
    worker: str = ""
    """Worker of a cluster that ran it."""
    page: bytes | None = None
    """What the job wrote to ``report``, if it ran where that is no file of this machine."""


CLUSTER_WAIT = 300.0
"""Time without a worker after which a sweep on a cluster gives up [s]."""


@dataclass(frozen=True, kw_only=True)
class Task:
    """The job that a backend runs in each world."""

    job: str
    """Importable function, ``module:function``."""
    limits: Limits = LIMITS
    processes: int | None = None
    """Worlds at a time on this machine; None: as many as cores."""
    on: str = "local"
    """``local``, ``dask``, or the address of a scheduler of dask.distributed."""
    cluster_wait: float = CLUSTER_WAIT
    """Time without a worker after which a sweep on a cluster gives up [s]."""
    reads: str | None = None
    """Importable function that reads the files of a world as the job does; workers elsewhere get these files."""
    resume: Text | None = None
    """How to run the worlds that are left, as advice to who called."""
    say: Callable[[str], object] = lambda line: None
    """Gets sentences on what happens to a cluster."""

    @property
    def slots(self) -> int:
        """Number of worlds at a time on this machine."""
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        return self.processes or cores


class Workers(Protocol):
    """Workers of a task, which keep what they have read from one batch of worlds to the next."""

    def done(self, worlds: Sequence[World]) -> AbstractContextManager[Iterator[Done]]:
        """Run the task in worlds and yield the results in any order; stops unfinished worlds when it is closed.

        BadInput raised by the job ends the batch.
        """


Backend = Callable[[Task], AbstractContextManager[Workers]]
"""Starts workers, and ends them when it is closed."""


def columns_of(world: World) -> Row:
    """What is known of a row before its world runs."""
    return {key: world[key] for key in ("world", "repeat") if key in world} | dict(world.get("columns", {}))


def of_variant(name: str, problem: BadInput) -> BadInput:
    """The problem with the name of the variant that has it."""
    return BadInput([replace(one, message=Text(f"{name}: ", one.message)) for one in problem.diagnostics])


COPIED = ("world", "repeat", "columns")
"""Entries of a world that its row has."""


def is_reached(row: Row) -> bool:
    """Check whether the plan ended as done in this world, and its goals hold there."""
    return row.get("outcome") == DONE and bool(row.get("reached", True))


def first_sentence(message: str) -> str:
    """Cut a message after the first sentence of its first line."""
    line = message.strip().partition("\n")[0].strip()
    return line.partition(". ")[0].removesuffix(".")
