"""Run a recipe in many worlds that are not as the map says, and count how the runs end, by cause.

    python tests/benchmarks/seeds.py                   the bundled recipe, seeds 1 to 30, two runs at a time
    python tests/benchmarks/seeds.py --real            RoboEarth's own recipe, robot and map (needs the corpus)

A seed moves the bottle on its support (up to 0.3 m, and in yaw), the bedside table and the robot's start; never the
map. A run is counted as served when the simulator's truth says so, whatever the plan believes. The exit code is 0 when
no run hung and none ended with an internal error.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

PLANLANG = (sys.executable, "-m", "executive")
CORPUS = Path(__file__).resolve().parents[3] / "shared" / "corpus"
LONGEST = 300
"""Seconds of wall clock after which a run counts as a hang."""


@dataclass(frozen=True)
class Case:
    """A command to run, and the line of the final state that says that it worked."""

    arguments: tuple[str, ...]
    served: str


BUNDLED = Case(("serve_a_drink",), r"^bottle1: held by patient")
REAL = Case(
    (
        str(CORPUS / "recipes" / "serve_drink@knowrob_hydro_2014-11.owl"),
        "--robot",
        str(CORPUS / "robots" / "amigo@hydro.owl"),
        "--environment",
        str(CORPUS / "environments" / "map_hospital_room@re_stack.owl.in"),
    ),
    r"^bottle1: .*\bon bed1\b",
)


@dataclass(frozen=True)
class Ending:
    """The ending of one run."""

    seed: int
    outcome: str
    """served, not served, failed, missing capability, bad input, internal error, hang."""
    cause: str
    plan_seconds: float | None
    wall_seconds: float
    tilt: float = 0.0
    """The largest of what was carried [degrees]."""


def run(case: Case, seed: int) -> Ending:
    """Run one seed in a process of its own."""
    began = time.perf_counter()
    command = [*PLANLANG, "run", *case.arguments, "--seed", str(seed), "--json"]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired:
        return Ending(seed, "hang", f"no end after {LONGEST} s", None, time.perf_counter() - began)
    wall = time.perf_counter() - began
    try:
        answer = json.loads(ended.stdout)
    except json.JSONDecodeError:
        return Ending(seed, "internal error", (ended.stderr.splitlines() or ["no answer"])[-1], None, wall)
    seconds, tilt = answer.get("duration"), max(answer.get("largest_tilts", {}).values(), default=0.0)
    match ended.returncode:
        case 0 if any(re.search(case.served, line) for line in answer["final_state"]):
            return Ending(seed, "served", "", seconds, wall, tilt)
        case 0:
            return Ending(seed, "not served", "; ".join(answer["final_state"]), seconds, wall, tilt)
        case 1:
            return Ending(
                seed,
                "failed",
                " < ".join(one["class"] for one in (answer["failure"], *answer["failure"]["causes"])),
                seconds,
                wall,
                tilt,
            )
        case 2:
            return Ending(seed, "bad input", ", ".join(d["code"] for d in answer["diagnostics"]), seconds, wall)
        case 3:
            return Ending(seed, "missing capability", answer["message"], seconds, wall)
        case _:
            return Ending(seed, "internal error", str(answer.get("error", ended.stderr[-200:])), seconds, wall)


def table(endings: Sequence[Ending]) -> str:
    """Return how many runs ended how, most frequent first, with the seeds of what was not served."""
    counts = Counter((ending.outcome, ending.cause) for ending in endings)
    rows = [("runs", "outcome", "cause", "seeds")]
    for (outcome, cause), count in sorted(counts.items(), key=lambda item: (item[0][0] != "served", -item[1], item[0])):
        seeds = [e.seed for e in endings if (e.outcome, e.cause) == (outcome, cause)] if outcome != "served" else []
        rows.append((str(count), outcome, cause, " ".join(map(str, seeds))))
    widths = [max(len(row[column]) for row in rows) for column in range(4)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def main() -> int:
    """Run all seeds and print the table."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    options.add_argument("--seeds", type=int, default=30, help="how many, from 1 (default: 30)")
    options.add_argument("--jobs", type=int, default=2, help="processes at a time (default: 2)")
    options.add_argument("--real", action="store_true", help="RoboEarth's recipe, robot and map")
    chosen = options.parse_args()
    case = REAL if chosen.real else BUNDLED
    if chosen.real and not CORPUS.is_dir():
        print("the corpus of real OWL files is not beside this checkout", file=sys.stderr)
        return 2
    with ThreadPoolExecutor(chosen.jobs) as pool:
        endings = list(pool.map(lambda seed: run(case, seed), range(1, chosen.seeds + 1)))
    print(table(endings))
    served = sum(ending.outcome == "served" for ending in endings)
    print(f"\n{served} of {len(endings)} served")
    walls = [ending.wall_seconds for ending in endings]
    print(f"wall clock of a run: median {statistics.median(walls):.1f} s, longest {max(walls):.1f} s")
    print(f"largest tilt of what was carried: {max(ending.tilt for ending in endings):.1f} degrees")
    times = [
        ending.plan_seconds for ending in endings if ending.outcome == "served" and ending.plan_seconds is not None
    ]
    if times:
        print(f"plan time of a served run: median {statistics.median(times):.1f} s, longest {max(times):.1f} s")
    return int(any(ending.outcome in ("hang", "internal error", "bad input") for ending in endings))


if __name__ == "__main__":
    sys.exit(main())
