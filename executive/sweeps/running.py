"""Run a sweep: one job in many worlds, on some backend, with a file from which it can be resumed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from importlib import import_module
from pathlib import Path
from typing import Any

from executive.options.engines import LOCAL, engine
from executive.processes.workers import Limits
from executive.sweeps import local
from executive.sweeps.files import SweepFile, header_of
from executive.sweeps.records import CLUSTER_WAIT, LIMITS, Backend, Done, Row, Task, Workers, World
from planlang.diagnostics import BadInput, WrongOption
from planlang.extras import no_cluster
from planlang.words import Option, Text


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
    together: int = 1,
    cluster_wait: float = CLUSTER_WAIT,
    reads: str | None = None,
    resume: Text | None = None,
    say: Callable[[str], object] = lambda line: None,
    told: Callable[[Done], object] = lambda done: None,
    resumed: Callable[[Sequence[Row]], object] = lambda rows: None,
) -> list[Row]:
    """Run a job in many worlds; returns one row per world, in the order of the worlds.

    ``job`` (``module:function``) maps a world to its row, in a process that is reused for further worlds. If the
    process crashes, the world is tried once more; a world that crashes two processes or exceeds its ``limits`` gets a
    row with the outcome "crashed".

    With ``out``, each row is appended to this file as a line of JSON. If the file exists, only the missing worlds are
    run; at the end the file is sorted. ``about`` is written to its header: everything besides the worlds that the rows
    depend on. ``shard`` (k, n) runs only every n-th world, starting with the k-th; each ``together`` worlds in a row
    count as one, so that a shard has all variants of its seeds. ``processes`` defaults to the number
    of cores. ``resumed`` is called once with the rows already in the file, ``told`` with each new result.

    ``on`` is ``local``, ``dask`` for a cluster of dask.distributed with one worker on this machine, or the address of
    the scheduler of another cluster (``tcp://host:8786``, ``tls://...``), whose workers have as many slots as threads.
    Their files they get by content: those that ``reads`` (``module:function``) opens, called with a world that names
    files. ``say`` gets sentences on workers that are lost or refused. After ``cluster_wait`` [s] without a worker the
    sweep gives up, with the advice ``resume``.

    Raises BadInput as the job does (a job that can skip a world returns a row instead), if ``out`` belongs to another
    sweep, if ``on`` is unknown or its package is missing, if the cluster is lost or has another planlang; ValueError if
    two worlds have the same key.
    """
    if len({world["world"] for world in worlds}) < len(worlds):
        raise ValueError("two worlds have the same key")
    part, parts = shard
    own = [world for index, world in enumerate(worlds) if index // together % parts == part - 1]
    if engine(on) != LOCAL and any("python" in world for world in worlds):
        raise WrongOption(Option("python"), " needs ", Option("on", LOCAL), ": workers of a cluster have one planlang")
    backend_of(on)  # a wrong one raises before the file is begun
    with ExitStack() as stack:
        rows: dict[Any, Row] = {}
        file = None
        if out is not None:
            file = stack.enter_context(SweepFile.opened(out, header_of(job, about or {}, worlds, shard)))
            rows.update((row["world"], row) for row in file.rows)
        resumed(list(rows.values()))
        missing = [world for world in own if world["world"] not in rows]
        if missing:
            task = Task(
                job=job,
                limits=limits,
                processes=processes,
                on=on,
                cluster_wait=cluster_wait,
                reads=reads,
                resume=resume,
                say=say,
            )
            used = stack.enter_context(workers(task))
            for done in stack.enter_context(used.done(missing)):
                rows[done.row["world"]] = done.row
                if file is not None:
                    file.append(done.row)
                told(done)
        ordered = [rows[world["world"]] for world in own]
        if file is not None:
            file.finish(ordered)
    return ordered


def workers(task: Task) -> AbstractContextManager[Workers]:
    """Start workers for a task, which end when this is closed. Raises BadInput as :func:`run` does."""
    return backend_of(task.on)(task)


def backend_of(on: str) -> Backend:
    """Return the backend of an engine. Raises BadInput if it is unknown, or if its package is missing."""
    if engine(on) == LOCAL:
        return local.workers
    if problems := no_cluster():
        raise BadInput(problems)
    module = import_module("executive.sweeps.cluster")  # of distributed, an extra that takes half a second to import
    backend: Backend = module.workers
    return backend
