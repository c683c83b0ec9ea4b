"""Dispatch of worlds to the workers of a cluster of dask.distributed.

The client decides which worker runs a world, and counts the attempts: what the scheduler does with tasks of workers
that died depends on its settings, and blames worlds that only were on the same worker. So each task is bound to a
worker, and has a key of its own for each attempt.
"""

from __future__ import annotations

import asyncio
import pickle
import time
from collections import Counter, deque
from collections.abc import Callable, Coroutine, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from distributed import Client, Future
from distributed.comm import get_address_host_port

from executive.processes.workers import ATTEMPTS
from executive.sweeps import cluster_worker
from executive.sweeps.cluster_worker import Lacks, Setup
from executive.sweeps.local_cluster import quiet
from executive.sweeps.records import Done, Task, World
from executive.sweeps.supervised import LOST, crashed
from planlang.diagnostics import BadInput, error

POLLED_EVERY = 1.0
"""Time between two looks at which workers there are [s]."""
JOINING_POLLED_EVERY = 0.1
"""The same while there is no worker [s]."""
CONNECTED_WITHIN = 5.0
"""Time for one attempt to connect to the scheduler [s]."""
CLOSED_WITHIN = 3.0
"""Time for saying goodbye to a scheduler, which may be dead [s]."""
BATCH = 32_000_000
"""Size from which contents of files are sent in several messages [bytes]."""
SHOWN = 8
"""Digits of a digest that messages show."""
SUSPECT = 2
"""Workers that died with a world after which it runs alone on a worker: the others may have been to blame."""
Report = Done | str | BaseException
"""A result, a sentence on what happened to the cluster, or what ends the sweep."""


class _Place:
    """A worker of the cluster and its worlds."""

    def __init__(self, address: str, slots: int) -> None:
        self.address, self.slots = address, slots
        self.name = address.partition("://")[2]
        self.running: dict[Future[Any], World] = {}
        self.is_gone = False
        self.is_reserved = False
        """True if it gets only single worlds that may have killed workers."""
        self.is_doubtful = False
        """True if a world failed on it, until the next look at which workers there are."""


class Dispatcher:
    """Runs worlds on the workers of a cluster; ``report`` gets their results."""

    def __init__(self, worlds: Sequence[World], task: Task, setup: Setup, report: Callable[[Report], object]) -> None:
        self._task, self._setup, self._report = task, setup, report
        self._waiting, self._suspects = deque(worlds), deque[World]()
        self._left = len(worlds)
        self._attempts: Counter[Any] = Counter()
        self._deaths: Counter[Any] = Counter()
        """Workers that died, by world that they had."""
        self._places: dict[str, _Place] = {}
        self._joining: set[str] = set()
        self._refused: dict[str, str] = {}
        """Workers that cannot be used, and why."""
        self._failures: Counter[str] = Counter()
        """Attempts to prepare a worker that failed."""
        self._works: set[asyncio.Task[None]] = set()
        self._last_worker = time.monotonic()
        """When there last was a worker."""
        self._awake, self._next_look = asyncio.Event(), asyncio.Event()
        self._address = ""
        self._current: asyncio.Task[None] | None = None
        self._is_unconnected = False
        """True if it was said that no scheduler answers, until a worker joins."""
        self._absence = ""
        """What the last attempt to connect found in place of a scheduler; "" if it found one."""
        self._total = len(worlds)

    async def run(self, address: str) -> None:
        """Run all worlds on the cluster of the scheduler at an address. Raises BadInput if it is lost for too long.

        If worlds still run in the end, their processes end; else these wait for the next batch, until :func:`forget`.
        """
        self._address = address
        timeout = min(CONNECTED_WITHIN, max(self._task.cluster_wait, 0.1))
        with quiet():
            while self._left > 0:
                client = _client(address, timeout)
                try:
                    await self._until_stopped(self._connected(client, timeout))
                finally:
                    await self._leave(client)

    def stop(self) -> None:
        """End the sweep; worlds that run are lost."""
        self._left = 0
        self._awake.set()
        if self._current is not None:
            self._current.cancel()

    async def _until_stopped(self, work: Coroutine[Any, Any, None]) -> None:
        self._current = asyncio.create_task(work)
        await asyncio.wait([self._current])
        if not self._current.cancelled():
            self._current.result()

    async def _connected(self, client: Client, timeout: float) -> None:
        """Connect to the scheduler and run worlds while it is there."""
        try:
            async with asyncio.timeout(timeout):  # that of the client ends no wait for an answer to its greeting
                await client
        except (TypeError, ImportError) as problem:  # no certificates, or a scheduler of another time
            raise _unusable(self._address, problem) from None
        except OSError:
            self._absence = await _absence(self._address, timeout)
            if not self._is_unconnected:
                self._is_unconnected = True
                self._say_waiting(self._absence)
            self._check_wait()
            await asyncio.sleep(POLLED_EVERY)
        else:
            self._absence = ""
            await self._session(client)

    async def _session(self, client: Client) -> None:
        """Send worlds while the scheduler is there."""
        self._places.clear()
        while self._left > 0:
            self._awake.clear()
            with suppress(OSError):  # the status below says whether the scheduler is gone
                await self._look(client)
            if client.status != "running":
                self._say_gone()
                return
            self._fill(client)
            with suppress(TimeoutError):
                await asyncio.wait_for(self._awake.wait(), POLLED_EVERY if self._places else JOINING_POLLED_EVERY)
            self._check_wait()

    async def _look(self, client: Client) -> None:
        """See which workers joined and which are gone."""
        threads = dict(await client.nthreads())
        for address in [one for one in self._places if one not in threads]:
            place = self._places.pop(address)
            place.is_gone = True
            if place.running:
                self._report(f"worker {place.name} died; to run again: {_number(place.running)}")
            await client.cancel(list(place.running), force=True)
        for place in self._places.values():
            place.is_doubtful = False
        self._next_look.set()
        self._next_look = asyncio.Event()
        for address, slots in threads.items():
            if not (address in self._places or address in self._joining or address in self._refused):
                self._joining.add(address)
                self._start(self._join(client, _Place(address, slots)))
        if self._places:
            self._last_worker = time.monotonic()
        elif threads and set(threads) <= set(self._refused):
            why = "; ".join(sorted({self._refused[address] for address in threads}))
            advice = f"install {self._own()} on the workers, as on this machine, and start them again"
            raise BadInput([error("C037", f"no worker can be used: each {why}", help=advice)])

    async def _join(self, client: Client, place: _Place) -> None:
        """Prepare a worker for the sweep: check its planlang, send it the files that it lacks."""
        try:
            why = await self._unusable(client, place.address)
        except Exception as problem:  # it died meanwhile, or has no room for files
            self._failures[place.address] += 1
            why = f"cannot be prepared: {problem}"
            if self._failures[place.address] < ATTEMPTS:
                return
        finally:
            self._joining.discard(place.address)
            self._awake.set()
        if why is None:
            self._places[place.address] = place
            self._is_unconnected = False
            self._fill(client)
        else:
            self._refused[place.address] = why
            self._report(f"worker {place.name} gets no world: it {why}")

    async def _unusable(self, client: Client, address: str) -> str | None:
        """Prepare a worker; returns why that is not possible. Raises any exception if the worker or its disk fails."""
        found = await client.scheduler.broadcast(msg={"op": "versions", "packages": ["planlang"]}, workers=[address])
        theirs = found[address]["packages"]["planlang"]
        if theirs is None:
            return "has no planlang"
        if theirs != version("planlang"):
            return f"has planlang {theirs}, not {self._own()}"
        while True:
            lacks = (await client.run(cluster_worker.accept, self._setup, workers=[address]))[address]
            if lacks is None:
                return None
            if lacks.program:
                return f"has planlang {theirs} ({lacks.program[:SHOWN]}), not {self._own()}"
            for batch in self._batches(lacks.contents):
                await client.run(cluster_worker.take, batch, workers=[address])
                self._last_worker = time.monotonic()

    def _own(self) -> str:
        return f"planlang {version('planlang')} ({self._setup.program[:SHOWN]})"

    def _batches(self, digests: Sequence[str]) -> Iterator[dict[str, bytes]]:
        """Yield the contents of files, not too many at a time."""
        assert self._setup.shipment is not None
        paths = {digest: path for path, digest in self._setup.shipment.files.items()}
        batch: dict[str, bytes] = {}
        for digest in digests:
            batch[digest] = Path(paths[digest]).read_bytes()
            if sum(map(len, batch.values())) > BATCH:
                yield batch
                batch = {}
        if batch:
            yield batch

    def _fill(self, client: Client) -> None:
        """Send worlds to free slots, and one more to each worker for when the first slot is free again."""
        if client.status != "running":
            return
        places = [one for one in self._places.values() if not one.is_doubtful]
        if self._suspects and places and not any(one.is_reserved for one in places):
            places[0].is_reserved = True
        for place in places:
            if place.is_reserved and not place.running:
                place.is_reserved = bool(self._suspects)
                if self._suspects:
                    self._send(client, place, self._suspects.popleft())
        slots = sum(place.slots for place in places)
        for more in (0, 1) if len(self._waiting) > slots else (0,):
            for place in places:
                while self._waiting and not place.is_reserved and len(place.running) < place.slots + more:
                    self._send(client, place, self._waiting.popleft())

    def _send(self, client: Client, place: _Place, world: World) -> None:
        key = world["world"]
        self._attempts[key] += 1
        future = client.submit(
            cluster_worker.done,
            self._setup.token,
            pickle.dumps(dict(world)),  # of which dask looks at no part
            key=("planlang-world", client.id, key, self._attempts[key]),
            workers=[place.address],
            allow_other_workers=False,
            retries=0,
        )
        place.running[future] = world
        self._start(self._result(client, place, future, world))

    def _start(self, work: Coroutine[Any, Any, None]) -> None:
        """Start a piece of work; an exception in it ends the sweep."""

        def ended(task: asyncio.Task[None]) -> None:
            self._works.discard(task)
            if not task.cancelled() and (problem := task.exception()) is not None:
                self._end(problem)

        task = asyncio.create_task(work)
        self._works.add(task)
        task.add_done_callback(ended)

    async def _result(self, client: Client, place: _Place, future: Future[Any], world: World) -> None:
        """Wait for a world; it runs again if its worker, or the scheduler, is lost."""
        try:
            await self._ended(client, place, future, world)
        except asyncio.CancelledError:  # the client leaves
            self._waiting.appendleft(world)
            raise
        finally:
            place.running.pop(future, None)
            future.release()
        self._fill(client)

    async def _ended(self, client: Client, place: _Place, future: Future[Any], world: World) -> None:
        try:
            done = await future
        except Exception as problem:
            if getattr(problem, "reason", None) == "scheduler-connection-lost":
                self._say_gone()
            place.is_doubtful = True
            self._lost(world, died=place.is_gone or future.status == "error", why=problem)
            return
        match done:
            case Done() if done.row.get("failure") == [LOST] and await self._dies(place):
                self._lost(world, died=True, why=done.row["message"])
            case Done():
                self._finish(replace(done, worker=place.name))
            case Lacks():  # it has forgotten the sweep for another one
                with suppress(Exception):
                    await self._unusable(client, place.address)
                self._waiting.appendleft(world)
            case diagnostics:
                self._end(BadInput(diagnostics))

    async def _dies(self, place: _Place) -> bool:
        """Wait for the next look; returns whether a worker died with the process of a world, as when a job ends."""
        look = self._next_look
        await look.wait()
        return place.is_gone

    def _lost(self, world: World, *, died: bool, why: object) -> None:
        """Let a world run again, unless too many workers died while they ran nothing else."""
        key = world["world"]
        self._deaths[key] += died
        if self._deaths[key] >= SUSPECT + ATTEMPTS:
            message = f"{ATTEMPTS} workers in a row died, or failed, that ran nothing else: {why}"
            self._finish(crashed(world, LOST, message))
        elif self._deaths[key] >= SUSPECT:
            self._suspects.append(world)
        else:
            self._waiting.appendleft(world)

    def _finish(self, done: Done) -> None:
        self._left -= 1
        self._report(done)
        if self._left <= 0:
            self._awake.set()

    def _end(self, problem: BaseException) -> None:
        """End the sweep with a problem."""
        self._report(problem)
        self._left = 0
        self._awake.set()

    # Waiting for the cluster

    def _say_gone(self) -> None:
        """Say once that the scheduler is gone; another one knows none of the workers."""
        if not self._is_unconnected:
            self._is_unconnected = True
            self._places.clear()  # or their worlds would count as lost with them
            self._say_waiting(f"the scheduler {self._address} is gone")

    def _say_waiting(self, what: str) -> None:
        wait = f"{self._task.cluster_wait:.15g} s"
        runs = "run" if self._left > 1 else "runs"
        self._report(f"{what}: {_number(range(self._left))} {runs} once workers join; waits up to {wait} for one")

    def _check_wait(self) -> None:
        """Give up if there was no worker for too long. Raises BadInput."""
        if self._places or time.monotonic() - self._last_worker <= self._task.cluster_wait:
            return
        lacking = self._absence or f"the cluster of {self._address} has no worker"
        wait = self._task.cluster_wait
        message = f"waited {wait:.15g} s: {lacking}; {self._left} of {self._total} worlds have not run"
        raise BadInput([error("C036", message, help=self._task.resume)])

    async def _leave(self, client: Client) -> None:
        """End the processes of worlds that run, and disconnect."""
        running = [one.address for one in self._places.values() if one.running]
        if running and client.status == "running":
            await _forgotten(client, self._setup.token, running)
        await _closed(client)
        works = list(self._works)
        for one in works:
            one.cancel()
        await asyncio.gather(*works, return_exceptions=True)


async def forget(address: str, tokens: Iterable[str]) -> None:
    """End the processes of sweeps on all workers of a scheduler, if it is there."""
    with quiet(), suppress(Exception):
        client = _client(address, CONNECTED_WITHIN)
        try:
            async with asyncio.timeout(CONNECTED_WITHIN):
                await client
            for token in tokens:
                await _forgotten(client, token)
        finally:
            await _closed(client)


async def _forgotten(client: Client, token: str, workers: Sequence[str] | None = None) -> None:
    with suppress(Exception):
        async with asyncio.timeout(CLOSED_WITHIN):
            await client.run(cluster_worker.forget, token, workers=workers)


async def _closed(client: Client) -> None:
    with suppress(Exception):
        async with asyncio.timeout(CLOSED_WITHIN):
            await client.close()


def _number(worlds: Sequence[object] | dict[Any, Any]) -> str:
    return f"{len(worlds)} world" + "s" * (len(worlds) != 1)


async def _absence(address: str, timeout: float) -> str:
    """Say what there is in place of a scheduler: nothing that can be reached, or another program."""
    try:
        async with asyncio.timeout(timeout):
            _, stream = await asyncio.open_connection(*get_address_host_port(address))
    except OSError:
        return f"no scheduler answers at {address}"
    stream.close()
    return f"what listens at {address} does not answer as a scheduler of dask"


def _client(address: str, timeout: float) -> Client:
    """Make a client, which is not connected yet. Raises BadInput if the certificates of dask cannot be read."""
    try:
        return Client(address, asynchronous=True, timeout=timeout, set_as_default=False, direct_to_workers=False)
    except (OSError, ValueError, TypeError) as problem:
        raise _unusable(address, problem) from None


def _unusable(address: str, problem: Exception) -> BadInput:
    tls = "state ca-file, client.cert and client.key under distributed.comm.tls in the configuration of dask"
    advice = tls if address.startswith("tls:") else "install the same version of distributed here and there"
    return BadInput([error("C036", f"the scheduler {address} cannot be used: {problem}", help=advice)])
