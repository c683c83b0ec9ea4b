"""Count successes whose goal is false in worlds whose doors, drawers, devices and things are not as the map says.

    python -m tests.benchmarks.displaced                      60 worlds, three robots in turn
    python -m tests.benchmarks.displaced --seed 7 --worlds 300 --tasks close,turn_on --robots panda

``--seed`` draws other homes and other displacements, which are those of ``planlang run --seed``. A goal is judged in
the simulator's truth. A plan that is done although its goal does not hold is a false success, for which the exit code
is 1.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from executive.processes.workers import Limits
from executive.sweeps import Row
from executive.sweeps import run as sweep
from tests.benchmarks.homes import closed_tasks, goals, open_tasks
from tests.benchmarks.homes.closed import Closed, chest, cupboard, refrigerator
from tests.benchmarks.homes.furnishing import Home, NoRoom
from tests.benchmarks.homes.robots import OPTIONS
from tests.benchmarks.homes.tasks import REDRAWN, Need, Task, some_table, step, task_of
from tests.benchmarks.homes.trial import Trial, write
from tests.support.scenarios import Goal, Scenario, judged
from tests.support.scenarios.drinks import held
from tests.support.scenarios.fridge import fetched

JOB = "tests.benchmarks.displaced:job"
LIMITS = Limits(seconds=400, memory=3_000_000_000, wall=1200.0)
ROBOTS = ("amigo", "pr2", "panda")
SPREAD = 10_000
"""Distance between the worlds of two seeds."""


def _furniture(home: Home) -> Closed:
    """Put furniture with doors or drawers somewhere."""
    kind = home.one_of(("base", "tall", "wall", "two doors", "drawers", "refrigerator"))
    if kind == "drawers":
        return chest(home)
    if kind == "refrigerator":
        return refrigerator(home)
    return cupboard(home, "base", doors=2) if kind == "two doors" else cupboard(home, kind)


def close(home: Home) -> Task:
    """Close furniture."""
    home.room("Kitchen")
    closed = _furniture(home)
    home.clutter(closed.leaves[0], 2)
    steps = (step("ClosingAContainerArtifact", what=closed.name),)
    needs = [Need("close", leaf, closed.name) for leaf in closed.leaves]
    return task_of(home, "close", steps, goals.shut(*closed.leaves), [], needs)


def open_leaf(home: Home) -> Task:
    """Open a door or drawer."""
    home.room("Kitchen")
    closed = _furniture(home)
    leaf = home.one_of(closed.leaves)
    steps = (step("OpeningAContainerArtifact", what=leaf),)
    return task_of(home, "open", steps, goals.open_by(leaf, 0.5), [], [Need("open", leaf, closed.name)])


def close_leaf(home: Home) -> Task:
    """Close a door or drawer beside others."""
    home.room("Kitchen")
    closed = _furniture(home)
    leaf = home.one_of(closed.leaves)
    steps = (step("ClosingAContainerArtifact", what=leaf),)
    return task_of(home, "close_leaf", steps, goals.shut(leaf), [], [Need("close", leaf, closed.name)])


def _switched(home: Home, verb: str, *, on: bool) -> Task:
    home.room("Kitchen")
    device, button = home.device(home.one_of(("coffee_machine", "toaster", "lamp", "microwave")), some_table(home))
    if home.chance(0.5):
        open_tasks.is_on(home, device)
    steps = (step(verb, what=device),)
    return task_of(home, verb, steps, goals.switched(device, on=on), [], [Need("press", button)])


def turn_on(home: Home) -> Task:
    """Turn a device on, which is on or off in the map."""
    return _switched(home, "TurningOnPoweredDevice", on=True)


def turn_off(home: Home) -> Task:
    """Turn a device off, which is on or off in the map."""
    return _switched(home, "TurningOffPoweredDevice", on=False)


DRAWN: dict[str, Callable[[Home], Task]] = {
    "close": close,
    "close_leaf": close_leaf,
    "open": open_leaf,
    "turn_on": turn_on,
    "turn_off": turn_off,
    "milk": closed_tasks.milk_from_refrigerator,
    "out_of_drawer": closed_tasks.out_of_drawer,
    "put_away": closed_tasks.put_away_behind_door,
}
"""Task -> what draws its home."""
BUNDLED: dict[str, tuple[tuple[str, ...], Goal]] = {
    "serve": (("serve_a_drink", "--environment", "hospital_room"), held("bottle1", "patient1")),
    "fetch": (("fetch_from_cabinet", "--environment", "kitchenette"), fetched("bottle1", "cabinet_door1")),
}
"""Task -> arguments of planlang run, and the goal."""
TASKS = (*DRAWN, *BUNDLED)


def drawn(name: str, seed: int) -> Task:
    """Return the task that a seed draws; homes that are too full are drawn anew. Raises NoRoom."""
    for again in range(REDRAWN):
        try:
            return DRAWN[name](Home(np.random.default_rng([seed, TASKS.index(name), again])))
        except NoRoom:
            continue
    raise NoRoom(f"{name} {seed}: {REDRAWN} homes are too full")


def job(world: Mapping[str, Any]) -> Row:
    """Do the task of a world; return its row."""
    name, seed = world["task"], world["seed"]
    more = ("--robot", world["robot"], *OPTIONS.get(world["robot"], ()))
    if name in BUNDLED:
        arguments, goal = BUNDLED[name]
        found = judged(Scenario(name, (*arguments, *more), goal), seed)
        return _row(found.result.outcome.value, found.unmet, found.result.failures, found.result.message)
    task = drawn(name, seed)
    trial = Trial(task)
    with TemporaryDirectory() as folder, chdir(folder):
        recipe, home = write(task, seed, Path(folder))
        arguments = (str(recipe), *more, "--environment", str(home))
        ended = trial.judged(arguments, seed)
    unmet = [one for one in ended.get("unmet", ()) if one not in ended.get("harm", ())]
    return _row(ended["outcome"], unmet, ended.get("failure", ()), ended.get("message", ended.get("cause", "")))


def _row(outcome: str, unmet: Sequence[str], failure: Sequence[str], message: str) -> Row:
    return {"outcome": outcome, "unmet": list(unmet), "failure": list(failure), "message": message[:2000]}


def is_false(row: Row) -> bool:
    """Return whether a plan was done although its goal does not hold."""
    return bool(row["outcome"] == "done" and row.get("unmet"))


def told(rows: Sequence[Row]) -> str:
    """Return a line for each world, then counts by task and robot, and causes."""
    lines, groups = list[str](), defaultdict[str, list[Row]](list)
    for row in rows:
        _, task, robot = row["world"].split()
        groups[task].append(row)
        groups[robot].append(row)
        ending = "FALSE SUCCESS" if is_false(row) else row["outcome"]
        said = "; ".join(row.get("unmet") or ()) if is_false(row) else " < ".join(row.get("failure") or ())
        lines.append(f"{row['world']:26} {ending:14} {said}".rstrip())
    for name, group in groups.items():
        done = sum(row["outcome"] == "done" for row in group)
        lines.append(f"{name}: {done} of {len(group)} done, {sum(map(is_false, group))} false successes")
    causes = Counter(" < ".join(row.get("failure") or [row["outcome"]]) for row in rows if row["outcome"] != "done")
    lines += [f"  {number} {cause}" for cause, number in causes.most_common()]
    lines.append(f"false successes: {sum(map(is_false, rows))} of {len(rows)} worlds")
    return "\n".join(lines)


def main(words: Sequence[str] | None = None) -> int:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--worlds", type=int, default=60, help="how many (default: 60)")
    parser.add_argument("--seed", type=int, default=1, help="other homes and displacements (default: 1)")
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--tasks", default=",".join(TASKS))
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    parser.add_argument("--out", type=Path, help="a file of rows, which is gone on with")
    given = parser.parse_args(words)
    robots, tasks = given.robots.split(","), given.tasks.split(",")
    worlds = []
    for number in range(given.worlds):
        robot, task = robots[number % len(robots)], tasks[number // len(robots) % len(tasks)]
        seed = SPREAD * given.seed + number
        worlds.append({"world": f"{seed} {task} {robot}", "task": task, "robot": robot, "seed": seed})
    rows = sweep(worlds, JOB, processes=given.jobs, limits=LIMITS, out=given.out)
    print(told(rows))
    return int(any(map(is_false, rows)))


if __name__ == "__main__":
    sys.exit(main())
