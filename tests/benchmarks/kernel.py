"""Measure what the kernel's tasks cost, beside the same work on asyncio, trio and py_trees in the same process.

Repetitions of all libraries take turns, so that a slow moment of the machine hits all of them; the medians count. All
run with the collector's threshold that the kernel sets for itself. A library that has no such thing gets a dash.

    python tests/benchmarks/kernel.py              the table on the terminal
    python tests/benchmarks/kernel.py --markdown   the table as it stands in docs/reference/benchmarks.md
    python tests/benchmarks/kernel.py --check      exit 1 where a bound is missed (generous: for continuous integration)
"""

from __future__ import annotations

import argparse
import gc
import platform
import statistics
import sys
from collections.abc import Callable
from importlib import metadata

from workloads import STEPS, on_asyncio, on_planlang, on_py_trees, on_trio

from planlang.kernel.runner import YOUNG

Work = Callable[[int], float]
NAMES = ("spawn", "order", "evaporate", "fluent", "step", "nest")
LIBRARIES = {"planlang": on_planlang, "asyncio": on_asyncio, "trio": on_trio, "py_trees": on_py_trees}
WORK: dict[str, dict[str, Work]] = {
    name: {library: getattr(there, name) for library, there in LIBRARIES.items() if hasattr(there, name)}
    for name in NAMES
}
for traced in ("spawn", "order", "nest"):
    WORK[traced]["planlang kept"] = on_planlang.kept(getattr(on_planlang, traced))
    WORK[traced]["planlang written"] = on_planlang.written(getattr(on_planlang, traced))
COLUMNS = ("planlang", "planlang kept", "planlang written", "asyncio", "trio", "py_trees")
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
    ("1,000 nested par", "nest", 1_000, 9, "level"),
    ("10,000 nested par", "nest", 10_000, 5, "level"),
]


def measure(quick: bool) -> dict[str, dict[str, float]]:
    """Microseconds per unit of each row and library: medians of interleaved repetitions."""
    found: dict[str, dict[str, float]] = {}
    for row, work, size, repetitions, _ in TABLE:
        samples: dict[str, list[float]] = {library: [] for library in WORK[work]}
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


def told(depth: int) -> float:
    """Bytes of the trace for a level of nested par."""
    return on_planlang.into_file(on_planlang.nest, depth)[1] / depth


def bounds(found: dict[str, dict[str, float]]) -> list[tuple[str, float, float]]:
    """Return what was promised, what was measured, and the bound."""
    task = found["spawn and join 10,000 branches"]
    order = found["partial_order of 1,000 steps, 2 orderings each"]
    small = found["spawn and join 1,000 branches"]
    large = found["spawn and join 100,000 branches"]
    shallow, deep = found["1,000 nested par"], found["10,000 nested par"]
    few, many = found["evaporating 1,000 sleepers"], found["evaporating 10,000 sleepers"]
    return [
        ("spawn and join of 10,000 branches / asyncio.TaskGroup", task["planlang"] / task["asyncio"], 0.9),
        ("the same with the trace kept in memory", task["planlang kept"] / task["asyncio"], 1.4),
        ("the same with each line of the trace written through", task["planlang written"] / task["asyncio"], 1.4),
        ("a branch among 100,000 / among 1,000", large["planlang"] / small["planlang"], 1.3),
        ("a step of partial_order / asyncio's task", order["planlang"] / small["asyncio"], 4 / 3.5),
        ("world step with one sleeping task [µs]", found["world step, 1 sleeping task"]["planlang"], 1.0),
        ("evaporating one of 10,000 / one of 1,000", many["planlang"] / few["planlang"], 1.5),
        ("a level of 10,000 nested par / of 1,000", deep["planlang"] / shallow["planlang"], 1.5),
        ("the same with the trace written", deep["planlang written"] / shallow["planlang written"], 1.5),
        ("bytes of trace for a level of 10,000 nested par / of 1,000", told(10_000) / told(1_000), 1.1),
    ]


def table(found: dict[str, dict[str, float]]) -> list[list[str]]:
    """Rows of text: microseconds for planlang, ratios to it for the others (above 1: slower than planlang)."""
    rows = [["work", "planlang", "trace kept", "trace written", "asyncio", "trio", "py_trees"]]
    for row, *_, unit in TABLE:
        numbers = found[row]
        own = numbers["planlang"]
        cells = [f"x {numbers[one] / own:.1f}" if one in numbers else "-" for one in COLUMNS[1:]]
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
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("trio", "py_trees"))
    print(f"Python {platform.python_version()} on {platform.machine()}, asyncio of it, {versions}\n")
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
    main()
