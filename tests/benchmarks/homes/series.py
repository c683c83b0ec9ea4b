"""Series of tasks: which seeds belong to development, which to acceptance, and which are burnt.

Development seeds may be looked into. Acceptance seeds follow from the commit that is measured, so that nobody can have
seen its homes; once somebody has looked into them they are burnt, and stand in ``burnt.json``.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
TOP = HERE.parents[2]
BURNT = HERE / "burnt.json"
ACCEPTANCE = 1_000_000
"""Least acceptance seed; development seeds are below 100,000."""
DEVELOPMENT = 100_000
SPAN = 1000
"""Distance of the first seeds of two acceptance series: no two share a seed."""
PRODUCT = ("planlang", "executive", "sim", "ontologies", "recipes", "planlang_command.py")
"""What is measured."""


class NotAccepted(Exception):
    """An acceptance series cannot be drawn."""


@dataclass(frozen=True)
class Case:
    """A task for a robot, in the home as its map says or displaced by its seed."""

    template: str
    seed: int
    robot: str
    displaced: bool = False

    @property
    def command(self) -> str:
        """The command that repeats it."""
        more = " --displaced" if self.displaced else ""
        return (
            f"python -m tests.benchmarks.homes run --robots {self.robot} --templates {self.template} "
            f"--seeds {self.seed}:{self.seed + 1}{more}"
        )

    @property
    def world(self) -> dict[str, object]:
        """What a sweep does it by."""
        key = f"{self.template} {self.seed} {self.robot}{' displaced' if self.displaced else ''}"
        return {"world": key, "repeat": self.command, **asdict(self)}


def acceptance_seed(commit: str, what: str = "homes") -> int:
    """Return the first seed of the acceptance series of a commit; ``what`` is measured."""
    number = int.from_bytes(hashlib.sha256(f"{what} {commit}".encode()).digest()[:6], "big")
    return ACCEPTANCE + SPAN * (number % 1_000_000)


def commit_measured(top: Path = TOP, *, allow_changes: bool = False, measured: Sequence[str] = PRODUCT) -> str:
    """Return the commit of the checkout; raises NotAccepted if what is measured differs from it."""
    changed = "" if allow_changes else _git(top, "status", "--porcelain", "--", *measured)
    if changed:
        raise NotAccepted(f"files of the product are not committed:\n{changed}")
    return _git(top, "rev-parse", "HEAD")


def acceptance_series(commit: str, tasks: int, burnt: Path = BURNT, what: str = "homes") -> range:
    """Return the acceptance seeds of a commit; raises NotAccepted if they are burnt."""
    first = acceptance_seed(commit, what)
    for one in json.loads(burnt.read_text(encoding="utf-8")):
        if one["first"] == first:
            raise NotAccepted(f"the series of {commit} is burnt: {one['reason']}")
    return range(first, first + tasks)


def cases(seeds: Sequence[int], templates: Sequence[str], robots: Sequence[str], displaced: bool) -> Iterator[Case]:
    """Yield all cases, seed by seed, so that a series that is cut short has had all templates and robots."""
    for seed in seeds:
        for template in templates:
            for robot in robots:
                yield Case(template, seed, robot, displaced)


def by_lot(rows: Sequence[Mapping[str, object]], number: int, *, failed: bool = False) -> list[Mapping[str, object]]:
    """Return so many of the tasks in homes as their maps say, drawn by lot; equal rows, equal lot.

    They are of those that were reached, or of those that ``failed``.
    """
    drawn = [row for row in rows if bool(row.get("reached")) != failed and not row.get("displaced")]
    drawn = [row for row in drawn if row.get("outcome") != "not drawn"]
    drawn.sort(key=lambda row: hashlib.sha256(str(row["world"]).encode()).digest())
    return drawn[:number]


def _git(top: Path, *words: str) -> str:
    done = subprocess.run(["git", *words], cwd=top, capture_output=True, text=True, check=True)
    return done.stdout.strip()
