"""Count the doors and drawers that robots open: 50 drawn by seeds, of different sizes, sides and handles, three robots.

``python -m tests.benchmarks.doors [--rooms 50] [--robots amigo,pr2,panda]`` prints the share that is open in the true
world at the end, the computing time, and for the others the failure of the plan.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from contextlib import ExitStack

import numpy as np

from planlang.diagnostics import BadInput
from planlang.failures import PlanFailure
from tests.support.leaves import drawn, robot_of, room

ROBOTS = "amigo,pr2,panda"


def opened(robot: str, seed: int) -> tuple[bool, str, float]:
    """Return whether a robot opens the door or drawer of a seed, else why not; and the computing time [s]."""
    with ExitStack() as stack:
        stage = room(stack, drawn(seed), robot)
        began, reason = time.process_time(), ""
        try:
            stage.do("OpeningAContainerArtifact", "leaf")
        except PlanFailure as failure:
            names = dict.fromkeys(type(link).__name__ for link in failure.chain())
            reason = " because of ".join(names)
        joint = stage.platform.belief.joints["leaf"]
        return joint.is_open(stage.truth.joint("leaf")), reason, time.process_time() - began


def main() -> None:
    """Measure, and print a line for each robot and each reason."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--rooms", type=int, default=50)
    parser.add_argument("--robots", default=ROBOTS)
    given = parser.parse_args()
    for robot in given.robots.split(","):
        try:
            robot_of(robot)
        except BadInput as absent:
            print(f"{robot}: {absent}")
            continue
        results = [opened(robot, seed) for seed in range(given.rooms)]
        times = [seconds for _, _, seconds in results]
        done = sum(is_open for is_open, _, _ in results)
        middle, late = np.median(times), np.percentile(times, 95)
        print(f"{robot}: {done} of {given.rooms} opened, computing {middle:.2f} s (median), {late:.2f} s (p95)")
        for reason, number in Counter(reason for is_open, reason, _ in results if not is_open).most_common():
            print(f"  {number} {reason or 'not open at the end'}")


if __name__ == "__main__":
    main()
