"""Try what failures advise: the task is run again in a fresh process, in the map changed as its failure advised.

    python -m tests.benchmarks.advices                             25 advices of hard rooms, two robots in turn
    python -m tests.benchmarks.advices --number 200 --robots pr2 --kinds far,covered
    python -m tests.benchmarks.advices --templates fetch,beside    tasks of the homes instead of hard rooms

An advice is true if the second run is done, or ends in a later step, or at a later place of the same step. It is false
if the run fails where it failed before, or before that. Exit code 1 if fewer than 90 % are true.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import count, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from executive.sweeps import Row
from executive.sweeps import run as sweep
from executive.sweeps.records import Done
from tests.benchmarks.advice_rooms import KINDS, hard_room
from tests.benchmarks.homes.furnishing import NoRoom
from tests.benchmarks.homes.series import Case
from tests.benchmarks.homes.trial import arguments, task_of, write

JOB = "tests.benchmarks.advices:job"
SHARE = 0.9
"""Least share of advices that are true."""
SECONDS = 400.0
"""Longest run [s]."""
SURELY = 4
"""Tasks that are run for each advice that is wanted."""


def job(world: Mapping[str, Any]) -> Row:
    """Run the task of a world and, if its failure advises a change, once more with that; return the row."""
    case = Case(world["template"], world["seed"], world["robot"])
    try:
        task = hard_room(case.template, case.seed) if case.template in KINDS else task_of(case)
    except NoRoom as problem:
        return {"outcome": "not drawn", "cause": str(problem)}
    with TemporaryDirectory() as name:
        folder = Path(name)
        words = arguments(case, task, *write(task, case.seed, folder))
        first = _run(words, folder / "first")
        row = {key: first[key] for key in ("outcome", "where", "message", "steps")}
        if not first["changes"]:
            return row
        (folder / "advice.json").write_text(json.dumps(first["changes"]))
        again = _run((*words, "--apply", str(folder / "advice.json")), folder / "again")
    return row | {"changes": first["changes"], "verdict": verdict(first, again), "then": again["message"]}


def verdict(first: Mapping[str, Any], again: Mapping[str, Any]) -> str:
    """Return how far the second run got, compared with the first."""
    if again["outcome"] == "done":
        return "done"
    if again["steps"] != first["steps"]:
        return "later step" if again["steps"] > first["steps"] else "earlier step"
    return "same place" if again["where"] == first["where"] else "same step"


TRUE = ("done", "later step", "same step")


def _run(words: Sequence[str], trace: Path) -> dict[str, Any]:
    """Run a task as the command does; return its outcome, place and message of its failure, changes, finished steps."""
    command = [sys.executable, "-m", "planlang_command", "run", *words, "--json", "--trace", str(trace)]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
        found = json.loads(ended.stdout)
    except (subprocess.TimeoutExpired, ValueError) as problem:
        return {"outcome": "aborted", "where": "", "message": str(problem)[:300], "changes": [], "steps": 0}
    failure = found.get("failure") or {}
    records = map(json.loads, trace.read_text(encoding="utf-8").splitlines()) if trace.exists() else iter(())
    return {
        "outcome": found.get("outcome", "bad input"),
        "where": failure.get("where") or "",
        "message": str(found.get("message") or found.get("diagnostics"))[:600],
        "changes": failure.get("changes") or [],
        "steps": sum(one.get("event") == "completed" and "value" in one for one in records),
    }


def worlds(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield tasks without end, kinds and robots in turn."""
    robots, names = given.robots.split(","), given.templates.split(",") if given.templates else given.kinds.split(",")
    for seed in count(given.seed):
        for number, name in enumerate(names):
            robot = robots[(seed + number) % len(robots)]
            yield {"world": f"{name} {seed} {robot}", "template": name, "seed": seed, "robot": robot}


def say(done: Done) -> None:
    """Print how one task ended, and what became of its advice."""
    row = done.row
    first, then = (str(row.get(key, "")).partition("\n")[0][:260] for key in ("message", "then"))
    if "verdict" not in row:
        print(f"{row['world']:24} {row['outcome']}, no advice: {first}", flush=True)
    elif is_true(row):
        print(f"{row['world']:24} {row['verdict']}: {first}", flush=True)
    else:
        print(f"{row['world']:24} FALSE, {row['verdict']}: {first}\n    then: {then}", flush=True)


def told(rows: Sequence[Row]) -> str:
    """Return the counts of true advices by kind, and in all."""
    advised, lines = [row for row in rows if "verdict" in row], list[str]()
    kinds: dict[str, list[Row]] = {}
    for row in advised:
        kinds.setdefault(row["changes"][0].get("property", "option"), []).append(row)
    lines += [f"{kind}: {sum(map(is_true, group))} of {len(group)} true" for kind, group in sorted(kinds.items())]
    others = Counter(row["outcome"] for row in rows if "verdict" not in row)
    lines.append(f"{sum(map(is_true, advised))} of {len(advised)} advices are true; without advice: {dict(others)}")
    return "\n".join(lines)


def is_true(row: Row) -> bool:
    """Return whether a run got past the failure that advised a change of its map."""
    return row["verdict"] in TRUE


def main(words: Sequence[str] | None = None) -> int:
    """Try advices, and say which are true."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--number", type=int, default=25, help="advices that are tried (default: 25)")
    parser.add_argument("--seed", type=int, default=0, help="the first seed of rooms and homes (default: 0)")
    parser.add_argument("--robots", default="amigo,pr2")
    parser.add_argument("--kinds", default=",".join(KINDS), help="kinds of hard rooms")
    parser.add_argument("--templates", default="", help="templates of homes, instead of hard rooms")
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    given = parser.parse_args(words)
    rows: list[Row] = []
    each = worlds(given)
    while sum("verdict" in row for row in rows) < given.number and len(rows) < SURELY * given.number:
        missing = given.number - sum("verdict" in row for row in rows)
        found = sweep(list(islice(each, missing)), JOB, processes=given.jobs, told=say)
        rows += found
    print(told(rows))
    advised = [row for row in rows if "verdict" in row]
    return int(sum(map(is_true, advised)) < SHARE * len(advised))


if __name__ == "__main__":
    sys.exit(main())
