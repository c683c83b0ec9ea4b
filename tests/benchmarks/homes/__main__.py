"""Everyday tasks in homes that are drawn at random: how many reach their goal, by template and robot.

python -m tests.benchmarks.homes run --robots amigo,pr2 --seeds 0:3 [--templates fetch,beside] [--out ROWS]
python -m tests.benchmarks.homes run --series acceptance [--displaced] --out ROWS
python -m tests.benchmarks.homes table ROWS... [--docs docs/homes.md]
python -m tests.benchmarks.homes write FOLDER --robots pr2 --seeds 0:1 --templates fetch
python -m tests.benchmarks.homes witness --robots pr2 --seeds 0:1 --templates fetch
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from executive.belief import read_map, scene_of
from executive.processes.calls import Limits
from executive.sweeps import Row
from executive.sweeps import run as sweep
from executive.sweeps.files import read_sweep
from executive.sweeps.records import Done
from planlang.diagnostics import BadInput
from planlang.ontology import load
from tests.benchmarks.homes import series
from tests.benchmarks.homes.furnishing import NoRoom
from tests.benchmarks.homes.robots import ROBOTS, named
from tests.benchmarks.homes.series import Case, NotAccepted
from tests.benchmarks.homes.table import documented, tables
from tests.benchmarks.homes.tasks import TEMPLATES
from tests.benchmarks.homes.trial import task_of, verdict, write

LIMITS = Limits(seconds=300, memory=3_000_000_000, wall=900.0)
"""Of one task with its witness."""
TASKS = 10
"""Tasks of each template and robot in a whole series."""


def main(words: Sequence[str] | None = None) -> int:
    """Measure, or say what was measured."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(required=True, dest="command")
    for name in ("run", "write", "witness"):
        one = commands.add_parser(name)
        one.add_argument("--robots", default=",".join(ROBOTS))
        one.add_argument("--seeds", help="FIRST:END")
        one.add_argument("--templates", default="", help="all by default")
        if name == "write":
            one.add_argument("folder", type=Path)
        if name == "run":
            one.add_argument("--series", choices=("development", "acceptance"), default="development")
            one.add_argument("--displaced", action="store_true", help="the seed displaces the world, the map stays")
            one.add_argument("--witness", choices=("all", "failed", "none"), default="failed")
            one.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
            one.add_argument("--out", type=Path, help="a file of rows, which is gone on with")
    one = commands.add_parser("table")
    one.add_argument("rows", type=Path, nargs="+")
    one.add_argument("--docs", type=Path, help="write it into this page")
    words = sys.argv[1:] if words is None else words
    given = parser.parse_args(["run", *words] if words[:1] and words[0].startswith("--") else words)
    try:
        return {"run": _run, "table": _table, "write": _write, "witness": _witness}[given.command](given)
    except (NotAccepted, BadInput) as problem:
        print(problem, file=sys.stderr)
        return 2


def _cases(given: argparse.Namespace, seeds: Sequence[int]) -> list[Case]:
    names = [one for one in sorted(TEMPLATES) if not given.templates or one in given.templates.split(",")]
    return list(series.cases(seeds, names, given.robots.split(","), getattr(given, "displaced", False)))


def _seeds(given: argparse.Namespace) -> Sequence[int]:
    if given.seeds:
        first, end = map(int, given.seeds.split(":"))
        return range(first, end)
    return range(TASKS)


def _run(given: argparse.Namespace) -> int:
    seeds, about = _seeds(given), {"series": "development"}
    if given.series == "acceptance":
        commit = series.commit_measured()
        seeds, about = series.acceptance_series(commit, TASKS), {"series": "acceptance", "commit": commit}
    cases = _cases(given, seeds)
    for robot in {case.robot for case in cases}:
        named(robot)  # it is made before several processes want it
    told = _Progress(len(cases))
    rows = sweep(
        [case.world | {"witnessed": given.witness} for case in cases],
        "tests.benchmarks.homes.trial:job",
        processes=given.jobs,
        limits=LIMITS,
        out=given.out,
        about=about,
        told=told,
        resumed=told.resumed,
    )
    print("\n".join(tables(rows)))
    return 0


class _Progress:
    """Prints a line for each task."""

    def __init__(self, total: int) -> None:
        self.total, self.done, self.began = total, 0, time.monotonic()
        self.known = 0

    def resumed(self, rows: Sequence[Row]) -> None:
        """Say how many rows there are."""
        self.known = len(rows)

    def __call__(self, done: Done) -> None:
        """Say how a task ended, and how long the others will take."""
        self.done, row = self.done + 1, done.row
        left = (self.total - self.known - self.done) * (time.monotonic() - self.began) / self.done
        said = "reached" if row.get("reached") else f"{row['outcome']}: {row.get('failure')} {row.get('unmet')}"
        kind = row.get("witness", {}).get("kind", "")
        print(f"{row['world']:40} {done.seconds:6.1f} s, {left / 60:.0f} min left  {kind} {said[:220]}", flush=True)


def _table(given: argparse.Namespace) -> int:
    rows = [(sweep.header["about"], row) for sweep in map(read_sweep, given.rows) for row in sweep.rows]
    text = "\n".join(tables([row | {"series": about.get("series")} for about, row in rows]))
    if given.docs:
        given.docs.write_text(documented(given.docs.read_text(encoding="utf-8"), text), encoding="utf-8")
    else:
        print(text)
    return 0


def _write(given: argparse.Namespace) -> int:
    given.folder.mkdir(parents=True, exist_ok=True)
    for case in _cases(given, _seeds(given)):
        try:
            recipe, home = write(task_of(case), case.seed, given.folder)
        except NoRoom as problem:
            print(problem, file=sys.stderr)
            continue
        print(f"planlang run {recipe} --robot {named(case.robot)} --environment {home}")
    return 0


def _witness(given: argparse.Namespace) -> int:
    given.folder = Path(series.TOP / ".venv" / "homes" / "witness")
    given.folder.mkdir(parents=True, exist_ok=True)
    for case in _cases(given, _seeds(given)):
        task = task_of(case)
        _, home = write(task, case.seed, given.folder)
        found = verdict(task, scene_of(read_map(load(home))), case.robot)
        print(
            f"{case.template:24} {case.seed:4} {case.robot:10} {found.answer.value:10} {found.why} {found.open or ''}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
