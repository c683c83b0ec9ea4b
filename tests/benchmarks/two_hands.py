"""Two things in two hands: how many tasks of homes drawn at random reach their goal, and what was dropped.

python -m tests.benchmarks.two_hands [--tasks 40] [--first 0] [--jobs N] [--out ROWS]

Rooms and flats of two rooms in turn, Amigo and PR2; every other task delivers the thing that was taken last first. What
was dropped, and whether both hands held something at once, is the simulator's truth.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from executive.processes.workers import Limits
from executive.sweeps import Row
from executive.sweeps import run as sweep
from executive.sweeps.records import Done
from tests.benchmarks.homes import series
from tests.benchmarks.homes.robots import named
from tests.benchmarks.homes.series import Case
from tests.benchmarks.homes.tasks import Task
from tests.benchmarks.homes.trial import Trial, arguments, task_of, write
from tests.support.scenarios import Watched

COMMAND = "python -m tests.benchmarks.two_hands"
TEMPLATES = ("two_in_two_hands", "two_hands_through_a_door")
ROBOTS = ("amigo", "pr2")
LIMITS = Limits(seconds=300, memory=3_000_000_000, wall=1500.0)
"""Of one task."""
HIGH = 0.03
"""Height above its support from which a thing that leaves the hand is dropped [m]: more than setting down needs."""


@dataclass
class Hands:
    """Watcher of what the hands hold, step by step."""

    dropped: dict[str, float] = field(default_factory=dict)
    """Thing -> height that it fell from a hand [m]."""
    most: int = 0
    """Things that were in the hands at the same time."""
    _held: frozenset[str] = frozenset()

    def __call__(self, watched: Watched) -> None:
        world = watched.world
        held = frozenset(world.attached())
        for name in self._held - held:
            if world.taken(name) is None and (height := world.height_above_support(name)) > HIGH:
                self.dropped[name] = max(round(height, 3), self.dropped.get(name, 0.0))
        self._held, self.most = held, max(self.most, len(held))


def cases(tasks: int, first: int = 0, robots: Sequence[str] = ROBOTS) -> Iterator[Case]:
    """Yield so many cases, seed by seed."""
    return islice(series.cases(range(first, first + tasks), TEMPLATES, robots, displaced=False), tasks)


def reordered(task: Task, seed: int) -> Task:
    """Return a task of two steps that take and two that bring: the last taken is brought first if its seed is odd."""
    *taking, one, other = task.steps
    first = next(step for step in (one, other) if step.facts[0] == taking[0].facts[0])
    second = other if first is one else one
    return replace(task, steps=(*taking, *((second, first) if seed % 2 else (first, second))))


def job(world: Mapping[str, Any]) -> dict[str, Any]:
    """Do the case of a world of a sweep; return its row."""
    case, hands = Case(world["template"], world["seed"], world["robot"]), Hands()
    task = reordered(task_of(case), case.seed)
    task = replace(task, watchers=(*task.watchers, hands))
    with TemporaryDirectory() as folder:
        recipe, home = write(task, case.seed, Path(folder))
        row = Trial(task).run(case, arguments(case, task, recipe, home))
    about = {"template": case.template, "seed": case.seed, "robot": case.robot}
    return about | row | {"dropped": hands.dropped, "at_once": hands.most}


def counted(rows: Sequence[Row]) -> str:
    """Return the figures of rows: reached, with both hands full at once, dropped; by robot and together."""

    def figures(some: Sequence[Row]) -> str:
        tests: tuple[Callable[[Row], object], ...] = (
            lambda row: row.get("reached"),
            lambda row: row.get("at_once", 0) > 1,
            lambda row: row.get("dropped"),
        )
        reached, both, dropped = (sum(map(bool, map(test, some))) for test in tests)
        return f"{reached} of {len(some)} reached, {both} with both hands full at once, {dropped} dropped something"

    by_robot = {robot: [row for row in rows if row["robot"] == robot] for robot in ROBOTS}
    lines = [f"{robot}: {figures(some)}" for robot, some in by_robot.items() if some]
    return "\n".join([*lines, f"together: {figures(rows)}"])


def _told(done: Done) -> None:
    row = done.row
    ended = "reached" if row.get("reached") else f"{row['outcome']}: {row.get('failure')} {row.get('unmet')}"
    print(f"{row['world']:36} {done.seconds:6.1f} s  {row.get('dropped') or ''} {ended}", flush=True)


def main(words: Sequence[str] | None = None) -> int:
    """Measure; 1 if something was dropped."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tasks", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    parser.add_argument("--out", type=Path, help="a file of rows, which is gone on with")
    given = parser.parse_args(words)
    robots = given.robots.split(",")
    for robot in robots:
        named(robot)  # it is made before several processes want it
    worlds = [
        case.world | {"repeat": f"{COMMAND} --first {case.seed} --tasks {len(TEMPLATES)} --robots {case.robot}"}
        for case in cases(given.tasks, given.first, robots)
    ]
    rows = sweep(
        worlds, "tests.benchmarks.two_hands:job", processes=given.jobs, limits=LIMITS, out=given.out, told=_told
    )
    print(counted(rows))
    return int(any(row.get("dropped") for row in rows))


if __name__ == "__main__":
    sys.exit(main())
