"""What the kernel's tasks cost, beside the same work on asyncio, trio and py_trees in the same process.

Repetitions of all libraries take turns, so that a slow moment of the machine hits all of them; the medians count. All
run with the collector's threshold that the kernel sets for itself. A library that has no such thing gets a dash.

    python tests/benchmarks/kernel.py              the table on the terminal
    python tests/benchmarks/kernel.py --markdown   the table as it stands in docs/benchmarks.md
    python tests/benchmarks/kernel.py --check      exit 1 where a bound is missed (generous: for continuous integration)
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import platform
import random
import statistics
import sys
import time
from collections.abc import Awaitable, Callable
from functools import partial
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory

from planlang import Fluent, SimulationHost, VirtualHost, par, partial_order, pursue, run, sleep, wait_for
from planlang.kernel import Trace
from planlang.kernel.environment import YOUNG

try:
    import trio
except ImportError:
    trio = None  # type: ignore[assignment]
try:
    import py_trees
except ImportError:
    py_trees = None  # type: ignore[assignment]

clock = time.process_time  # what other processes take does not count
FOREVER = 10**6
LIBRARIES = ("planlang", "planlang kept", "planlang written", "asyncio", "trio", "py_trees")


async def nothing(*_: object) -> None:
    """A branch that does nothing."""


# -- each takes a size and returns seconds


def on_planlang(plan: Callable[[], Awaitable[float]], trace: Trace | None = None) -> float:
    return run(plan, host=VirtualHost(), trace=trace)


def spawn_planlang(size: int, trace: Trace | None = None) -> float:
    async def plan() -> float:
        begin = clock()
        await par(*[nothing] * size)
        return clock() - begin

    return on_planlang(plan, trace)


def spawn_planlang_kept(size: int) -> float:
    return spawn_planlang(size, Trace())


def spawn_planlang_traced(size: int) -> float:
    with TemporaryDirectory() as folder, Trace.at(Path(folder) / "trace.jsonl") as trace:
        return spawn_planlang(size, trace)


def spawn_asyncio(size: int) -> float:
    async def main() -> float:
        begin = clock()
        async with asyncio.TaskGroup() as group:
            for _ in range(size):
                group.create_task(nothing())
        return clock() - begin

    return asyncio.run(main())


def spawn_trio(size: int) -> float:
    async def main() -> float:
        begin = clock()
        async with trio.open_nursery() as nursery:
            for _ in range(size):
                nursery.start_soon(nothing)
        return clock() - begin

    return trio.run(main)


def spawn_py_trees(size: int) -> float:
    begin = clock()
    root = py_trees.composites.Parallel("par", py_trees.common.ParallelPolicy.SuccessOnAll())
    root.add_children([py_trees.behaviours.Success(str(number)) for number in range(size)])
    root.tick_once()
    return clock() - begin


def graph(size: int) -> dict[int, tuple[int, ...]]:
    """Two predecessors for each step, among the hundred before it."""
    stream = random.Random(1)
    return {step: tuple(sorted(stream.sample(range(max(0, step - 100), step), min(2, step)))) for step in range(size)}


def order_planlang(size: int, trace: Trace | None = None) -> float:
    before = graph(size)
    steps = {str(step): nothing for step in before}
    orderings = [(str(one), str(step)) for step, earlier in before.items() for one in earlier]

    async def plan() -> float:
        begin = clock()
        await partial_order(steps, orderings)
        return clock() - begin

    return on_planlang(plan, trace)


def order_planlang_kept(size: int) -> float:
    return order_planlang(size, Trace())


def order_planlang_traced(size: int) -> float:
    with TemporaryDirectory() as folder, Trace.at(Path(folder) / "trace.jsonl") as trace:
        return order_planlang(size, trace)


def order_asyncio(size: int) -> float:
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


def order_trio(size: int) -> float:
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


def evaporate_planlang(size: int) -> float:
    async def plan() -> float:
        async def trigger() -> float:
            await sleep(0.01)
            return clock()

        begin = await pursue(partial(par, *[partial(sleep, FOREVER)] * size), trigger)
        return clock() - begin

    return on_planlang(plan)


def evaporate_asyncio(size: int) -> float:
    async def main() -> float:
        tasks = [asyncio.create_task(asyncio.sleep(FOREVER)) for _ in range(size)]
        await asyncio.sleep(0)
        begin = clock()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        return clock() - begin

    return asyncio.run(main())


def evaporate_trio(size: int) -> float:
    async def main() -> float:
        async with trio.open_nursery() as nursery:
            for _ in range(size):
                nursery.start_soon(trio.sleep, FOREVER)
            await trio.testing.wait_all_tasks_blocked()
            begin = clock()
            nursery.cancel_scope.cancel()
        return clock() - begin

    return trio.run(main)


def evaporate_py_trees(size: int) -> float:
    root = py_trees.composites.Parallel("par", py_trees.common.ParallelPolicy.SuccessOnAll())
    root.add_children([py_trees.behaviours.Running(str(number)) for number in range(size)])
    root.tick_once()
    begin = clock()
    root.stop(py_trees.common.Status.INVALID)
    return clock() - begin


def fluent_planlang(size: int) -> float:
    async def plan() -> float:
        fluent = Fluent(False)

        async def trigger() -> float:
            await sleep(0.01)
            begin = clock()
            fluent.set(True)
            return begin

        results = await par(trigger, *[partial(wait_for, fluent)] * size)
        return clock() - results[0]

    return on_planlang(plan)


def fluent_asyncio(size: int) -> float:
    async def main() -> float:
        event = asyncio.Event()
        tasks = [asyncio.create_task(event.wait()) for _ in range(size)]
        await asyncio.sleep(0)
        begin = clock()
        event.set()
        await asyncio.gather(*tasks)
        return clock() - begin

    return asyncio.run(main())


def fluent_trio(size: int) -> float:
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


def fluent_py_trees(size: int) -> float:
    board = py_trees.blackboard.Client(name="bench")
    board.register_key("flag", access=py_trees.common.Access.WRITE)
    board.flag = False
    root = py_trees.composites.Parallel("par", py_trees.common.ParallelPolicy.SuccessOnAll())
    compare = py_trees.common.ComparisonExpression("flag", True, lambda left, right: left == right)
    root.add_children([py_trees.behaviours.WaitForBlackboardVariableValue(str(n), compare) for n in range(size)])
    root.tick_once()
    begin = clock()
    board.flag = True
    root.tick_once()
    return clock() - begin


STEPS = 5_000
"""World steps that are measured at a time."""


class Still:
    """A world in which nothing happens."""

    rate = 240

    def step(self) -> None:
        """Nothing."""


def bare() -> float:
    """What calling the world alone costs; it is no overhead."""
    step = Still().step
    begin = clock()
    for _ in range(STEPS):
        step()
    return clock() - begin


def step_planlang(size: int) -> float:
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


def step_asyncio(size: int) -> float:
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


def step_trio(size: int) -> float:
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


def step_py_trees(size: int) -> float:
    root = py_trees.composites.Parallel("par", py_trees.common.ParallelPolicy.SuccessOnAll())
    root.add_children([py_trees.behaviours.Running(str(number)) for number in range(size)])
    few = STEPS // 10
    begin = clock()
    for _ in range(few):
        root.tick_once()
    return (clock() - begin) * (STEPS / few)


def nest_planlang(size: int) -> float:
    async def level(left: int) -> None:
        if left:
            await par(partial(level, left - 1))

    async def plan() -> float:
        begin = clock()
        await level(size)
        return clock() - begin

    return on_planlang(plan)


def nest_asyncio(size: int) -> float:
    async def level(left: int) -> None:
        if left:
            async with asyncio.TaskGroup() as group:
                group.create_task(level(left - 1))

    async def main() -> float:
        begin = clock()
        await level(size)
        return clock() - begin

    return asyncio.run(main())


def nest_trio(size: int) -> float:
    async def level(left: int) -> None:
        if left:
            async with trio.open_nursery() as nursery:
                nursery.start_soon(level, left - 1)

    async def main() -> float:
        begin = clock()
        await level(size)
        return clock() - begin

    return trio.run(main)


Work = Callable[[int], float]
WORK: dict[str, dict[str, Work]] = {
    "spawn": {
        "planlang": spawn_planlang,
        "planlang kept": spawn_planlang_kept,
        "planlang written": spawn_planlang_traced,
        "asyncio": spawn_asyncio,
        "trio": spawn_trio,
        "py_trees": spawn_py_trees,
    },
    "order": {
        "planlang": order_planlang,
        "planlang kept": order_planlang_kept,
        "planlang written": order_planlang_traced,
        "asyncio": order_asyncio,
        "trio": order_trio,
    },
    "evaporate": {
        "planlang": evaporate_planlang,
        "asyncio": evaporate_asyncio,
        "trio": evaporate_trio,
        "py_trees": evaporate_py_trees,
    },
    "fluent": {
        "planlang": fluent_planlang,
        "asyncio": fluent_asyncio,
        "trio": fluent_trio,
        "py_trees": fluent_py_trees,
    },
    "step": {"planlang": step_planlang, "asyncio": step_asyncio, "trio": step_trio, "py_trees": step_py_trees},
    "nest": {"planlang": nest_planlang, "asyncio": nest_asyncio, "trio": nest_trio},
}
TABLE: list[tuple[str, str, int, int, str]] = [
    # row, work, size, repetitions, what the number is divided by
    ("spawn and join 1,000 branches", "spawn", 1_000, 15, "branch"),
    ("spawn and join 10,000 branches", "spawn", 10_000, 9, "branch"),
    ("spawn and join 100,000 branches", "spawn", 100_000, 3, "branch"),
    ("partial_order of 1,000 steps, 2 orderings each", "order", 1_000, 15, "step"),
    ("partial_order of 10,000 steps, 2 orderings each", "order", 10_000, 5, "step"),
    ("evaporating 1,000 sleepers", "evaporate", 1_000, 15, "task"),
    ("evaporating 10,000 sleepers", "evaporate", 10_000, 7, "task"),
    ("waking 1,000 that wait for one fluent", "fluent", 1_000, 15, "task"),
    ("world step, nobody sleeps, one waits for the world", "step", 0, 9, "world step"),
    ("world step, 1 sleeping task", "step", 1, 9, "world step"),
    ("world step, 100 sleeping tasks", "step", 100, 9, "world step"),
    ("10,000 nested par", "nest", 9_990, 5, "level"),
]


def measure(quick: bool) -> dict[str, dict[str, float]]:
    """Microseconds per unit of each row and library: medians of interleaved repetitions."""
    found: dict[str, dict[str, float]] = {}
    for row, work, size, repetitions, _ in TABLE:
        samples: dict[str, list[float]] = {
            library: [] for library in WORK[work] if {"trio": trio, "py_trees": py_trees}.get(library, True)
        }
        if size == 100_000:
            samples.pop("py_trees", None)  # no tasks, and minutes for it
        for _ in range(min(3, repetitions) if quick else repetitions):
            for library, taken in samples.items():
                gc.collect()
                taken.append(WORK[work][library](size))
        units = STEPS if work == "step" else size
        found[row] = {library: statistics.median(taken) / units * 1e6 for library, taken in samples.items()}
        print(f"  {row}", file=sys.stderr)
    return found


def bounds(found: dict[str, dict[str, float]]) -> list[tuple[str, float, float]]:
    """What was promised, what was measured, and the bound."""
    task = found["spawn and join 10,000 branches"]
    order = found["partial_order of 1,000 steps, 2 orderings each"]
    small = found["spawn and join 1,000 branches"]
    large = found["spawn and join 100,000 branches"]
    few, many = found["evaporating 1,000 sleepers"], found["evaporating 10,000 sleepers"]
    return [
        ("spawn and join of 10,000 branches / asyncio.TaskGroup", task["planlang"] / task["asyncio"], 0.9),
        ("the same with the trace kept in memory", task["planlang kept"] / task["asyncio"], 1.4),
        ("the same with each line of the trace written through", task["planlang written"] / task["asyncio"], 1.4),
        ("a branch among 100,000 / among 1,000", large["planlang"] / small["planlang"], 1.3),
        ("a step of partial_order / asyncio's task", order["planlang"] / small["asyncio"], 4 / 3.5),
        ("world step with one sleeping task [µs]", found["world step, 1 sleeping task"]["planlang"], 1.0),
        ("evaporating one of 10,000 / one of 1,000", many["planlang"] / few["planlang"], 1.5),
    ]


def table(found: dict[str, dict[str, float]]) -> list[list[str]]:
    """Rows of text: microseconds for planlang, ratios to it for the others (above 1: slower than planlang)."""
    rows = [["work", "planlang", "trace kept", "trace written", "asyncio", "trio", "py_trees"]]
    for row, *_, unit in TABLE:
        numbers = found[row]
        own = numbers["planlang"]
        cells = [f"x {numbers[one] / own:.1f}" if one in numbers else "-" for one in LIBRARIES[1:]]
        rows.append([row, f"{own:.2f} µs a {unit}", *cells])
    return rows


def show(rows: list[list[str]], markdown: bool) -> None:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    for number, row in enumerate(rows):
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=True)]
        print(f"| {' | '.join(cells)} |" if markdown else "  ".join(cells).rstrip())
        if markdown and not number:
            print(f"|{'|'.join('-' * (width + 2) for width in widths)}|")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--markdown", action="store_true")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--quick", action="store_true", help="three repetitions only")
    options = parser.parse_args()
    gc.set_threshold(YOUNG, *gc.get_threshold()[1:])
    found = measure(options.quick)
    versions = ", ".join(
        f"{name} {metadata.version(name)}" for name, module in (("trio", trio), ("py_trees", py_trees)) if module
    )
    print(f"Python {platform.python_version()} on {platform.machine()}, asyncio of it, {versions or 'nothing else'}\n")
    show(table(found), options.markdown)
    print()
    promised = bounds(found)
    verdicts = [["promise", "measured", "bound", ""]]
    verdicts += [[what, f"{got:.2f}", f"{most:.2f}", "" if got <= most else "missed"] for what, got, most in promised]
    show(verdicts, options.markdown)
    slack = 1.5  # a shared machine
    if options.check and any(got > most * slack for _, got, most in promised):
        sys.exit(1)


if __name__ == "__main__":
    if trio is not None:
        import trio.testing
    main()
