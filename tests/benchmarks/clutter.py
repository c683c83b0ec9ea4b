"""Measure what a crowded map costs: ``serve_a_drink`` with ever more things in the room, in CPU time of own processes.

    python -m tests.benchmarks.clutter             0, 100, 500 and 2,000 more things
    python -m tests.benchmarks.clutter --runs 3    the least of three runs each (default: 2)

The things are bottles of 6 cm in a stack at the wall of the bundled hospital room, which the robot neither handles nor
passes. Exit code 1 if a bound is missed, or a drink not served.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from planlang.files import bundled

BOUNDS = {0: 1.0, 100: 1.5, 500: 2.0, 2000: 5.0}
"""More things -> how many times longer than in the empty room a run may take."""
WIDE, DEEP = 40, 3
"""Things side by side along the wall and away from it; more stand upon each other."""


def crowded(things: int) -> str:
    """The text of the bundled map with so many more things."""
    text = [(bundled("ontologies") / "environments" / "hospital_room.omn").read_text()]
    for number in range(things):
        level, place = divmod(number, WIDE * DEEP)
        x, y, z = -1.4 + 0.08 * (place % WIDE), 2.15 + 0.1 * (place // WIDE), 0.05 + 0.1 * level
        entries = {"m00": 1.0, "m11": 1.0, "m22": 1.0, "m03": x, "m13": y, "m23": z}
        matrix = (f"knowrob:m{i}{j} {entries.get(f'm{i}{j}', 0.0):.3f}" for i in range(3) for j in range(4))
        text.append(
            f"Individual: more{number}\n    Types: knowrob:DrinkingBottle\n    Facts: knowrob:depthOfObject 0.06,\n"
            "        knowrob:widthOfObject 0.06, knowrob:heightOfObject 0.1\n"
            f"Individual: pose{number}\n    Types: knowrob:RotationMatrix3D\n    Facts: {', '.join(matrix)}\n"
            f"Individual: seen{number}\n    Types: knowrob:SemanticMapPerception\n"
            f"    Facts: knowrob:objectActedOn more{number}, knowrob:eventOccursAt pose{number}\n"
        )
    return "\n".join(text)


def seconds(environment: Path) -> float:
    """CPU time of a run in an environment [s]; inf if the drink is not served."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "executive", "run", "serve_a_drink", "--environment", str(environment)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    served = ended.returncode == 0 and "bottle1: held by patient1" in ended.stdout
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime if served else float("inf")


def main() -> int:
    """Measure and print the table."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--runs", type=int, default=2, help="runs of each, of which the fastest counts (default: 2)")
    runs, empty, missed = options.parse_args().runs, 0.0, False
    print("| more things | CPU time | x empty room | bound |        |\n|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for things, bound in BOUNDS.items():
            environment = Path(folder) / f"with_{things}.omn"
            environment.write_text(crowded(things))
            took = min(seconds(environment) for _ in range(runs))
            empty = empty or took
            is_missed = took > bound * empty
            missed = missed or is_missed
            print(f"| {things:,} | {took:.2f} s | {took / empty:.2f} | {bound:g} | {'missed' if is_missed else ''} |")
    return int(missed)


if __name__ == "__main__":
    raise SystemExit(main())
