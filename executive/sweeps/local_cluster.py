"""A cluster of dask.distributed on this machine: a scheduler in this process, and one worker with a thread per slot."""

from __future__ import annotations

import asyncio
import logging
import os
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager, contextmanager
from typing import Any

import dask
from distributed import LocalCluster, Worker

from planlang.temporary import temporary_folder

SETTINGS = {
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.system-monitor.disk": False,
    "distributed.admin.system-monitor.gil.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.scheduler.work-stealing": False,
    "distributed.worker.profile.enabled": False,
}
"""Nothing is measured that nobody looks at: it would cost a twentieth of a core, and more with each thread."""
RESTARTED_AFTER = 1.0
"""Pause before a worker is replaced [s]."""
_START = "import sys; from executive.sweeps.local_cluster import work; work(*sys.argv[1:])"


@asynccontextmanager
async def local_cluster(threads: int) -> AsyncIterator[str]:
    """Start a cluster, and yield the address of its scheduler; a worker that ends is replaced."""
    with quiet(), dask.config.set(SETTINGS), temporary_folder() as folder:
        nowhere = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
        cluster = LocalCluster(n_workers=0, protocol="tcp://", scheduler_kwargs=nowhere, asynchronous=True)
        async with cluster:
            address = str(cluster.scheduler_address)
            command = [sys.executable, "-P", "-c", _START, address, str(threads), str(folder)]
            keeping = asyncio.create_task(_kept(_worker(command), command))
            try:
                yield address
            finally:
                keeping.cancel()
                await asyncio.wait([keeping])


def _worker(command: Sequence[str]) -> subprocess.Popen[bytes]:
    """Start a worker process.

    That of dask would import the main program of the user again, whose sweep would begin anew.
    """
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True)


async def _kept(process: subprocess.Popen[bytes], command: Sequence[str]) -> None:
    """Replace a worker each time it ends; end it when this is cancelled."""
    try:
        while True:
            await asyncio.to_thread(process.wait)
            _end(process)
            await asyncio.sleep(RESTARTED_AFTER)
            process = _worker(command)
    finally:
        _end(process)


def _end(process: subprocess.Popen[bytes]) -> None:
    with process:  # which closes the pipe, too
        process.kill()


def work(address: str, threads: str, folder: str) -> None:
    """Be a worker, until the process that started this one ends."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with quiet(), dask.config.set(SETTINGS):
        asyncio.run(_work(address, int(threads), folder))


async def _work(address: str, threads: int, folder: str) -> None:
    here: dict[str, Any] = {"host": "127.0.0.1", "local_directory": folder, "dashboard": False}
    async with Worker(address, nthreads=threads, memory_limit=0, **here) as worker:
        await worker.finished()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()  # that process holds the other end
    os._exit(0)


@contextmanager
def quiet() -> Iterator[None]:
    """Silence dask, which logs each lost connection with a traceback: what matters is said by the sweep."""
    names = ("distributed", *(name for name in logging.root.manager.loggerDict if name.startswith("distributed.")))
    levels = {logging.getLogger(name): logging.getLogger(name).level for name in names}
    for logger in levels:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in levels.items():
            logger.setLevel(level)
