"""Ask ``planlang why`` about failed runs of random homes, and follow what it answers.

    python -m tests.benchmarks.why                                 10 failed runs, two robots in turn
    python -m tests.benchmarks.why --number 60 --recall 20         all, and 20 by lot against all single changes
    python -m tests.benchmarks.why --seed 7 --displaced            in worlds that are displaced, as the map stays
    python -m tests.benchmarks.why --failed rows.jsonl             the tasks that failed in a sweep of homes

Each run, each search and each repetition is a process of its own. A proposal is true if the repetition is done. A run
is recalled if a change was found, or none of the single changes helps. Exit code 1 if a proposal is false, if less than
90 % of the runs that a single change mends are recalled, or if the median is over 8 reruns.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir
from itertools import count, islice
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from executive.processes.workers import Limits
from executive.sweeps import Row
from executive.sweeps import run as sweep
from executive.sweeps.records import Done
from tests.benchmarks.homes.furnishing import NoRoom
from tests.benchmarks.homes.series import Case
from tests.benchmarks.homes.tasks import TEMPLATES
from tests.benchmarks.homes.trial import arguments, task_of, write

JOB = "tests.benchmarks.why:job"
LIMITS = Limits(seconds=7200, memory=4_000_000_000, wall=36_000.0)
SECONDS = 1800.0
"""Longest process [s]."""
MOST = 80
"""Single changes against which a run is recalled."""
SHARE, RERUNS = 0.9, 8
"""Least share of runs recalled, and the greatest median of reruns."""
ANSWERED = ("found", "sentence", "reruns", "tried", "not_tried", "cost", "command")
"""Keys of the answer that are kept."""
SURELY = 12
"""Tasks that are run for each failed one that is wanted."""


def job(world: Mapping[str, Any]) -> Row:
    """Run the task of a world and, if it fails, ask why, and do what is proposed; return the row."""
    case = Case(world["template"], world["seed"], world["robot"], world["displaced"])
    try:
        task = task_of(case)
    except NoRoom as problem:
        return {"outcome": "not drawn", "message": str(problem)}
    with TemporaryDirectory() as name, chdir(name):
        recipe, home = write(task, case.seed, Path(name))
        words = arguments(case, task, recipe, home)
        seed = case.seed + 1 if case.displaced else 0
        first, cpu = _planlang("run", *words, "--seed", str(seed), "--trace", "run.jsonl")
        row = {"outcome": first.get("outcome", "bad input"), "message": _message(first), "cpu": cpu}
        if row["outcome"] != "failed":
            return row
        asked = ("why", "run.jsonl", *words, "--processes", "1")
        answer, spent = _planlang(*asked, "--budget", str(world["budget"]))
        row |= {
            key: answer.get(key) for key in ("found", "sentence", "reruns", "tried", "not_tried", "cost", "command")
        }
        row |= {"spent": spent, "diagnostics": [one["message"] for one in answer.get("diagnostics", ())]}
        if row["found"]:
            again, _ = _planlang(*shlex.split(answer["command"])[1:])
            row |= {"repeated": again.get("outcome"), "then": _message(again)}
        elif world["recalls"]:
            every, _ = _planlang(*asked, "--budget", str(MOST + 20))
            row |= {"missed": every.get("sentence") if every.get("found") else None, "of": every.get("tried")}
    return row


MEASURED = """
import os, resource, sys
from executive.sweeps import running
from executive.why import searching

reruns = []

def run(*arguments, told, **options):
    def counted(done):
        reruns.append(done.seconds)
        told(done)
    return running.run(*arguments, told=counted, **options)

searching.run = run
from planlang_command import main

try:
    main()
finally:
    own, children = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    spent = sum(one.ru_utime + one.ru_stime for one in (own, children)) + sum(reruns)
    sys.stderr.write(f"\\nspent {spent:.2f}")
"""
"""Runs the command, and writes how much CPU time it took with all processes [s]: what ignores the end of its children,
as the source of workers does, is not told theirs."""


def _planlang(*words: str) -> tuple[dict[str, Any], float]:
    """Run a command of planlang in a process; return its JSON, and the CPU time of all its processes [s]."""
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # a worker ignores it, and processes inherit that
    command = [sys.executable, "-c", MEASURED, *words, "--json"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
        return json.loads(done.stdout), float(done.stderr.rpartition("spent ")[2])
    except (subprocess.TimeoutExpired, ValueError) as problem:
        return {"outcome": "aborted", "message": str(problem)[:300]}, 0.01


def _message(found: Mapping[str, Any]) -> str:
    return str(found.get("message") or found.get("diagnostics") or found.get("error"))[:400]


def worlds(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the tasks that failed in a sweep, or tasks without end, robots and templates in turn."""
    if given.failed is not None:
        lines = (json.loads(line) for line in given.failed.read_text(encoding="utf-8").splitlines())
        for row in lines:
            if row.get("outcome") == "failed":
                yield _world(row["template"], row["seed"], row["robot"], bool(row.get("displaced")), given)
        return
    robots, names = given.robots.split(","), given.templates.split(",") if given.templates else [*TEMPLATES]
    for number in count():
        seed, name = given.seed + number // len(names), names[number % len(names)]
        yield _world(name, seed, robots[number % len(robots)], given.displaced, given)


def _world(template: str, seed: int, robot: str, displaced: bool, given: argparse.Namespace) -> dict[str, Any]:
    key = f"{template} {seed} {robot}{' displaced' if displaced else ''}"
    lot = int.from_bytes(hashlib.sha256(key.encode()).digest()[:4], "big") / 2**32
    told = {"template": template, "seed": seed, "robot": robot, "displaced": displaced}
    return {"world": key, **told, "budget": given.budget, "recalls": lot * given.number < given.recall}


def say(done: Done) -> None:
    """Print what became of one task."""
    row = done.row
    if "reruns" not in row:
        print(f"{row['world']:34} {row['outcome']}", flush=True)
        return
    print(f"{row['world']:34} failed ({row['cpu']} s): {str(row['message']).partition(chr(10))[0][:200]}")
    ratio = row["spent"] / row["cpu"]
    print(f"    {row['sentence']} ({row['reruns']} reruns, {ratio:.1f} times the CPU) {row['diagnostics'] or ''}")
    if row["found"]:
        print(f"    {'repeated: done' if row['repeated'] == 'done' else 'FALSE: ' + row['then']}", flush=True)
    elif "missed" in row:
        print(f"    all single changes: {row['missed'] or 'none helps'}", flush=True)


def told(rows: Sequence[Row]) -> str:
    """Return the figures."""
    asked = [row for row in rows if row.get("reruns") is not None]
    if not asked:
        return "no run failed"
    found = [row for row in asked if row["found"]]
    missed = [row for row in asked if row.get("missed")]
    ratios = [row["spent"] / row["cpu"] for row in asked]
    total = sum(row["spent"] for row in asked) / sum(row["cpu"] for row in asked)
    lines = [
        f"{len(asked)} failed runs of {len(rows)}; a change was found for {len(found)}",
        f"{sum(row['repeated'] == 'done' for row in found)} of {len(found)} proposals reach the goal when repeated",
        f"recalled: {len(found)} of {len(found) + len(missed)}",
        f"reruns: median {median(row['reruns'] for row in asked):g}; "
        f"CPU: median {median(ratios):.1f} times that of the failed run, {total:.1f} times in all",
    ]
    return "\n".join(lines)


def main(words: Sequence[str] | None = None) -> int:
    """Ask, follow the answers, and print the figures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--number", type=int, default=10, help="failed runs (default: 10)")
    parser.add_argument("--seed", type=int, default=0, help="the first seed of the homes (default: 0)")
    parser.add_argument("--robots", default="amigo,panda")
    parser.add_argument("--templates", default="", help="templates of homes; all by default")
    parser.add_argument("--displaced", action="store_true", help="worlds that are displaced by their seed")
    parser.add_argument("--failed", type=Path, default=None, help="rows of a sweep of homes: those that failed")
    parser.add_argument("--budget", type=int, default=40, help="reruns of each search (default: 40)")
    parser.add_argument("--recall", type=int, default=0, help="runs, by lot, against all single changes (default: 0)")
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    parser.add_argument("--out", type=Path, default=None, help="write the rows to this file")
    given = parser.parse_args(words)
    rows: list[Row] = []
    each = worlds(given)
    while sum("reruns" in row for row in rows) < given.number and len(rows) < SURELY * given.number:
        some = list(islice(each, given.number - sum("reruns" in row for row in rows)))
        if not some:
            break
        rows += sweep(some, JOB, processes=given.jobs, limits=LIMITS, told=say)
    if given.out is not None:
        given.out.write_text("".join(json.dumps(row) + os.linesep for row in rows), encoding="utf-8")
    print(told(rows))
    asked = [row for row in rows if row.get("reruns") is not None]
    found, missed = [row for row in asked if row["found"]], sum(bool(row.get("missed")) for row in asked)
    is_false = any(row["repeated"] != "done" for row in found)
    is_slow = bool(asked) and median(row["reruns"] for row in asked) > RERUNS
    return int(is_false or is_slow or len(found) < SHARE * (len(found) + missed))


if __name__ == "__main__":
    sys.exit(main())
