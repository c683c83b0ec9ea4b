"""Dispatch of worlds to the workers of a cluster of dask.distributed.

The client decides which worker runs a world, and counts the attempts: what the scheduler does with tasks of workers
that died depends on its settings, and blames worlds that only were on the same worker. So each task is bound to a
worker, and has a key of its own for each attempt.
"""

from __future__ import annotations

import asyncio
import time
from collections import Counter, deque
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from distributed import Client, Future

from executive.processes.workers import ATTEMPTS
from executive.sweeps import cluster_worker
from executive.sweeps.cluster_worker import Setup
from executive.sweeps.local_cluster import quiet
from executive.sweeps.records import Done, Task, World
from executive.sweeps.supervised import LOST, crashed
from planlang.diagnostics import BadInput, error
from planlang.words import Text

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
        self._joining: dict[str, asyncio.Task[None]] = {}
        self._refused: dict[str, str] = {}
        """Workers with another planlang, and which."""
        self._worlds: set[asyncio.Task[None]] = set()
        self._last_worker = time.monotonic()
        """When there last was a worker."""
        self._awake = asyncio.Event()
        self._address = ""
        self._current: asyncio.Task[None] | None = None
        self._is_unconnected = False
        """True if it was said that no scheduler answers, until a worker joins."""
        self._total = len(worlds)

    async def run(self, address: str) -> None:
        """Run all worlds on the cluster of the scheduler at an address. Raises BadInput if it is lost for too long."""
        self._address = address
        timeout = min(CONNECTED_WITHIN, max(self._task.cluster_wait, 0.1))
        with quiet():
            while self._left:
                client = Client(
                    address, asynchronous=True, timeout=timeout, set_as_default=False, direct_to_workers=False
                )
                try:
                    await self._until_stopped(self._connected(client))
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

    async def _connected(self, client: Client) -> None:
        """Connect to the scheduler and run worlds while it is there."""
        try:
            await client
        except OSError:
            if not self._is_unconnected:
                self._is_unconnected = True
                self._say_waiting(f"no scheduler answers at {self._address}")
            self._check_wait()
            await asyncio.sleep(POLLED_EVERY)
        else:
            await self._session(client)

    async def _session(self, client: Client) -> None:
        """Send worlds while the scheduler is there."""
        self._places.clear()
        while self._left:
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
                self._report(f"worker {place.name} died: its {_number(place.running)} run again")
            await client.cancel(list(place.running), force=True)
        for address, slots in threads.items():
            if not (address in self._places or address in self._joining or address in self._refused):
                self._joining[address] = asyncio.create_task(self._join(client, _Place(address, slots)))
        if self._places:
            self._last_worker = time.monotonic()
        elif threads and set(threads) <= set(self._refused):
            others = ", ".join(sorted({self._refused[address] for address in threads}))
            advice = "install the planlang of this machine on the workers, and start them again"
            raise BadInput([error("C037", f"all workers have {others}, not {self._own()}", help=advice)])

    async def _join(self, client: Client, place: _Place) -> None:
        """Prepare a worker for the sweep: check its planlang, send it the files that it lacks."""
        try:
            if (other := await self._other_planlang(client, place)) is not None:
                self._refused[place.address] = other
                self._report(f"worker {place.name} has {other}, not {self._own()}: it gets no world")
            else:
                self._places[place.address] = place
                self._is_unconnected = False
                self._fill(client)
        except OSError:
            pass  # it died, or will be asked again
        except Exception as problem:
            self._end(problem)
        finally:
            del self._joining[place.address]
            self._awake.set()

    async def _other_planlang(self, client: Client, place: _Place) -> str | None:
        """Prepare a worker; returns which planlang it has, if that is another one."""
        workers = [place.address]
        message = {"op": "versions", "packages": ["planlang"]}
        found = await client.scheduler.broadcast(msg=message, workers=workers)
        theirs = found[place.address]["packages"]["planlang"]
        if theirs != version("planlang"):
            return "no planlang" if theirs is None else f"planlang {theirs}"
        while True:
            reply = await client.run(cluster_worker.accept, self._setup, workers=workers)
            lacks = reply[place.address]
            if lacks is None:
                return None
            if lacks.program:
                return f"planlang {theirs} with other content ({lacks.program[:SHOWN]})"
            for batch in self._batches(lacks.contents):
                await client.run(cluster_worker.take, batch, workers=workers)

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
        places = list(self._places.values())
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
            dict(world),
            key=("planlang-world", client.id, key, self._attempts[key]),
            workers=[place.address],
            allow_other_workers=False,
            retries=0,
        )
        place.running[future] = world
        work = asyncio.create_task(self._result(client, place, future, world))
        self._worlds.add(work)
        work.add_done_callback(self._worlds.discard)

    async def _result(self, client: Client, place: _Place, future: Future[Any], world: World) -> None:
        """Wait for a world; it runs again if its worker, or the scheduler, is lost."""
        try:
            done = await future
        except Exception as problem:
            if getattr(problem, "reason", None) == "scheduler-connection-lost":
                self._say_gone()
            self._lost(place, world, died=place.is_gone or future.status == "error", problem=problem)
        else:
            if isinstance(done, Done):
                self._finish(replace(done, worker=place.name))
            else:
                self._end(BadInput(done))
        finally:
            place.running.pop(future, None)
            future.release()
        self._fill(client)

    def _lost(self, place: _Place, world: World, *, died: bool, problem: Exception) -> None:
        """Let a world run again, unless too many workers died while they ran nothing else."""
        key = world["world"]
        self._deaths[key] += died
        if self._deaths[key] >= SUSPECT + ATTEMPTS:
            message = f"{ATTEMPTS} workers in a row died, or failed, that ran nothing else: {problem}"
            self._finish(crashed(world, LOST, message))
        elif self._deaths[key] >= SUSPECT:
            self._suspects.append(world)
        else:
            self._waiting.appendleft(world)

    def _finish(self, done: Done) -> None:
        self._left -= 1
        self._report(done)
        if not self._left:
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
            self._say_waiting(f"the scheduler {self._address} is gone")

    def _say_waiting(self, what: str) -> None:
        wait = self._task.cluster_wait
        self._report(f"{what}: {self._left} worlds run once workers join; waits up to {wait:g} s for one")

    def _check_wait(self) -> None:
        """Give up if there was no worker for too long. Raises BadInput."""
        if self._places or time.monotonic() - self._last_worker <= self._task.cluster_wait:
            return
        message = (
            f"the cluster of {self._address} had no worker for {self._task.cluster_wait:g} s; "
            f"{self._left} of {self._total} worlds have not run"
        )
        help = None if self._task.resume is None else Text("run the rest with ", self._task.resume)
        raise BadInput([error("C036", message, help=help)])

    async def _leave(self, client: Client) -> None:
        """End the processes of the sweep on all workers, and disconnect."""
        for joining in list(self._joining.values()):
            joining.cancel()
        with suppress(Exception):
            async with asyncio.timeout(CLOSED_WITHIN):
                if client.status == "running" and self._places:
                    await client.run(cluster_worker.forget, self._setup.token, workers=list(self._places))
        with suppress(Exception):
            async with asyncio.timeout(CLOSED_WITHIN):
                await client.close()
        for one in list(self._worlds):
            one.cancel()
        await asyncio.gather(*self._worlds, *self._joining.values(), return_exceptions=True)


def _number(worlds: Sequence[object] | dict[Any, Any]) -> str:
    return f"{len(worlds)} world" + "s" * (len(worlds) != 1)
