"""The work on trio: nurseries, events, cancel scopes."""

from __future__ import annotations

import trio
import trio.testing

from workloads import FOREVER, STEPS, clock, graph, nothing


def spawn(size: int) -> float:
    async def main() -> float:
        begin = clock()
        async with trio.open_nursery() as nursery:
            for _ in range(size):
                nursery.start_soon(nothing)
        return clock() - begin

    return trio.run(main)


def order(size: int) -> float:
    before = graph(size)

    async def main() -> float:
        begin = clock()
        done = [trio.Event() for _ in before]

        async def step(number: int) -> None:
            for earlier in before[number]:
                await done[earlier].wait()
            await nothing()
            done[number].set()

        async with trio.open_nursery() as nursery:
            for number in before:
                nursery.start_soon(step, number)
        return clock() - begin

    return trio.run(main)


def evaporate(size: int) -> float:
    async def main() -> float:
        async with trio.open_nursery() as nursery:
            for _ in range(size):
                nursery.start_soon(trio.sleep, FOREVER)
            await trio.testing.wait_all_tasks_blocked()
            begin = clock()
            nursery.cancel_scope.cancel()
        return clock() - begin

    return trio.run(main)


def fluent(size: int) -> float:
    async def main() -> float:
        event = trio.Event()
        async with trio.open_nursery() as nursery:
            for _ in range(size):
                nursery.start_soon(event.wait)
            await trio.testing.wait_all_tasks_blocked()
            begin = clock()
            event.set()
        return clock() - begin

    return trio.run(main)


def step(size: int) -> float:
    async def main() -> float:
        async with trio.open_nursery() as nursery:
            for _ in range(size):
                nursery.start_soon(trio.sleep, FOREVER)
            await trio.sleep(0)
            begin = clock()
            for _ in range(STEPS):
                await trio.sleep(0)
            taken = clock() - begin
            nursery.cancel_scope.cancel()
        return taken

    return trio.run(main)


def nest(size: int) -> float:
    async def level(left: int) -> None:
        if left:
            async with trio.open_nursery() as nursery:
                nursery.start_soon(level, left - 1)

    async def main() -> float:
        begin = clock()
        await level(size)
        return clock() - begin

    return trio.run(main)
