"""Measure how places are found: in one run beside samplers and other inverse kinematics, judged by PyBullet.

    python -m tests.benchmarks.locations                          all of it, 200 rooms of each promised kind
    python -m tests.benchmarks.locations --rooms 20               less of it
    python -m tests.benchmarks.locations --parts hard,infeasible  only parts whose names begin so
    python -m tests.benchmarks.locations --parts hard --first 200 other rooms
    python -m tests.benchmarks.locations --parts anew --first 5000 96 rooms, half of them with a crowded table
    python -m tests.benchmarks.locations --keep results.json      goes on after the last part that was finished

Times are CPU time of this process. Exit code 1 if an answer is wrong.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from executive.robots import Robot
from planlang.diagnostics import BadInput
from tests.benchmarks.locations import conduct, parts
from tests.benchmarks.locations.promises import Report, durations, table
from tests.support.locations.rooms import KINDS
from tests.support.locations.stage import robot_of

ROBOTS = ("amigo", "pr2", "panda")
OTHERS = 8
"""Of kinds and robots about which nothing is promised there are so many times fewer rooms."""

Parts = Mapping[str, Callable[[], Report]]


def main() -> int:
    """Measure and print the tables."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--rooms", type=int, default=200, help="rooms of the kinds normal and hard (default: 200)")
    options.add_argument("--first", type=int, default=0, help="seed of the first room (default: 0)")
    options.add_argument("--targets", type=int, default=1000, help="targets of inverse kinematics (default: 1000)")
    options.add_argument("--robots", default=",".join(ROBOTS), help="which robots (default: all that are there)")
    options.add_argument("--queries", type=int, default=1000, help="random questions (default: 1000)")
    options.add_argument("--without-search", action="store_true", help="do not search unsolved rooms through")
    options.add_argument("--parts", default="", help="beginnings of the names of parts (default: all)")
    options.add_argument("--list", action="store_true", help="name the parts")
    options.add_argument("--keep", type=Path, help="a file of finished parts: these are not measured again")
    chosen = options.parse_args()
    found = [robot for name in chosen.robots.split(",") if (robot := _robot(name)) is not None]
    if not found:
        print("no robot to measure", file=sys.stderr)
        return 2
    wanted = tuple(chosen.parts.split(","))
    every = {name: part for name, part in _parts(chosen, found).items() if name.startswith(wanted)}
    if chosen.list or not every:
        print("\n".join(_parts(chosen, found)))
        return 0 if chosen.list else 2
    asked = {"rooms": chosen.rooms, "first": chosen.first, "targets": chosen.targets, "queries": chosen.queries}
    kept = _Kept(chosen.keep, asked)
    reports: dict[str, Report] = {}
    for name, part in every.items():
        print(f"\n## {name}\n", flush=True)
        known = kept.report(name)
        if known is None:
            began = _computing()
            known = part()
            known.seconds = _computing() - began
            kept.add(name, known)
        else:
            print("(as it was measured before)")
        reports[name] = known
    print(f"\n## Computing\n\n{durations(reports)}")
    print(f"\n## Promises\n\n{table(reports.values())}")
    if len(every) == len(_parts(chosen, found)):
        kept.forget()  # the next whole run begins anew
    return int(any(report.wrong for report in reports.values()))


def _computing() -> float:
    """CPU time of this process and of those it started [s]."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def _parts(chosen: argparse.Namespace, robots: list[Robot]) -> Parts:
    """Name of a part -> what measures it, in this order."""
    rooms, first, main = chosen.rooms, chosen.first, robots[0]
    fewer = max(1, rooms // OTHERS)
    every: dict[str, Callable[[], Report]] = {}
    for robot in robots:
        every[f"inverse kinematics {robot.name}"] = partial(parts.inverse_kinematics, robot, chosen.targets)
    for robot in robots:
        for kind in KINDS:
            if kind == "hard" and robot.name == parts.MAIN:
                every["hard rooms"] = partial(parts.hard, robot, rooms, first, search=not chosen.without_search)
                continue
            number = rooms if kind == "normal" else fewer
            every[f"reach {robot.name} {kind}"] = partial(parts.reaching, robot, kind, number, first)
    every["infeasible rooms"] = partial(parts.infeasible, main, max(1, rooms // 20))
    every["anew"] = partial(parts.anew, main, max(1, rooms * 12 // 25), first)
    every["visible from"] = partial(parts.visible, main, max(2, rooms // 2))
    every["on"] = partial(parts.on, main, max(3, rooms // 2))
    every["conjunctions"] = partial(parts.areas, main, max(2, rooms // 10))
    every["shell"] = conduct.shell
    every["unchanged"] = partial(conduct.unchanged, chosen.queries)
    every["two processes"] = partial(conduct.identical, max(1, rooms // 50))
    every["properties"] = conduct.properties
    return every


CODE = (".py", ".c", ".toml", ".omn", ".owl", ".urdf")
"""What files end with on which a measurement depends."""


def _code() -> str:
    """A digest of what is measured and of what measures."""
    digest = hashlib.sha256()
    for folder in ("planlang", "executive", "sim", "ontologies", "tests/benchmarks/locations"):
        for path in sorted(path for path in Path(folder).rglob("*") if path.suffix in CODE):
            digest.update(path.read_bytes())
    return digest.hexdigest()


class _Kept:
    """Finished parts in a file, valid for the same options and the same code."""

    def __init__(self, path: Path | None, options: Mapping[str, int]) -> None:
        self._path, self._options = path, {**options, "code": _code()}
        self._parts: dict[str, object] = {}
        if path is not None and path.exists():
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["options"] == self._options:
                self._parts = content["parts"]
            else:
                print(f"{path} is of other options or other code: all parts are measured anew", file=sys.stderr)

    def report(self, name: str) -> Report | None:
        """Return what a part came to, None if it is not finished."""
        known = self._parts.get(name)
        return Report.read(known) if isinstance(known, dict) else None

    def add(self, name: str, report: Report) -> None:
        """A part is finished."""
        self._parts[name] = report.written()
        if self._path is not None:
            fresh = self._path.with_name(self._path.name + ".new")
            fresh.write_text(json.dumps({"options": self._options, "parts": self._parts}, indent=1), encoding="utf-8")
            os.replace(fresh, self._path)

    def forget(self) -> None:
        """Nothing is to be gone on with."""
        if self._path is not None:
            self._path.unlink(missing_ok=True)


def _robot(name: str) -> Robot | None:
    try:
        return robot_of(name)
    except BadInput as bad:
        print(f"{name} is left out: {bad.diagnostics[0].message}", file=sys.stderr)
        return None


if __name__ == "__main__":
    sys.exit(main())
