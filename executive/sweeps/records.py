"""Worlds, rows and jobs: what a sweep goes through, and what it leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any

from executive.processes.calls import Limits
from planlang.records import dataclass

World = Mapping[str, Any]
"""What a job gets, as JSON: ``world``, its key (a number or text of its own), and whatever the job needs besides.

``repeat``, the command line that repeats this world, is copied into its row.
"""
Row = dict[str, Any]
"""What a job returns of a world, as JSON, behind ``world`` and ``repeat``. Read here are, if they are there:

``outcome`` ("done", "failed", ...; "crashed" if the job did not end), ``reached`` (False: "done" is not enough),
``failure`` (class of the failure, then of its causes), ``message`` and ``duration`` [s of plan time].
"""
CRASHED = "crashed"
"""The outcome of a world whose job raised an exception, crashed or did not end within its limits."""

LIMITS = Limits(seconds=120, memory=2_000_000_000, wall=600.0)
"""Limits of one world."""


@dataclass(frozen=True, slots=True)
class Done:
    """A world that has been done."""

    row: Row
    seconds: float
    """CPU time that it took [s]; 0 if its process crashed."""


@dataclass(frozen=True, slots=True)
class Task:
    """What a backend does with each world."""

    job: str
    """An importable function, ``module:function``."""
    limits: Limits
    processes: int


Backend = Callable[[Sequence[World], Task], AbstractContextManager[Iterator[Done]]]
"""Does a task in worlds, and yields them as they are done, in any order; ends what is still going on when closed."""


def is_reached(row: Row) -> bool:
    """Return True if the world ended as it should."""
    return row.get("outcome") == "done" and bool(row.get("reached", True))


def first_sentence(message: str) -> str:
    """Return the first line of a message up to the end of its first sentence."""
    line = message.strip().partition("\n")[0].strip()
    return line.partition(". ")[0].removesuffix(".")
