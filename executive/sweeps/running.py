"""A sweep: one job in many worlds, on this machine or elsewhere, with a file that it resumes from."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from executive.processes.calls import Limits
from executive.sweeps import local
from executive.sweeps.files import SweepFile, header_of
from executive.sweeps.records import LIMITS, Backend, Done, Row, Task, World

BACKENDS: Mapping[str, Backend] = {"local": local.worlds_done}
"""Where a sweep can run, by name: a backend yields what is done, this module keeps it."""


def run(
    worlds: Sequence[World],
    job: str,
    on: str = "local",
    *,
    processes: int | None = None,
    limits: Limits = LIMITS,
    out: Path | None = None,
    about: Mapping[str, Any] | None = None,
    shard: tuple[int, int] = (1, 1),
    told: Callable[[Done], object] = lambda done: None,
    resumed: Callable[[Sequence[Row]], object] = lambda rows: None,
) -> list[Row]:
    """Do a job in many worlds; return a row for each, in their order.

    ``job`` (``module:function``) maps a world to its row in a process that stays warm for the next world. A process
    that is killed or crashes is replaced, and its world tried once more; a world that ends two processes, or exceeds
    its ``limits``, becomes a row that says so.

    With ``out`` each row is appended to this file as a line of JSON. If the file is there, only what it lacks is done;
    in the end it is sorted. ``about`` stands in its first line: all that the rows depend on besides the worlds.
    ``shard`` (k, n) does every n-th world only, from the k-th on. By default there is a process for each core.
    ``told`` gets each world as it is done, ``resumed`` first the rows that the file has.

    Raises BadInput as the job does (one that can go on without this world returns a row instead), or if ``out`` is of
    another sweep; KeyError if ``on`` is no backend; ValueError if two worlds have one key.
    """
    if len({world["world"] for world in worlds}) < len(worlds):
        raise ValueError("two worlds have the same key")
    part, parts = shard
    own = [world for index, world in enumerate(worlds) if index % parts == part - 1]
    backend, task = BACKENDS[on], Task(job, limits, processes or available_cores())
    with ExitStack() as stack:
        rows: dict[Any, Row] = {}
        file = None
        if out is not None:
            file = stack.enter_context(SweepFile.opened(out, header_of(job, about or {}, worlds, shard)))
            rows.update((row["world"], row) for row in file.rows)
        resumed(list(rows.values()))
        missing = [world for world in own if world["world"] not in rows]
        if missing:
            for done in stack.enter_context(backend(missing, task)):
                rows[done.row["world"]] = done.row
                if file is not None:
                    file.append(done.row)
                told(done)
        found = [rows[world["world"]] for world in own]
        if file is not None:
            file.finish(found)
    return found


def available_cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
