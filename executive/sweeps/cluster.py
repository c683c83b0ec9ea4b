"""Sweeps on clusters of dask.distributed: the client, in a thread of its own."""

from __future__ import annotations

import asyncio
import hashlib
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from queue import SimpleQueue

from executive.options.engines import DASK
from executive.sweeps.cluster_worker import Setup
from executive.sweeps.dispatch import Dispatcher, Report, forget
from executive.sweeps.local_cluster import local_cluster
from executive.sweeps.records import Done, Task, Workers, World
from executive.sweeps.shipping import program, shipment
from planlang.outputs import make_folder, write_text


@contextmanager
def workers(task: Task) -> Iterator[Workers]:
    """Use the workers of a cluster, which is started here if the task says so; as many worlds at a time as slots."""
    resolve_name(task.job)  # a wrong name raises here, instead of failing in each world
    client = _Client(task)
    try:
        yield client
    finally:
        client.close()


def setup_of(worlds: Sequence[World], task: Task) -> Setup:
    """Describe what workers need. Raises BadInput if the files of the worlds cannot be read."""
    path = tuple(one for one in map(os.path.abspath, sys.path) if not _is_installed(one))
    is_here = task.on == DASK
    shipped = None if is_here else shipment(worlds, task.reads, task.limits, tuple(map(os.path.abspath, sys.path)))
    setup = Setup(token="", job=task.job, limits=task.limits, path=path, program=program(), shipment=shipped)
    return replace(setup, token=hashlib.sha256(repr(setup).encode()).hexdigest())


def _is_installed(folder: str) -> bool:
    """Check whether a folder of modules belongs to Python or to packages, of which each worker has its own."""
    prefixes = tuple(map(os.path.realpath, {sys.prefix, sys.base_prefix}))
    return os.path.realpath(folder).startswith(prefixes) or os.path.basename(folder).endswith("-packages")


class _Batch:
    """Worlds, and what is reported of them to the thread of the sweep."""

    def __init__(self, worlds: Sequence[World], task: Task, setup: Setup) -> None:
        self._say, self._number = task.say, len(worlds)
        self._pages = {world["world"]: world["report"] for world in worlds if "report" in world}
        self.reports: SimpleQueue[Report] = SimpleQueue()
        self.dispatcher = Dispatcher(worlds, task, setup, self.reports.put)
        self.has_ended = threading.Event()

    def results(self) -> Iterator[Done]:
        """Yield results in the order in which worlds finish."""
        left = self._number
        while left:
            match self.reports.get():
                case Done() as done:
                    left -= 1
                    self._write(done)
                    yield replace(done, page=None)
                case str() as line:
                    self._say(line)
                case problem:
                    raise problem

    def _write(self, done: Done) -> None:
        """Write the page of a world that ran elsewhere. Raises BadInput."""
        if done.page is not None:
            path = Path(self._pages[done.row["world"]])
            make_folder(path.parent)
            write_text(path, done.page.decode())


class _Client:
    """Thread with the event loop of dask, which runs batches one after another."""

    def __init__(self, task: Task) -> None:
        self._task, self._tokens = task, dict[str, None]()
        self._loop = asyncio.new_event_loop()
        self._batches: asyncio.Queue[_Batch | None] = asyncio.Queue()
        self._began: Future[None] = Future()
        self._thread = threading.Thread(target=self._run, name="cluster", daemon=True)
        self._thread.start()
        self._began.result()

    @contextmanager
    def done(self, worlds: Sequence[World]) -> Iterator[Iterator[Done]]:
        """Run the task in worlds, and yield results in the order in which they finish."""
        setup = setup_of(worlds, self._task)
        self._tokens[setup.token] = None
        batch = _Batch(worlds, self._task, setup)
        self._put(batch)
        try:
            yield batch.results()
        finally:
            self._loop.call_soon_threadsafe(batch.dispatcher.stop)
            batch.has_ended.wait()

    def close(self) -> None:
        """End the processes."""
        self._put(None)
        self._thread.join()

    def _put(self, batch: _Batch | None) -> None:
        self._loop.call_soon_threadsafe(self._batches.put_nowait, batch)

    def _run(self) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._session())
        except BaseException as problem:
            if self._began.done():
                raise
            self._began.set_exception(problem)

    async def _session(self) -> None:
        if self._task.on == DASK:
            async with local_cluster(self._task.slots) as address:
                await self._serve(address)
            return
        await self._serve(self._task.on)
        await forget(self._task.on, self._tokens)

    async def _serve(self, address: str) -> None:
        self._began.set_result(None)
        while (batch := await self._batches.get()) is not None:
            try:
                await batch.dispatcher.run(address)
            except BaseException as problem:
                batch.reports.put(problem)
            finally:
                batch.has_ended.set()
