"""Everyday tasks in homes that are drawn at random: how many reach their goal, by template and robot.

python -m tests.benchmarks.homes run --robots amigo,pr2 --seeds 0:3 [--templates fetch,beside] [--out ROWS]
python -m tests.benchmarks.homes run --robots amigo --seeds 0:1 --templates flat_tasks,further_tasks,door_tasks
python -m tests.benchmarks.homes series acceptance [--docs docs/reference/homes.md]
python -m tests.benchmarks.homes certify ROWS... [--failed] [--number 200] [--out ANSWERS]
python -m tests.benchmarks.homes table ROWS... [--docs docs/reference/homes.md]
python -m tests.benchmarks.homes write FOLDER --robots pr2 --seeds 0:1 --templates fetch
python -m tests.benchmarks.homes witness --robots pr2 --seeds 0:1 --templates fetch
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from executive.maps import read_map, scene_of
from executive.options.engines import seconds
from executive.processes.workers import Limits
from executive.sweeps import Row
from executive.sweeps import run as sweep
from executive.sweeps.files import read_sweep
from planlang.diagnostics import BadInput
from planlang.ontology import load
from tests.benchmarks.homes import series
from tests.benchmarks.homes.furnishing import NoRoom
from tests.benchmarks.homes.progress import Progress
from tests.benchmarks.homes.robots import BLIND, MADE, ROBOTS, named
from tests.benchmarks.homes.series import Case, NotAccepted
from tests.benchmarks.homes.table import documented, tables
from tests.benchmarks.homes.tasks import TEMPLATES, module_of
from tests.benchmarks.homes.trial import arguments, task_of, verdict, write
from tests.benchmarks.homes.witness import Answer

LIMITS = Limits(seconds=300, memory=3_000_000_000, wall=900.0)
"""Of one task with its witness."""
TASKS = 10
"""Tasks of each template and robot in a whole series."""
DISPLACED = 4
"""Of them in displaced worlds too, for robots with a camera: one without misses what is not where the map says."""
CERTIFIED = 200
"""Tasks that were reached and of which the witness is asked."""


def main(words: Sequence[str] | None = None) -> int:
    """Measure, or say what was measured."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(required=True, dest="command")
    for name in ("run", "write", "witness"):
        one = commands.add_parser(name)
        one.add_argument("--robots", default=",".join(ROBOTS))
        one.add_argument("--seeds", default="0:1", help="FIRST:END")
        one.add_argument("--templates", default="", help="templates, or modules of them; all by default")
        if name == "write":
            one.add_argument("folder", type=Path)
        if name == "run":
            one.add_argument("--displaced", action="store_true", help="the seed displaces the world, the map stays")
            one.add_argument("--witness", choices=("all", "failed", "none"), default="failed")
            _add_engine(one)
            one.add_argument("--out", type=Path, help="a file of rows, which is gone on with")
    one = commands.add_parser("series", help="a whole series, in homes as their maps say and displaced")
    one.add_argument("series", choices=("development", "acceptance"))
    one.add_argument("--robots", default=",".join(ROBOTS))
    one.add_argument("--tasks", type=int, default=TASKS, help="for each template and robot")
    one.add_argument("--displaced", type=int, default=DISPLACED, help="of them displaced, for robots with a camera")
    _add_engine(one)
    one.add_argument("--docs", type=Path, help="write the table into this page")
    one = commands.add_parser("table")
    one.add_argument("rows", type=Path, nargs="+")
    one.add_argument("--docs", type=Path, help="write it into this page")
    one = commands.add_parser("certify", help="ask the witness of tasks that were reached, drawn by lot")
    one.add_argument("rows", type=Path, nargs="+")
    one.add_argument("--failed", action="store_true", help="of those that failed: after the witness was changed")
    one.add_argument("--number", type=int, default=CERTIFIED)
    _add_engine(one)
    one.add_argument("--out", type=Path, help="a file of answers, which is gone on with")
    words = sys.argv[1:] if words is None else words
    given = parser.parse_args(["run", *words] if words[:1] and words[0].startswith("--") else words)
    try:
        return COMMANDS[given.command](given)
    except (NotAccepted, BadInput) as problem:
        print(problem, file=sys.stderr)
        return 2


def _add_engine(command: argparse.ArgumentParser) -> None:
    command.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    command.add_argument(
        "--on", default="local", help="local, dask, or the address of a scheduler, as of planlang sweep"
    )
    command.add_argument("--cluster-wait", default="300s", help="give up after this time without a worker")


def _engine(given: argparse.Namespace) -> dict[str, Any]:
    """Where worlds run, for a sweep. Raises BadInput."""
    return {"on": given.on, "processes": given.jobs, "cluster_wait": seconds(given.cluster_wait), "say": print}


def _cases(given: argparse.Namespace) -> list[Case]:
    wanted = given.templates.split(",") if given.templates else sorted(TEMPLATES)
    names = [one for one in sorted(TEMPLATES) if one in wanted or module_of(one) in wanted]
    first, end = map(int, given.seeds.split(":"))
    return list(series.cases(range(first, end), names, given.robots.split(","), getattr(given, "displaced", False)))


def _run(given: argparse.Namespace) -> int:
    rows = _swept(_cases(given), given.witness, given, given.out, {"series": "development"})
    print("\n".join(tables(rows)))
    return 0


def _series(given: argparse.Namespace) -> int:
    """Run a series, and go on with it if its files are there; another series of the same commit is compared."""
    is_accepted = given.series == "acceptance"
    commit = series.commit_measured(allow_changes=not is_accepted)
    seeds = series.acceptance_series(commit, given.tasks) if is_accepted else range(given.tasks)
    MADE.mkdir(parents=True, exist_ok=True)
    for displaced in (False, True):
        robots = [one for one in given.robots.split(",") if not (displaced and one in BLIND)]
        count = min(given.displaced, given.tasks) if displaced else given.tasks
        cases = list(series.cases(seeds[:count], sorted(TEMPLATES), robots, displaced))
        file = MADE / f"{given.series}-{commit[:12]}{'-displaced' if displaced else ''}.jsonl"
        _swept(cases, "failed", given, file, {"series": given.series, "commit": commit})
    given.rows = sorted(MADE.glob(f"*-{commit[:12]}*.jsonl"))
    return _table(given)


def _swept(
    cases: Sequence[Case], witnessed: str, given: argparse.Namespace, out: Path | None, about: Mapping[str, str]
) -> list[Row]:
    """Run tasks in supervised processes; return their rows."""
    for robot in {case.robot for case in cases}:
        named(robot)  # it is made before several processes want it
    told = Progress(len(cases))
    worlds = [case.world | {"witnessed": witnessed} for case in cases]
    job = "tests.benchmarks.homes.trial:job"
    engine = _engine(given)
    return sweep(worlds, job, **engine, limits=LIMITS, out=out, about=about, told=told, resumed=told.resumed)


def _table(given: argparse.Namespace) -> int:
    rows = [(sweep.header["about"], row) for sweep in map(read_sweep, given.rows) for row in sweep.rows]
    text = "\n".join(tables([row | {"series": about.get("series")} for about, row in rows]))
    if given.docs:
        given.docs.write_text(documented(given.docs.read_text(encoding="utf-8"), text), encoding="utf-8")
    else:
        print(text)
    return 0


def _certify(given: argparse.Namespace) -> int:
    """Ask the witness of reached tasks: all are possible, so what it cannot show is its own shortfall; or of failed."""
    asked_of = [row for file in given.rows for row in read_sweep(file).rows]
    drawn = series.by_lot(asked_of, given.number, failed=given.failed)
    worlds = [{key: row[key] for key in ("world", "repeat", "template", "seed", "robot")} for row in drawn]
    job = "tests.benchmarks.homes.trial:certify"
    rows = sweep(worlds, job, **_engine(given), limits=LIMITS, out=given.out)
    for answer in Answer:
        asked = [row for row in rows if row["outcome"] == answer.value]
        print(f"{answer.value:10} {len(asked):4} of {len(rows)}")
        if answer is not Answer.POSSIBLE:
            print("\n".join(f"    {row['world']}  {row['witness']['why'] or row['witness']['open']}" for row in asked))
    return 0


def _write(given: argparse.Namespace) -> int:
    given.folder.mkdir(parents=True, exist_ok=True)
    for case in _cases(given):
        try:
            task = task_of(case)
            recipe, home = write(task, case.seed, given.folder)
        except NoRoom as problem:
            print(problem, file=sys.stderr)
            continue
        print(shlex.join(("planlang", "run", *arguments(case, task, recipe, home))))
    return 0


def _witness(given: argparse.Namespace) -> int:
    folder = MADE / "maps"
    folder.mkdir(parents=True, exist_ok=True)
    for case in _cases(given):
        task = task_of(case)
        _, home = write(task, case.seed, folder)
        found = verdict(task, scene_of(read_map(load(home))), case.robot)
        print(
            f"{case.template:24} {case.seed:4} {case.robot:10} {found.answer.value:10} {found.why} {found.open or ''}"
        )
    return 0


COMMANDS = {"run": _run, "series": _series, "table": _table, "write": _write, "witness": _witness, "certify": _certify}

if __name__ == "__main__":
    sys.exit(main())
