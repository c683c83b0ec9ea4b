"""Measure what large maps cost: a run, a question and a picture, each in a process of its own.

    python -m tests.benchmarks.large_maps                    1,000 things, and 10,000 for the run
    python -m tests.benchmarks.large_maps --things 300 3000  other numbers of things
    python -m tests.benchmarks.large_maps --write DIR        only write the maps

A map is the bundled hospital room, and as many storage rooms beside it as the things need: they stand on tables, on the
boards of shelves and on the floor. Printed are CPU time (user and system), memory, and both beyond the empty room for
each thing. Exit code 1 if a bound is missed or a command fails.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from planlang.files import bundled
from planlang.records import dataclass

CLASSES = (
    ("DrinkingBottle", 0.065, 0.2),
    ("Cup", 0.07, 0.09),
    ("DinnerPlate", 0.2, 0.025),
    ("Box-Container", 0.12, 0.1),
    ("Bowl-Eating", 0.14, 0.06),
    ("BookCopy", 0.15, 0.03),
)
"""Classes of things, their widths and heights [m]."""
COMMANDS = {
    "run": ("run", "serve_a_drink", "--quiet", "--environment"),
    "locate": ("locate", "in reach of the bottle", "--robot", "amigo", "--quiet", "--environment"),
    "show": ("show", "--output", "scene.png", "--force"),
}
"""What is measured; the map is the last word."""
BOUNDS = {
    ("run", 1000): (4.0, 300),
    ("locate", 1000): (10.0, 400),
    ("show", 1000): (3.0, 400),
    ("run", 10_000): (20, 600),
}
"""Command and number of things -> CPU time [s] and memory [MB] that it may take."""


def things(count: int) -> Iterator[str]:
    """Yield the frames of so many things, and of the rooms, tables and shelves that they stand in and on."""
    number = 0
    for room in range(count):
        x, y = 7.0 + 6.0 * (room // 8), 6.0 * (room % 8)
        yield _frame(f"storage{room}", "StorageRoom", (x, y, 1.3), (5.4, 5.4, 2.6))
        for place, frame in _places(room, x, y):
            if number == count:
                return
            if frame:
                yield frame
                number += 1
            else:
                cls, width, height = CLASSES[number % len(CLASSES)]
                px, py, pz = place
                yield _frame(f"thing{number}", cls, (px, py, pz + height / 2), (width, width, height))
                number += 1


def _places(room: int, x: float, y: float) -> Iterator[tuple[tuple[float, float, float], str]]:
    """Yield places for things in a storage room, with the frame of the furniture before the places on it."""
    nowhere = (0.0, 0.0, 0.0)
    for number in range(4):
        left, front = x - 1.8 + 1.2 * number, y - 2.3
        yield nowhere, _frame(f"table{room}_{number}", "Table-PieceOfFurniture", (left, front, 0.37), (1.0, 0.7, 0.74))
        yield from (((left - 0.36 + 0.24 * k, front - 0.2 + 0.2 * row, 0.74), "") for k in range(4) for row in range(3))
        back, boards = y + 2.4, "0.1 0.5 0.9 1.3"
        more = f', knowrob:heading -90, knowrob:boardHeights "{boards}"'
        yield nowhere, _frame(f"shelf{room}_{number}", "Shelves", (left, back, 0.9), (0.4, 1.0, 1.8), more)
        yield from (
            ((left - 0.36 + 0.24 * k, back - 0.05, float(board)), "") for board in boards.split() for k in range(4)
        )
    yield from (((x - 2.2 + 0.4 * k, y - 0.8 + 0.5 * row, 0.0), "") for k in range(6) for row in range(2))


def _frame(name: str, cls: str, place: tuple[float, ...], size: tuple[float, ...], more: str = "") -> str:
    numbers = [" ".join(f"{value:.3f}" for value in values) for values in (place, size)]
    return (
        f"Individual: {name}\n    Types: knowrob:{cls}\n"
        f'    Facts: knowrob:translation "{numbers[0]}", knowrob:boundingBoxSize "{numbers[1]}"{more}\n'
    )


def write_map(path: Path, count: int) -> None:
    """Write the map with so many things beside those of the hospital room."""
    room = (bundled("ontologies") / "environments" / "hospital_room.omn").read_text(encoding="utf-8")
    path.write_text("\n".join([room, *things(count)]), encoding="utf-8")


@dataclass(frozen=True, slots=True)
class Cost:
    """What a command took: CPU time [s], memory [MB], and its exit code."""

    cpu: float
    memory: float
    code: int


def cost(words: tuple[str, ...], folder: Path, *, cold: bool = False) -> Cost:
    """Run a command in a process of its own; ``cold``: with an empty cache folder."""
    with tempfile.TemporaryDirectory() as fresh:
        settings = os.environ | ({"XDG_CACHE_HOME": fresh} if cold else {})
        command = [sys.executable, "-m", "executive", *words]
        process = subprocess.Popen(command, cwd=folder, env=settings, stdout=subprocess.DEVNULL)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    return Cost(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, process.returncode)


def main() -> int:
    """Measure and print the table."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--things", type=int, nargs="*", help="numbers of things (default: 1,000; 10,000 for the run)")
    options.add_argument("--commands", nargs="*", choices=COMMANDS, help="commands (default: all)")
    options.add_argument("--write", type=Path, metavar="DIR", help="only write the maps to this folder")
    given = options.parse_args()
    counts = given.things or sorted({count for _, count in BOUNDS})
    if given.write is not None:
        given.write.mkdir(parents=True, exist_ok=True)
        for count in (0, *counts):
            write_map(given.write / f"things_{count}.omn", count)
        return 0
    missed = False
    print("| command | things | CPU time | memory | a thing | bound | |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for count in (0, *counts):
            write_map(folder / f"things_{count}.omn", count)
        for command in given.commands or COMMANDS:
            words = COMMANDS[command]

            def of(count: int, words: tuple[str, ...] = words, *, cold: bool = False) -> Cost:
                return cost((*words, f"things_{count}.omn"), folder, cold=cold)

            empty = of(0), of(0)
            for count in counts:
                bound = BOUNDS.get((command, count))
                if given.things is None and bound is None:
                    continue
                took = of(count, cold=count >= 10_000)
                cpu, memory = bound or (float("inf"), float("inf"))
                is_missed = took.cpu > cpu or took.memory > memory or took.code != 0
                missed = missed or is_missed
                each = (took.cpu - empty[1].cpu) / count * 1000, (took.memory - empty[1].memory) / count * 1000
                print(
                    f"| {command} | {count:,} | {took.cpu:.2f} s | {took.memory:.0f} MB | "
                    f"{each[0]:.2f} ms, {each[1]:.0f} kB | {cpu:g} s, {memory:g} MB | "
                    f"{'missed' if is_missed else ''} |",
                    flush=True,
                )
    return int(missed)


if __name__ == "__main__":
    raise SystemExit(main())
