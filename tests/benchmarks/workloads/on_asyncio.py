"""The work on asyncio: a TaskGroup for what is joined, cancel for what is evaporated."""

from __future__ import annotations

import asyncio

from workloads import FOREVER, STEPS, clock, graph, nothing


def spawn(size: int) -> float:
    async def main() -> float:
        begin = clock()
        async with asyncio.TaskGroup() as group:
            for _ in range(size):
                group.create_task(nothing())
        return clock() - begin

    return asyncio.run(main())


def order(size: int) -> float:
    before = graph(size)

    async def main() -> float:
        begin = clock()
        tasks: list[asyncio.Task[None]] = []

        async def step(number: int) -> None:
            for earlier in before[number]:
                await tasks[earlier]
            await nothing()

        async with asyncio.TaskGroup() as group:
            for number in before:
                tasks.append(group.create_task(step(number)))
        return clock() - begin

    return asyncio.run(main())


def evaporate(size: int) -> float:
    async def main() -> float:
        tasks = [asyncio.create_task(asyncio.sleep(FOREVER)) for _ in range(size)]
        await asyncio.sleep(0)
        begin = clock()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        return clock() - begin

    return asyncio.run(main())


def fluent(size: int) -> float:
    async def main() -> float:
        event = asyncio.Event()
        tasks = [asyncio.create_task(event.wait()) for _ in range(size)]
        await asyncio.sleep(0)
        begin = clock()
        event.set()
        await asyncio.gather(*tasks)
        return clock() - begin

    return asyncio.run(main())


def step(size: int) -> float:
    async def main() -> float:
        tasks = [asyncio.create_task(asyncio.sleep(FOREVER)) for _ in range(size)]
        await asyncio.sleep(0)
        begin = clock()
        for _ in range(STEPS):
            await asyncio.sleep(0)
        taken = clock() - begin
        for task in tasks:
            task.cancel()
        return taken

    return asyncio.run(main())


def nest(size: int) -> float:
    async def level(left: int) -> None:
        if left:
            async with asyncio.TaskGroup() as group:
                group.create_task(level(left - 1))

    async def main() -> float:
        begin = clock()
        await level(size)
        return clock() - begin

    return asyncio.run(main())
