"""The series: its parts, how many worlds they have, and which worlds these are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from planlang.faults.kinds import KINDS
from planlang.faults.named import NamedFault
from tests.benchmarks.faults.cameras import EXACT, NOISE
from tests.benchmarks.faults.tasks import TASKS
from tests.benchmarks.homes.series import PRODUCT

BURNT = Path(__file__).resolve().parent / "burnt.json"
WHAT = "faults"
"""Whose hash, with the commit, gives the seeds."""
MEASURED = (*PRODUCT, "tests/benchmarks/faults")
"""What has to be committed: what is measured, with kinds, tasks and settings."""
ELSEWHERE = {"handle": "fetch", "door": "fetch", "device": "light", "thing:rolls": "tidy"}
"""Part of the robot or of the world, or kind -> the task in which its faults can happen, if serving a drink is not."""
OF_KIND = {"thing:moves": "thing.bottle1:moves", "camera:overlooks": "camera:overlooks=DrinkingBottle"}
"""Kind -> how it is stated, if not only by its name: so that it concerns the task."""
AMONG: Mapping[str, int] = {
    "arm:stalls": 5,
    "head:stalls": 2,
    "base:stalls": 2,
    "base:drifts": 2,
    "base:blocked": 2,
    "camera:blind": 2,
    "camera:ghost": 2,
    "gripper:stays_closed": 2,
    "handle:comes_loose": 2,
    "door:stuck": 2,
    "door:stops": 2,
    "thing:rolls": 2,
}
"""Kind -> opportunities for it that its task surely has, at which the worlds state it in turn; else the first."""


@dataclass(frozen=True)
class Cell:
    """Worlds of a part that count together."""

    part: str
    task: str
    worlds: int
    """In the whole series."""
    robot: str = "amigo"
    rate: float = 0.0
    bare: bool = False
    """Without recoveries."""
    camera: str = EXACT
    kind: str | None = None
    """The kind that is stated, if one is."""

    @property
    def name(self) -> str:
        """What it is called in a row, beside the seed."""
        how = self.kind or f"{self.task} {self.rate:g}{' bare' if self.bare else ''}"
        camera = "" if self.camera == EXACT else f" {self.camera}"
        return f"{self.part} {how} {self.robot}{camera}"

    def world(self, seed: int) -> dict[str, Any]:
        """The world of a seed, for a sweep."""
        entries = {
            "part": self.part,
            "task": self.task,
            "robot": self.robot,
            "seed": seed,
            "rate": self.rate,
            "bare": self.bare,
            "camera": self.camera,
            "kind": self.kind,
        }
        world = {"world": f"{self.name} {seed}", **entries, "faults": self._stated(seed), "columns": entries}
        return world | {"repeat": TASKS[self.task].command(world)}

    def _stated(self, seed: int) -> list[str]:
        if self.kind is None:
            return []
        number = 1 + seed % AMONG.get(self.kind, 1)
        return [str(NamedFault.read(f"{OF_KIND.get(self.kind, self.kind)}@{number}"))]


def _rates(part: str, task: str, worlds: int, rates: Sequence[float], robot: str = "amigo") -> Iterator[Cell]:
    for rate in rates:
        yield Cell(part, task, worlds, robot, rate)


def _bare(worlds: int, rates: Sequence[float]) -> Iterator[Cell]:
    for rate in rates:
        yield Cell("amigo", "serve", worlds, "amigo", rate, bare=True)


def _alike(worlds: int) -> Iterator[Cell]:
    for task in ("cups", "marked"):
        for camera in (EXACT, *NOISE):
            yield Cell("alike", task, worlds, camera=camera)


def _kinds(worlds: int) -> Iterator[Cell]:
    for one in KINDS:
        if one.recovers:
            task = ELSEWHERE.get(str(one)) or ELSEWHERE.get(one.part, "serve")
            yield Cell("kinds", task, worlds, kind=str(one))


CELLS: Sequence[Cell] = (
    *_rates("amigo", "serve", 300, (0.0, 0.1, 0.2)),
    *_bare(300, (0.0, 0.1, 0.2)),
    *_rates("pr2", "serve", 100, (0.0, 0.1), "pr2"),
    *_rates("tasks", "table", 60, (0.0, 0.1)),
    *_rates("tasks", "tidy", 60, (0.0, 0.1)),
    *_rates("tasks", "tray", 60, (0.0, 0.1)),
    *_alike(60),
    *_kinds(50),
)
"""The whole series. Cells of one task have the same worlds, and those of one rate the same faults."""
PARTS = tuple(dict.fromkeys(one.part for one in CELLS))


def cells_of(only: Sequence[str]) -> list[Cell]:
    """Cells of some parts, tasks or kinds; all of them if none is named. Raises ValueError for what is none."""
    known = {name for one in CELLS for name in (one.part, one.task, one.kind) if name}
    if unknown := [name for name in only if name not in known]:
        raise ValueError(f"there is no {', '.join(unknown)}; there are {', '.join(sorted(known))}")
    return [one for one in CELLS if not only or not {one.part, one.task, one.kind or ""}.isdisjoint(only)]


def worlds_of(
    cells: Sequence[Cell], first: int, *, most: int | None = None, share: float = 1.0
) -> list[Mapping[str, Any]]:
    """Worlds of cells, with seeds from a first one on: a share of them, and at most so many of each cell.

    They are in an order in which a series that is cut short has had all cells.
    """
    numbers = {one: min(max(1, math.ceil(one.worlds * share)), most or one.worlds) for one in cells}
    longest = max(numbers.values(), default=0)
    return [one.world(first + place) for place in range(longest) for one in cells if place < numbers[one]]
