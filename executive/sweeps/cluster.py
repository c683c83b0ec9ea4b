"""Sweeps on clusters of dask.distributed: the client, in a thread of its own."""

from __future__ import annotations

import asyncio
import hashlib
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from queue import SimpleQueue

from executive.options.engines import DASK
from executive.sweeps.cluster_worker import Setup
from executive.sweeps.dispatch import Dispatcher, Report
from executive.sweeps.local_cluster import local_cluster
from executive.sweeps.records import Done, Task, World
from executive.sweeps.shipping import program, shipment
from planlang.outputs import make_folder, write_text


@contextmanager
def worlds_done(worlds: Sequence[World], task: Task) -> Iterator[Iterator[Done]]:
    """Run a task in all worlds, as many at a time as workers have slots. BadInput raised by the job ends the sweep."""
    resolve_name(task.job)  # a wrong name raises here, instead of failing in each world
    client = _Client(worlds, task, setup_of(worlds, task))
    try:
        yield client.results()
    finally:
        client.stop()


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


class _Client:
    """Thread with the event loop of dask, which reports to the thread of the sweep."""

    def __init__(self, worlds: Sequence[World], task: Task, setup: Setup) -> None:
        self._task, self._number = task, len(worlds)
        self._pages = {world["world"]: world["report"] for world in worlds if "report" in world}
        self._reports: SimpleQueue[Report] = SimpleQueue()
        self._dispatcher = Dispatcher(worlds, task, setup, self._reports.put)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="cluster", daemon=True)
        self._thread.start()

    def results(self) -> Iterator[Done]:
        """Yield results in the order in which worlds finish."""
        left = self._number
        while left:
            match self._reports.get():
                case Done() as done:
                    left -= 1
                    self._write(done)
                    yield replace(done, page=None)
                case str() as line:
                    self._task.say(line)
                case problem:
                    raise problem

    def _write(self, done: Done) -> None:
        """Write the page of a world that ran elsewhere. Raises BadInput."""
        if done.page is not None:
            path = Path(self._pages[done.row["world"]])
            make_folder(path.parent)
            write_text(path, done.page.decode())

    def stop(self) -> None:
        """End the processes; unfinished worlds are not reported."""
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._dispatcher.stop)
        self._thread.join()

    def _run(self) -> None:
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._dispatch())
        except BaseException as problem:
            self._reports.put(problem)

    async def _dispatch(self) -> None:
        if self._task.on != DASK:
            await self._dispatcher.run(self._task.on)
            return
        async with local_cluster(self._task.processes) as address:
            await self._dispatcher.run(address)
