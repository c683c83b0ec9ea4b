"""Count the drinks that are served although one hand of the robot is dead: the other has to take over.

    python -m tests.benchmarks.dead_hand                     either hand of AMIGO dead, 6 worlds each
    python -m tests.benchmarks.dead_hand --how failed --first 10 --runs 3
    python -m tests.benchmarks.dead_hand --robots pr2 --jobs 2

The fingers of a dead hand never move. ``--how`` says what the robot reports: that the fingers are ``blocked`` (by
nothing that it feels), or that the motion ``failed``; or the process module itself raises each time (``raised``).
A drink is served when the plan says so and the patient has it in the simulator's truth. Exit code 1 if a drink is not.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from executive.processes.workers import Limits
from executive.runs.options import Outcome, RunOptions
from executive.sweeps import Row
from executive.sweeps import run as sweep
from tests.support.dead_hands import RAISED, REPORTS, kill
from tests.support.scenarios import Scenario, judged_run, parsed
from tests.support.scenarios.drinks import held

JOB = "tests.benchmarks.dead_hand:job"
LIMITS = Limits(seconds=300, memory=3_000_000_000, wall=900.0)
SIDES = ("right", "left")


def job(world: Mapping[str, Any]) -> Row:
    """Serve a drink with a dead hand; return the row."""
    words = ("serve_a_drink", "--environment", "hospital_room", "--robot", world["robot"], "--seed", str(world["seed"]))
    options = RunOptions.of(parsed([*words, "--json"]))
    options = replace(options, around=partial(kill, side=world["side"], how=world["how"]))
    ended = judged_run(Scenario("dead hand", words, held("bottle1", "patient1")), options)
    return {
        "outcome": ended.result.outcome.value,
        "reached": ended.reached,
        "false": ended.result.outcome is Outcome.DONE and not ended.reached,
        "failure": list(ended.result.failures),
        "message": ended.result.message[:2000],
    }


def told(rows: Sequence[Row]) -> str:
    """Return how many were served, by robot and side, and how the others ended."""
    lines, groups = list[str](), dict[str, list[Row]]()
    for row in rows:
        groups.setdefault(row["world"].rpartition(" ")[0], []).append(row)
    for name, group in groups.items():
        lines.append(f"{name} hand dead: {sum(map(is_served, group))} of {len(group)} served")
        lines += [f"  {row['world']}: {row.get('message') or row['outcome']}" for row in group if not is_served(row)]
    return "\n".join(lines)


def is_served(row: Row) -> bool:
    """Return whether plan and truth say that the drink was served."""
    return bool(row.get("reached"))


def main(words: Sequence[str] | None = None) -> int:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--how", choices=(*REPORTS, RAISED), default="blocked", help="what is reported")
    parser.add_argument("--robots", default="amigo")
    parser.add_argument("--runs", type=int, default=6, help="with each hand of each robot (default: 6)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (default: 0)")
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    parser.add_argument("--out", type=Path, help="a file of rows, which is gone on with")
    given = parser.parse_args(words)
    worlds = [
        {"world": f"{robot}, {side} {seed}", "robot": robot, "side": side, "seed": seed, "how": given.how}
        for robot in given.robots.split(",")
        for side in SIDES
        for seed in range(given.first, given.first + given.runs)
    ]
    rows = sweep(worlds, JOB, processes=given.jobs, limits=LIMITS, out=given.out)
    print(told(rows))
    return int(not all(map(is_served, rows)))


if __name__ == "__main__":
    sys.exit(main())
