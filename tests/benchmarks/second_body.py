"""Serve drinks in rooms in which another robot drives to and fro: count contacts, and how often it was seen.

    python -m tests.benchmarks.second_body              20 worlds: five seeds of each of four routes
    python -m tests.benchmarks.second_body --seeds 0,7 --robot pr2 --jobs 2

In each world the recipe serve_a_drink is run. Counted are the steps in which the robots touch, the motions that the
other one stopped just before a contact, the times that it was seen elsewhere than it was believed to be, and the
motions that were planned anew because it came into the way. Exit code 1 if they touch, if it was not seen, or if a
drink is not served.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from executive.processes.workers import Limits
from executive.runs.options import RunOptions
from executive.sweeps import Row
from executive.sweeps import run as sweep
from tests.support.scenarios import Scenario, judged_run, parsed
from tests.support.scenarios.drinks import held
from tests.support.shared_rooms import PORTER, ROUTES, Encounters, shared_room

JOB = "tests.benchmarks.second_body:job"
LIMITS = Limits(seconds=600, memory=3_000_000_000, wall=1800.0)


def job(world: Mapping[str, Any]) -> Row:
    """Serve a drink beside another robot; return the row."""
    encounters = Encounters()
    with TemporaryDirectory() as folder:
        place = shared_room(Path(folder), ROUTES[world["route"]])
        words = ("serve_a_drink", "--environment", str(place), "--robot", world["robot"], "--seed", str(world["seed"]))
        scenario = Scenario("shared room", words, held("bottle1", "patient1"), (lambda seen: encounters(seen.world),))
        ended = judged_run(scenario, RunOptions.of(parsed([*words, "--json"])))
        learnt = [one for one in ended.result.trace if one["event"] == "belief" and one.get("name") == PORTER]
    seen = [one for one in learnt if one["change"] in ("seen", "found")]
    return {
        "outcome": ended.result.outcome.value,
        "reached": ended.reached,
        "contacts": encounters.contacts,
        "stopped": encounters.stopped,
        "driven": round(encounters.driven, 2),
        "seen": len(seen),
        "seconds": round(ended.result.duration, 1),
        "message": ended.result.message[:2000],
    }


def told(rows: Sequence[Row]) -> str:
    """Return a line for each world, and sums."""
    lines = [f"{'world':28} served contacts stopped seen driven seconds"]
    for row in rows:
        if "contacts" not in row:
            lines.append(f"{row['world']:28} {row.get('message') or row['outcome']}")
            continue
        served = "yes" if row["reached"] else "NO"
        figures = f"{row['contacts']:8} {row['stopped']:7} {row['seen']:4} {row['driven']:5.1f}m {row['seconds']:6.1f}s"
        lines.append(f"{row['world']:28} {served:6} {figures}")
        if not row["reached"]:
            lines.append(f"    {row['message']}")
    sums = {name: sum(row.get(name, 0) for row in rows) for name in ("reached", "contacts", "stopped", "seen")}
    lines.append(
        f"{sums['reached']} of {len(rows)} served; {sums['contacts']} steps in contact, "
        f"{sums['stopped']} motions stopped by the other robot, which was seen elsewhere {sums['seen']} times"
    )
    return "\n".join(lines)


def main(words: Sequence[str] | None = None) -> int:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--robot", default="amigo")
    parser.add_argument("--seeds", default="0,1,2,3,4", help="of each route (default: 0,1,2,3,4)")
    parser.add_argument("--routes", default=",".join(map(str, range(len(ROUTES)))))
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    parser.add_argument("--out", type=Path, help="a file of rows, which is gone on with")
    given = parser.parse_args(words)
    worlds = [
        {"world": f"route {route}, seed {seed}", "route": int(route), "seed": int(seed), "robot": given.robot}
        for route in given.routes.split(",")
        for seed in given.seeds.split(",")
    ]
    rows = sweep(worlds, JOB, processes=given.jobs, limits=LIMITS, out=given.out)
    print(told(rows))
    return int(any(row.get("contacts", 1) or not row.get("seen") or not row.get("reached") for row in rows))


if __name__ == "__main__":
    sys.exit(main())
