"""The work on planlang: without a trace, with one kept in memory, with one written through to a file line by line."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Protocol

from planlang import Fluent, SimulationHost, VirtualHost, par, partial_order, pursue, run, sleep, wait_for
from planlang.runs import Trace
from workloads import FOREVER, STEPS, clock, graph, nothing


class Traceable(Protocol):
    """Work that can be traced."""

    def __call__(self, size: int, trace: Trace | None = None) -> float: ...


def kept(work: Traceable) -> Callable[[int], float]:
    """The work with a trace in memory."""
    return lambda size: work(size, Trace())


def written(work: Traceable) -> Callable[[int], float]:
    """The work with a trace in a file."""
    return lambda size: into_file(work, size)[0]


def into_file(work: Traceable, size: int) -> tuple[float, int]:
    """Seconds, and bytes of the trace."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "trace.jsonl"
        with Trace.at(path) as trace:
            taken = work(size, trace)
        return taken, path.stat().st_size


def on_virtual_time(plan: Callable[[], Awaitable[float]], trace: Trace | None = None) -> float:
    return run(plan, host=VirtualHost(), trace=trace)


def spawn(size: int, trace: Trace | None = None) -> float:
    async def plan() -> float:
        begin = clock()
        await par(*[nothing] * size)
        return clock() - begin

    return on_virtual_time(plan, trace)


def order(size: int, trace: Trace | None = None) -> float:
    before = graph(size)
    steps = {str(step): nothing for step in before}
    orderings = [(str(one), str(step)) for step, earlier in before.items() for one in earlier]

    async def plan() -> float:
        begin = clock()
        await partial_order(steps, orderings)
        return clock() - begin

    return on_virtual_time(plan, trace)


def evaporate(size: int) -> float:
    async def plan() -> float:
        async def trigger() -> float:
            await sleep(0.01)
            return clock()

        begin = await pursue(partial(par, *[partial(sleep, FOREVER)] * size), trigger)
        return clock() - begin

    return on_virtual_time(plan)


def fluent(size: int) -> float:
    async def plan() -> float:
        fluent = Fluent(False)

        async def trigger() -> float:
            await sleep(0.01)
            begin = clock()
            fluent.set(True)
            return begin

        results = await par(trigger, *[partial(wait_for, fluent)] * size)
        return clock() - results[0]

    return on_virtual_time(plan)


class Still:
    """A world in which nothing happens."""

    rate = 240

    def step(self) -> None:
        """Nothing."""


def bare() -> float:
    """Return what calling the world alone costs; it is no overhead."""
    step = Still().step
    begin = clock()
    for _ in range(STEPS):
        step()
    return clock() - begin


def step(size: int) -> float:
    async def sleepers() -> None:
        if size == 1:
            await sleep(STEPS / 240)
        elif size:
            await par(*[partial(sleep, STEPS / 240)] * size)
        else:  # nobody sleeps: one waits for the world
            left = iter(range(STEPS - 1))
            await wait_for(Fluent(read=lambda: next(left, None) is None))

    async def plan() -> float:
        begin = clock()
        await sleepers()
        return clock() - begin

    return run(plan, host=SimulationHost(Still())) - bare()


def nest(size: int, trace: Trace | None = None) -> float:
    async def level(left: int) -> None:
        if left:
            await par(partial(level, left - 1))

    async def plan() -> float:
        begin = clock()
        await level(size)
        return clock() - begin

    return on_virtual_time(plan, trace)
