"""Count the runs that are still served when some requests to process modules fail.

    python -m tests.benchmarks.faults                            one request in five fails, 10 seeds of each scenario
    python -m tests.benchmarks.faults --rate 0.05 --runs 30 --robots pr2 --jobs 2
    python -m tests.benchmarks.faults --scripted 100             scripted runs of bundled recipes, in virtual time

Which requests fail is drawn by the seed, those of recoveries among them; with which failure, too, by the class of the
action (tests/support/random_faults.py). A run is served when its plan says so and its goal holds in the simulator's
truth; a plan that says so without is a false success, for which the exit code is 1. So it is if fewer are served than
``--least`` asks for.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.processes.workers import Limits
from executive.runs.assembly import RobotExecutive
from executive.runs.options import Outcome, RunOptions
from executive.sweeps import Row
from executive.sweeps import run as sweep
from planlang.proportions import wilson
from planlang.testing import compiled
from planlang.testing.running import attempt
from planlang.testing.script import Script
from planlang.testing.scripted import ScriptedExecutive
from tests.support.random_faults import FailingModule, RandomFaults
from tests.support.scenarios import Scenario, judged_run, parsed
from tests.support.scenarios.drinks import held
from tests.support.scenarios.fridge import fetched

JOB = "tests.benchmarks.faults:job"
LIMITS = Limits(seconds=300, memory=3_000_000_000, wall=900.0)
ROBOTS = {"amigo": (), "pr2": (), "panda": ("--trust-map",)}
"""Robot -> further arguments: Panda has no camera."""
TASKS = {
    "serve": (("serve_a_drink", "--environment", "hospital_room"), held("bottle1", "patient1")),
    "pass": (("pass_a_drink", "--environment", "dining_room"), held("bottle1", "guest1")),
    "fetch": (("fetch_from_cabinet", "--environment", "kitchenette"), fetched("bottle1", "cabinet_door1")),
}
"""Task -> arguments of planlang run, and the goal."""

LEFT_OUT = frozenset({("fetch", "panda")})
"""What is not done without faults either: the only hand is full when the door is to be closed."""


def job(world: Mapping[str, Any]) -> Row:
    """Run a task with faults; return its row."""
    arguments, goal = TASKS[world["task"]]
    words = (*arguments, "--robot", world["robot"], *ROBOTS[world["robot"]])
    scenario, found = Scenario(world["task"], words, goal), list[RandomFaults]()

    def around(executive: RobotExecutive) -> None:
        found.append(RandomFaults(world["seed"], world["rate"], executive.ancestors))
        executive.modules = tuple(FailingModule(module, found[0]) for module in executive.modules)

    ended = judged_run(scenario, replace(RunOptions.of(parsed([*words, "--json"])), around=around))
    done = ended.result.outcome is Outcome.DONE
    return {
        "outcome": ended.result.outcome.value,
        "reached": ended.reached,
        "false": done and not ended.reached,
        "unmet": list(ended.unmet),
        "failure": list(ended.result.failures),
        "message": ended.result.message[:2000],
        "requests": found[0].requests if found else 0,
        "drawn": dict(found[0].drawn) if found else {},
    }


def scripted(recipe: str, seed: int, rate: float) -> str:
    """Run a bundled recipe with a scripted robot; return the failure that ends it, nothing if there is none."""
    executive = ScriptedExecutive(Script())
    faults = RandomFaults(seed, rate, executive.ancestors)
    executive.modules = tuple(FailingModule(module, faults) for module in executive.modules)  # type: ignore[misc]
    ended = attempt(compiled(recipe), executive=executive)
    if ended.error is not None:
        raise ended.error
    return "" if ended.failure is None else " < ".join(type(link).__name__ for link in ended.failure.chain())


def share(good: int, total: int) -> str:
    """Return a share with its interval."""
    low, high = wilson(good, total)
    return f"{good} of {total} served: {good / max(total, 1):.0%} (Wilson {low:.0%} to {high:.0%})"


def told(rows: Sequence[Row]) -> str:
    """Return shares by task and robot, and causes."""
    lines, groups = list[str](), defaultdict[str, list[Row]](list)
    for row in rows:
        groups[f"{row['world'].rpartition(' ')[0]}"].append(row)
    lines += [f"{name}: {share(sum(map(is_served, group)), len(group))}" for name, group in groups.items()]
    lines.append(f"all: {share(sum(map(is_served, rows)), len(rows))}")
    causes = Counter(
        " < ".join(row.get("failure") or row.get("unmet") or [row["outcome"]]) for row in rows if not is_served(row)
    )
    lines += [f"  {number} {cause}" for cause, number in causes.most_common()]
    drawn = sum((Counter(row.get("drawn", {})) for row in rows), Counter[str]())
    lines.append(f"failures by chance: {', '.join(f'{name} {number}' for name, number in drawn.most_common())}")
    lines += [f"FALSE SUCCESS: {row['world']}: {'; '.join(row['unmet'])}" for row in rows if row.get("false")]
    return "\n".join(lines)


def is_served(row: Row) -> bool:
    """Return whether plan and truth say that the task was done."""
    return bool(row.get("reached"))


def main(words: Sequence[str] | None = None) -> int:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rate", type=float, default=0.2, help="share of requests that fail (default: 0.2)")
    parser.add_argument("--runs", type=int, default=10, help="of each task and robot (default: 10)")
    parser.add_argument("--first", type=int, default=1, help="the first seed (default: 1)")
    parser.add_argument("--robots", default=",".join(ROBOTS))
    parser.add_argument("--tasks", default=",".join(TASKS))
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    parser.add_argument("--out", type=Path, help="a file of rows, which is gone on with")
    parser.add_argument("--scripted", type=int, default=0, help="this many scripted runs of each recipe instead")
    parser.add_argument("--least", type=float, default=0.0, help="exit with 1 if a smaller share is served")
    given = parser.parse_args(words)
    seeds = range(given.first, given.first + (given.scripted or given.runs))
    if given.scripted:
        recipes = [TASKS[task][0][0] for task in given.tasks.split(",")]
        ended = [scripted(recipe, seed, given.rate) for recipe in recipes for seed in seeds]
        print(f"scripted: {share(ended.count(''), len(ended))}")
        for cause, number in Counter(filter(None, ended)).most_common():
            print(f"  {number} {cause}")
        return int(ended.count("") < given.least * len(ended))
    worlds = [
        {"world": f"{task} {robot} {seed}", "task": task, "robot": robot, "seed": seed, "rate": given.rate}
        for task in given.tasks.split(",")
        for robot in given.robots.split(",")
        if (task, robot) not in LEFT_OUT
        for seed in seeds
    ]
    rows = sweep(worlds, JOB, processes=given.jobs, limits=LIMITS, out=given.out)
    print(told(rows))
    served = sum(map(is_served, rows))
    return int(any(row.get("false") for row in rows) or served < given.least * len(rows))


if __name__ == "__main__":
    sys.exit(main())
