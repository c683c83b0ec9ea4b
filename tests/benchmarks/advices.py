"""Try what failures advise: the task is run again in a fresh process, in the map changed as its failure advised.

    python -m tests.benchmarks.advices                             25 advices of hard rooms, two robots in turn
    python -m tests.benchmarks.advices --number 200 --robots pr2 --kinds far,covered
    python -m tests.benchmarks.advices --templates fetch,beside    tasks of the homes instead of hard rooms
    python -m tests.benchmarks.advices --failed rows.jsonl         the tasks that failed in a sweep of homes

An advice is true if the second run is done, or ends in a later step, or at a later place of the same step. It is false
if the run fails where it failed before, or before that. Of a sentence that says that no simple change helps, each
change that it names as tried is tried, too: it is false if one of them helped. Exit code 1 if fewer than 90 % of the
advices are true, or more than one in 30 of these sentences is false.
"""

from __future__ import annotations

import argparse
import json
import re
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
from tests.benchmarks.homes.tasks import Task
from tests.benchmarks.homes.trial import arguments, task_of, write

JOB = "tests.benchmarks.advices:job"
SHARE = 0.9
"""Least share of advices that are true."""
MOST_HELPED = 1 / 30
"""Greatest share of false sentences among those that say that nothing simple helps."""
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
        if first["changes"]:
            again = _applied(words, first["changes"], folder)
            return row | {"changes": first["changes"], "verdict": verdict(first, again), "then": again["message"]}
        in_vain = {tried: changes_named(tried, task) for tried in named_as_tried(first["advice"])}
        found = {tried: verdict(first, _applied(words, changes, folder)) for tried, changes in in_vain.items()}
    return row | ({"in_vain": found} if found else {})


def _applied(words: Sequence[str], changes: object, folder: Path) -> dict[str, Any]:
    """Run a task with changes, as :func:`_run` does."""
    (folder / "advice.json").write_text(json.dumps(changes))
    return _run((*words, "--apply", str(folder / "advice.json")), folder / "again")


_TRIED = re.compile(r"\(tried: (.*?)\)")
_WITHOUT = re.compile(r"without (.+?)(?= [\w.]+ at x = |$)")
_STANDS = re.compile(r"([\w.]+) at x = (-?[\d.]+), y = (-?[\d.]+)")
_STARTED = re.compile(r"started at x = (-?[\d.]+), y = (-?[\d.]+), yaw = (-?[\d.]+)")


def named_as_tried(advice: str) -> list[str]:
    """Return the changes that an advice names as tried without success."""
    found = _TRIED.search(advice)
    return re.split(r", (?=without |started |[\w.]+ at x = )", found[1]) if found else []


def changes_named(tried: str, task: Task) -> list[dict[str, Any]]:
    """Return one change that an advice names, as data."""
    if start := _STARTED.search(tried):
        return [{"option": "start", "value": [float(number) for number in start.groups()]}]
    gone = _WITHOUT.search(tried)
    changes: list[dict[str, Any]] = [
        {"thing": name, "property": "absent", "value": True} for name in (gone[1].split(" and ") if gone else ())
    ]
    if stands := _STANDS.search(tried):
        pose = task.home.things[stands[1]].pose
        assert pose is not None
        place = [float(stands[2]), float(stands[3]), pose.position[2]]
        changes.append({"thing": stands[1], "property": "translation", "value": place})
    return changes


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
        done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
        found = json.loads(done.stdout)
    except (subprocess.TimeoutExpired, ValueError) as problem:
        ended = {"outcome": "aborted", "where": "", "message": str(problem)[:300], "advice": ""}
        return ended | {"changes": [], "steps": 0}
    failure = found.get("failure") or {}
    records = map(json.loads, trace.read_text(encoding="utf-8").splitlines()) if trace.exists() else iter(())
    return {
        "outcome": found.get("outcome", "bad input"),
        "where": failure.get("where") or "",
        "message": str(found.get("message") or found.get("diagnostics"))[:600],
        "advice": failure.get("advice") or "",
        "changes": failure.get("changes") or [],
        "steps": sum(one.get("event") == "completed" and "value" in one for one in records),
    }


def worlds(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the tasks that failed in a sweep, or tasks without end, kinds and robots in turn."""
    if given.failed is not None:
        rows = map(json.loads, given.failed.read_text(encoding="utf-8").splitlines())
        yield from (
            {key: row[key] for key in ("world", "template", "seed", "robot")}
            for row in rows
            if row.get("outcome") == "failed" and not row.get("displaced")
        )
        return
    robots, names = given.robots.split(","), given.templates.split(",") if given.templates else given.kinds.split(",")
    for seed in count(given.seed):
        for number, name in enumerate(names):
            robot = robots[(seed + number) % len(robots)]
            yield {"world": f"{name} {seed} {robot}", "template": name, "seed": seed, "robot": robot}


def say(done: Done) -> None:
    """Print how one task ended, and what became of its advice."""
    row = done.row
    first, then = (str(row.get(key, "")).partition("\n")[0][:260] for key in ("message", "then"))
    if "in_vain" in row:
        told = ", ".join(f"{tried}: {found}" for tried, found in row["in_vain"].items())
        print(f"{row['world']:24} {'' if is_true(row) else 'FALSE, '}nothing helps ({told}): {first}", flush=True)
    elif "verdict" not in row:
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
    in_vain = [row for row in rows if "in_vain" in row]
    helped = len(in_vain) - sum(map(is_true, in_vain))
    lines.append(f"{helped} of {len(in_vain)} sentences that nothing simple helps name something that did")
    return "\n".join(lines)


def is_true(row: Row) -> bool:
    """Return whether a run got past the failure that advised a change of its map, or none did with what was tried."""
    if "in_vain" in row:
        return not any(found in TRUE for found in row["in_vain"].values())
    return row["verdict"] in TRUE


def main(words: Sequence[str] | None = None) -> int:
    """Try advices, and say which are true."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--number", type=int, default=25, help="advices that are tried (default: 25)")
    parser.add_argument("--seed", type=int, default=0, help="the first seed of rooms and homes (default: 0)")
    parser.add_argument("--robots", default="amigo,pr2")
    parser.add_argument("--kinds", default=",".join(KINDS), help="kinds of hard rooms")
    parser.add_argument("--templates", default="", help="templates of homes, instead of hard rooms")
    parser.add_argument("--failed", type=Path, default=None, help="rows of a sweep of homes, instead of hard rooms")
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    given = parser.parse_args(words)
    rows: list[Row] = []
    each = worlds(given)
    while sum("verdict" in row for row in rows) < given.number and len(rows) < SURELY * given.number:
        missing = given.number - sum("verdict" in row for row in rows)
        some = list(islice(each, missing))
        if not some:
            break
        rows += sweep(some, JOB, processes=given.jobs, told=say)
    print(told(rows))
    advised, in_vain = ([row for row in rows if key in row] for key in ("verdict", "in_vain"))
    helped = len(in_vain) - sum(map(is_true, in_vain))
    return int(sum(map(is_true, advised)) < SHARE * len(advised) or helped > MOST_HELPED * len(in_vain))


if __name__ == "__main__":
    sys.exit(main())
