"""Ask ``planlang why`` about failed runs of random homes, and follow what it answers.

    python -m tests.benchmarks.why                                 10 failed runs, two robots in turn
    python -m tests.benchmarks.why --number 60 --recall 20         all, and 20 by lot against all single changes
    python -m tests.benchmarks.why --seed 7 --displaced            in worlds that are displaced, as the map stays
    python -m tests.benchmarks.why --failed rows.jsonl             the tasks that failed in a sweep of homes
    python -m tests.benchmarks.why ... --out F --minutes 60        go on later with the same call: F has what is done

Each run, each search and each repetition is a process of its own. A proposal is true if the repetition is done. A run
is recalled if a change was found, or none of the single changes helps: those drawn by lot for which none was found are
searched once more, with a budget that suffices for all. Exit code 1 if a proposal is false, if less than 90 % of the
runs drawn by lot that a single change mends are recalled, or if the median is over 8 reruns or over 8 times the CPU.
"""

from __future__ import annotations

import argparse
import hashlib
import json
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
SECONDS = 3600.0
"""Longest process [s]."""
MOST = 100
"""Reruns that suffice for all single changes, and for what comes before them."""
SHARE, RERUNS, RATIO = 0.9, 8, 8.0
"""Least share of runs recalled; the greatest median of reruns, and of CPU in multiples of the failed run's."""
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
        row |= {key: answer.get(key) for key in ANSWERED}
        row |= {"spent": spent, "diagnostics": [one["message"] for one in answer.get("diagnostics", ())]}
        if row["found"] and not world["recalls"]:
            again, _ = _planlang(*shlex.split(answer["command"])[1:])
            row |= {"repeated": again.get("outcome"), "then": _message(again)}
    return row


MEASURED = """
import os, resource, sys
from contextlib import contextmanager
from executive.why import explaining

reruns = []

class Counted:
    def __init__(self, workers):
        self._workers = workers

    @contextmanager
    def done(self, worlds):
        with self._workers.done(worlds) as results:
            yield map(self._counted, results)

    def _counted(self, done):
        reruns.append(done.seconds)
        return done

workers = explaining.workers

@contextmanager
def counted(task):
    with workers(task) as used:
        yield Counted(used)

explaining.workers = counted
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


def tasks(given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the tasks that failed in a sweep, or tasks without end, robots and templates in turn."""
    if given.failed is not None:
        lines = (json.loads(line) for line in given.failed.read_text(encoding="utf-8").splitlines())
        for row in lines:
            if row.get("outcome") == "failed":
                yield _world(row["template"], row["seed"], row["robot"], bool(row.get("displaced")), given.budget)
        return
    robots, names = given.robots.split(","), given.templates.split(",") if given.templates else [*TEMPLATES]
    for number in count():
        seed, name = given.seed + number // len(names), names[number % len(names)]
        yield _world(name, seed, robots[number % len(robots)], given.displaced, given.budget)


def _world(template: str, seed: int, robot: str, displaced: bool, budget: int) -> dict[str, Any]:
    key = f"{template} {seed} {robot}{' displaced' if displaced else ''}, {budget} reruns"
    told = {"template": template, "seed": seed, "robot": robot, "displaced": displaced}
    return {"world": key, **told, "budget": budget, "recalls": False}


class Series:
    """Rows of tasks, which are kept in a file, and how much CPU time they took in this call."""

    def __init__(self, given: argparse.Namespace) -> None:
        self._jobs, self._out, self._left = given.jobs, given.out, 60.0 * given.minutes
        self.rows: dict[str, Row] = {}
        if self._out is not None and self._out.exists():
            lines = self._out.read_text(encoding="utf-8").splitlines()
            self.rows = {row["world"]: row for row in map(json.loads, lines)}

    def of(self, worlds: Sequence[Mapping[str, Any]]) -> list[Row]:
        """Rows of worlds, as far as the time suffices; those that the file has are not run again."""
        missing = [one for one in worlds if one["world"] not in self.rows]
        while missing and self._left > 0:
            some, missing = missing[: self._jobs], missing[self._jobs :]
            sweep(some, JOB, processes=self._jobs, limits=LIMITS, told=self._add)
        return [self.rows[one["world"]] for one in worlds if one["world"] in self.rows]

    def _add(self, done: Done) -> None:
        row = done.row
        self._left -= row.get("cpu", 0.0) + row.get("spent", 0.0)
        self.rows[row["world"]] = row
        if self._out is not None:
            with self._out.open("a", encoding="utf-8") as file:
                file.write(f"{json.dumps(row)}\n")
        say(row)


def say(row: Row) -> None:
    """Print what became of one task."""
    if row.get("reruns") is None:
        print(f"{row['world']:46} {row['outcome']} {row.get('message', '')[:100]}", flush=True)
        return
    print(f"{row['world']:46} failed ({row['cpu']} s): {str(row['message']).partition(chr(10))[0][:200]}")
    ratio = row["spent"] / row["cpu"]
    print(f"    {row['sentence']} ({row['reruns']} reruns, {ratio:.1f} times the CPU) {row['diagnostics'] or ''}")
    if "repeated" in row:
        print(f"    {'repeated: done' if row['repeated'] == 'done' else 'FALSE: ' + row['then']}", flush=True)


def drawn_by_lot(rows: Sequence[Row], number: int) -> list[Row]:
    """Draw failed runs by lot; equal rows, equal lot."""
    return sorted(rows, key=lambda row: hashlib.sha256(str(row["world"]).encode()).digest())[:number]


def asked(rows: Sequence[Row]) -> list[Row]:
    """Rows of runs that failed, for which a change was sought."""
    return [row for row in rows if row.get("reruns") is not None]


class Figures:
    """What is measured."""

    def __init__(self, rows: Sequence[Row], lot: Sequence[Row], again: Mapping[str, Row]) -> None:
        """``lot``: rows drawn by lot; ``again``: of those without a change, rows of the larger search."""
        self._number, self.failed = len(rows), asked(rows)
        self.found = [row for row in self.failed if row["found"]]
        self.true = [row for row in self.found if row.get("repeated") == "done"]
        self.recalled = sum(bool(row["found"]) for row in lot)
        searched = [again[row["world"]] for row in lot if row["world"] in again]
        self.missed = [row for row in searched if row.get("found")]
        self.hopeless = len(searched) - len(self.missed)
        self.open = len(lot) - self.recalled - len(searched)
        self.ratios = [row["spent"] / row["cpu"] for row in self.failed]
        self.reruns = median(row["reruns"] for row in self.failed) if self.failed else 0

    @property
    def is_met(self) -> bool:
        """True if all figures are as good as they have to be."""
        are_true, mendable = len(self.true) == len(self.found), self.recalled + len(self.missed)
        is_fast = not self.failed or (self.reruns <= RERUNS and median(self.ratios) <= RATIO)
        return are_true and is_fast and self.recalled >= SHARE * mendable

    def __str__(self) -> str:
        if not self.failed:
            return "no run failed"
        total = sum(row["spent"] for row in self.failed) / sum(row["cpu"] for row in self.failed)
        lines = [
            f"{len(self.failed)} failed runs of {self._number}; a change was found for {len(self.found)}",
            f"{len(self.true)} of {len(self.found)} proposals reach the goal when repeated in a fresh process",
            f"recalled: {self.recalled} of {self.recalled + len(self.missed)} drawn by lot that a single change mends; "
            f"{self.hopeless} that none mends, {self.open} not searched yet",
            f"reruns: median {self.reruns:g}; "
            f"CPU: median {median(self.ratios):.1f} times that of the failed run, {total:.1f} times in all",
        ]
        return "\n".join([*lines, *(f"missed: {row['world']}: {row['sentence']}" for row in self.missed)])


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
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: 2)")
    parser.add_argument("--minutes", type=float, default=1e6, help="begin nothing more after so much CPU time [min]")
    parser.add_argument("--out", type=Path, default=None, help="keep the rows in this file, and go on with it")
    given = parser.parse_args(words)
    series, rows, each = Series(given), list[Row](), tasks(given)
    while (lacking := given.number - len(asked(rows))) > 0 and len(rows) < SURELY * given.number:
        some = list(islice(each, lacking))
        new = series.of(some)
        rows += new
        if len(new) < len(some) or not some:
            break
    lot = drawn_by_lot(asked(rows), given.recall)
    for row in lot:
        if not row["found"]:
            series.of([_again(row)])
    again = {row["world"]: series.rows[key] for row in lot if (key := _again(row)["world"]) in series.rows}
    figures = Figures(rows, lot, again)
    print(figures)
    return int(not figures.is_met)


def _again(row: Row) -> dict[str, Any]:
    """The world of a row once more, with a budget for all single changes."""
    template, seed, robot, *more = str(row["world"]).partition(",")[0].split(" ")
    return {**_world(template, int(seed), robot, bool(more), MOST), "recalls": True}


if __name__ == "__main__":
    sys.exit(main())
