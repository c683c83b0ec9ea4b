"""Run scenarios and print which of them reach their goal in the simulator's truth.

    python tests/benchmarks/goals.py                            every scenario once, without displacements
    python tests/benchmarks/goals.py serve_a_drink --seeds 30   one of them in worlds that differ from the map

A name means all scenarios that contain it. The exit code is 0 when all reached their goal.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from planlang.diagnostics import BadInput
from tests.support.scenarios import Judged, Scenario, judged, scenarios


def row(scenario: Scenario, seed: int) -> tuple[bool, str]:
    """Run one scenario; return whether its goal is reached, and a row of the table."""
    began = time.perf_counter()
    try:
        found = judged(scenario, seed)
    except BadInput as problem:
        return False, f"| {scenario.name} | {seed} | refused: {problem.diagnostics[0].message} | | |"
    wall = time.perf_counter() - began
    return found.reached, f"| {scenario.name} | {seed} | {_said(found)} | {found.result.duration:.0f} | {wall:.1f} |"


def _said(found: Judged) -> str:
    if found.reached:
        worst = max(found.tilts.items(), key=lambda item: item[1], default=None)
        return "reached" if worst is None else f"reached, {worst[0]} tilted by {math.degrees(worst[1]):.0f} degrees"
    failure = " < ".join(found.result.failures)
    return "; ".join(one for one in (failure, *found.unmet) if one)


def main() -> int:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="parts of names of scenarios; default: all")
    parser.add_argument("--seeds", type=int, default=0, help="run seeds 1 to N instead of 0")
    parser.add_argument("--commands", action="store_true", help="print the commands instead of running them")
    options = parser.parse_args()
    chosen = [one for one in scenarios().values() if not options.names or any(n in one.name for n in options.names)]
    if options.commands:
        print("\n".join(one.command for one in chosen))
        return 0
    print("| scenario | seed | goal | plan time [s] | wall clock [s] |\n|---|---|---|---|---|")
    good = total = 0
    for scenario in chosen:
        for seed in range(1, options.seeds + 1) if options.seeds else (0,):
            reached, text = row(scenario, seed)
            good, total = good + reached, total + 1
            print(text, flush=True)
    print(f"\n{good} of {total} reached their goal")
    return int(good < total)


if __name__ == "__main__":
    sys.exit(main())
