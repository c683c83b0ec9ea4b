"""Measure what states cost: a copy with one change, a question about a hypothesis, first and again.

    python -m tests.benchmarks.states                        figures of this checkout
    python -m tests.benchmarks.states --checkout ../main     and how long first questions take there, in turns
    python -m tests.benchmarks.states --rooms 10             fewer rooms than 30

Times are CPU time. A map of 10,000 things is measured by tests.benchmarks.large_maps. Exit code 1 if a bound is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.robots import Robot
from planlang.failures import PlanFailure
from planlang.geometry import Pose
from planlang.protocols import Configuration
from tests.support.locations.rooms import Room, asked, rooms
from tests.support.locations.stage import Stage, robot_of
from tests.support.scenarios import TOP

KINDS = ("normal", "hard", "cluttered floor")
"""Kinds of rooms that are asked about, as many of each."""
THINGS = 1000
"""Number of things in the state that is copied."""
TURNS = 3
"""Runs of each checkout, in turns; the shortest counts."""
COPIED, AGAIN, COLD = 20.0, 0.1, 1.1
"""Bounds: time of a copy [us], of a second question and of first ones in two checkouts, as shares."""


def copying() -> float:
    """Measure a copy of a state with one thing elsewhere [us]."""
    from planlang.state import WorldState  # a checkout to compare with may be too old to have it

    poses = {f"thing{number}": Pose((0.1 * number, 0.0, 0.0)) for number in range(THINGS)}
    state, moved = WorldState({"robot": Configuration((0.0, 0.0, 0.0), {})}, poses), {"thing7": Pose((0.0, 1.0, 0.0))}
    times = []
    for _ in range(20):
        began = time.perf_counter()
        for _ in range(100):
            state.placed(moved)
        times.append((time.perf_counter() - began) / 100)
    return 1e6 * min(times)


def first_asked(several: Sequence[Room], robot: Robot) -> float:
    """Measure the first question about each room, with reachability maps loaded [s]."""
    total = 0.0
    for number, one in enumerate((several[0], *several)):
        stage = Stage(one, robot)
        took = stage.ask(asked(one)).seconds
        total += took if number else 0.0
        stage.close()
    return total


def asked_twice(several: Sequence[Room], robot: Robot) -> tuple[float, float]:
    """Measure a question about a hypothesis, and the same one about an equal hypothesis made anew, in all rooms [s]."""
    total = [0.0, 0.0]
    for one in several:
        stage = Stage(one, robot)
        stage.platform.observe()
        state, location = stage.platform.belief.state, asked(one)
        target = state.poses["bottle"]
        x, y, z = target.position
        for number in range(2):
            began = time.process_time()
            supposed = state.placed({"bottle": replace(target, position=(x + 0.02, y, z))})
            with suppress(PlanFailure):  # an answer as well: there is no such place
                next(stage.platform.resolver.when(supposed).bases(location))
            total[number] += time.process_time() - began
        stage.close()
    return total[0], total[1]


def elsewhere(checkout: Path, number: int) -> float:
    """Measure the first questions with the code of a checkout, in a process of its own [s]."""
    environment = {**os.environ, "PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1"}
    words = [sys.executable, "-P", __file__, "--rooms", str(number), "--cold"]
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    measured: Mapping[str, Any] = json.loads(done.stdout)
    return float(measured["cold"])


def main() -> int:
    """Measure and print the figures."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--rooms", type=int, default=30, help="number of rooms (default: 30)")
    options.add_argument("--checkout", type=Path, help="compare first questions with those of this checkout")
    options.add_argument("--cold", action="store_true", help="print only the time of first questions, as JSON")
    given = options.parse_args()
    several, robot = [one for kind in KINDS for one in rooms(kind, given.rooms // len(KINDS))], robot_of("amigo")
    if given.cold:
        print(json.dumps({"cold": first_asked(several, robot)}))
        return 0
    copied = copying()
    first, again = asked_twice(several, robot)
    missed = copied > COPIED or again > AGAIN * first
    print(f"a state of {THINGS:,} things copied with one change: {copied:.1f} us (at most {COPIED:g})")
    print(f"a hypothesis in {len(several)} rooms: {first:.2f} s, again {again / first:.4f} of it (at most {AGAIN:g})")
    if given.checkout is not None:
        turns = [(elsewhere(given.checkout.resolve(), given.rooms), elsewhere(TOP, given.rooms)) for _ in range(TURNS)]
        before, now = (min(each) for each in zip(*turns, strict=True))
        missed = missed or now > COLD * before
        print(f"first questions: {now:.2f} s, {now / before:.2f} of {before:.2f} s there (at most {COLD:g})")
    return int(missed)


if __name__ == "__main__":
    raise SystemExit(main())
