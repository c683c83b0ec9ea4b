"""Worlds on a worker of a cluster of dask.distributed: what the client calls there.

A worker runs each world in a process of its own, as a sweep on one machine does, by the supervisor of the sweep, which
it gets before its first world. Workers of dask are daemonic and so cannot use multiprocessing; the source of processes
does without. Its processes end with the worker.
"""

from __future__ import annotations

import json
import os
import pickle
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from uuid import uuid4

from distributed import Worker as DaskWorker

from executive.processes.workers import Limits
from executive.sweeps.records import COPIED, Done, World
from executive.sweeps.shipping import Layout, Shipment, keep, missing, program
from executive.sweeps.supervised import Slot, Supervisor
from planlang.diagnostics import BadInput, Diagnostic
from planlang.records import dataclass
from planlang.temporary import temporary_folder

UNUSED = 60.0
"""Time after which the processes of another sweep, whose client may have died, end when a new one begins [s]."""


@dataclass(frozen=True, kw_only=True)
class Setup:
    """What a worker needs for the worlds of a sweep."""

    token: str
    """Digest of everything else here."""
    job: str
    limits: Limits
    path: tuple[str, ...]
    """Folders of the client from which the job may be imported, if they are here, too."""
    program: str
    """Digest of the client's planlang."""
    shipment: Shipment | None
    """Files of the worlds; None on the client's machine, which has them."""


@dataclass(frozen=True, kw_only=True)
class Lacks:
    """Why a worker is not ready."""

    program: str = ""
    """Digest of its planlang, if it is another one."""
    contents: tuple[str, ...] = ()
    """Digests of contents that it lacks."""


class _Sweep:
    """A sweep on this worker: its supervisor, and slots that wait for their next world."""

    def __init__(self, setup: Setup, store: Path) -> None:
        self._temporary = ExitStack()
        self._folder = self._temporary.enter_context(temporary_folder(store.parent))
        self._layout = None if setup.shipment is None else Layout(setup.shipment, store, self._folder / "files")
        (jobs := self._folder / "temporary").mkdir()
        path = [*map(os.path.abspath, sys.path), *filter(os.path.isdir, setup.path)]
        environment = {} if self._layout is None else self._layout.environment
        self._supervisor = Supervisor(setup.job, setup.limits, jobs, path, environment)
        self._supervisor.start()
        self._waiting: deque[Slot] = deque()
        self._running, self._used = 0, time.monotonic()
        self._is_closed = False
        self._lock = threading.Lock()

    @property
    def is_abandoned(self) -> bool:
        """True if no world runs, and none has run for a while."""
        return self._running == 0 and time.monotonic() - self._used > UNUSED

    def done(self, world: World) -> Done:
        """Run a world and return its row. Raises BadInput if the job did."""
        with self._slot() as slot:
            return slot.done(world) if self._layout is None else self._returned(self._layout, world, slot)

    def _returned(self, layout: Layout, world: World, slot: Slot) -> Done:
        """Run a world with the paths of this worker; the row has those of the client again."""
        placed = {**layout.placed(world), **{key: world[key] for key in COPIED if key in world}}
        page = self._folder / f"{uuid4().hex}.html" if "report" in world else None
        if page is not None:
            placed["report"] = str(page)
        done = slot.done(placed)
        row = json.loads(layout.returned(json.dumps(done.row)))
        if page is None or not page.exists():
            return replace(done, row=row)
        content = page.read_bytes()
        page.unlink()
        return replace(done, row=row, page=content)

    @contextmanager
    def _slot(self) -> Iterator[Slot]:
        with self._lock:
            self._running += 1
            slot = self._waiting.pop() if self._waiting else self._supervisor.slot()
        try:
            yield slot
        finally:
            with self._lock:
                self._waiting.append(slot)
                self._running, self._used = self._running - 1, time.monotonic()
                self._let_go()

    def close(self) -> None:
        """End all processes."""
        self._supervisor.close()
        with self._lock:
            self._is_closed = True
            self._let_go()

    def _let_go(self) -> None:
        """Close the connections to processes, if these have ended."""
        while self._is_closed and self._waiting:
            self._waiting.pop().close()
        if self._is_closed and not self._running:
            self._temporary.close()


_sweeps: dict[str, _Sweep] = {}
"""Sweeps of this worker, by token."""


def accept(setup: Setup, dask_worker: DaskWorker) -> Lacks | None:
    """Prepare for the worlds of a sweep; returns why that is not possible. Dask states which worker this is."""
    for token in [token for token, sweep in _sweeps.items() if sweep.is_abandoned]:
        forget(token)
    if setup.token in _sweeps:
        return None
    if (found := program()) != setup.program:
        return Lacks(program=found)
    store = _store(dask_worker)
    if setup.shipment is not None and (lacking := missing(setup.shipment, store)):
        return Lacks(contents=tuple(lacking))
    _sweeps[setup.token] = _Sweep(setup, store)
    return None


def take(contents: Mapping[str, bytes], dask_worker: DaskWorker) -> None:
    """Store contents of files, by digest."""
    keep(contents, _store(dask_worker))


def _store(worker: DaskWorker) -> Path:
    """Return the folder for contents of files; dask removes it with those of the worker."""
    folder = Path(worker.local_directory) / "planlang"
    folder.mkdir(exist_ok=True)
    return folder


def forget(token: str) -> None:
    """End the processes of a sweep; the worlds that still run in them are lost."""
    if (sweep := _sweeps.pop(token, None)) is not None:
        sweep.close()


def done(token: str, world: bytes) -> Done | Lacks | tuple[Diagnostic, ...]:
    """Run a pickled world of a sweep; returns its row, what the job refuses, or that the sweep is unknown."""
    if (sweep := _sweeps.get(token)) is None:
        return Lacks()
    try:
        return sweep.done(pickle.loads(world))
    except BadInput as problem:
        return tuple(problem.diagnostics)
