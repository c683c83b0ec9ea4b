"""State of one query for base poses: budgets of its searches, and what these have found out, besides what they report.

Budgets are used one after the other until something is found.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, replace
from typing import TypeVar

import numpy as np

from executive.locations.base_candidates import Inversion
from executive.locations.grasp_candidates import Hand
from executive.locations.hand_predicates import Stage
from executive.locations.rejections import Reason, Rejections
from planlang.geometry import Array
from planlang.protocols import Solution
from planlang.records import dataclass

ALL = 1_000_000
"""More than the rows of any map, and the base poses of any candidate."""


@dataclass(frozen=True, slots=True)
class SearchBudget:
    """Budget of one search."""

    stage: Stage
    least: float
    """Smallest score of map rows to use."""
    rows: int
    """Number of rows per height of the torso."""
    each: int
    """Base poses per candidate."""
    most: int
    """Base poses in total."""
    block: int
    """Base poses per call of inverse kinematics."""
    exact: int
    """Base poses to validate exactly."""
    then: SearchBudget | None = None
    """Budget for base poses off the maps' lattice, tried if those on it fail; the search ends there."""

    @property
    def fine(self) -> bool:
        """Whether more than natural candidates are considered."""
        return self.stage > Stage.NATURAL


BETWEEN = SearchBudget(Stage.CLOSEST, least=0.0, rows=2_000, each=ALL, most=12_000, block=128, exact=500)
BUDGETS = (
    SearchBudget(Stage.NATURAL, least=0.1, rows=400, each=16, most=384, block=48, exact=40),
    SearchBudget(Stage.NATURAL, least=0.1, rows=400, each=256, most=6_000, block=48, exact=80),
    SearchBudget(Stage.ALL, least=0.05, rows=400, each=128, most=12_000, block=128, exact=150),
    SearchBudget(Stage.CLOSEST, least=0.0, rows=2_000, each=ALL, most=40_000, block=128, exact=500, then=BETWEEN),
)
MOST_CHECKS = 1_000
"""Base poses that may fail when validated exactly, in all searches for a location, until one is found.

With 250, tasks of the homes failed that reach their goal with more.
"""
MOST_SOLVED = 12_000
"""Base poses for which inverse kinematics is solved meanwhile: for a bowl in a drawer 4,000 are too few."""
EASY, EASY_CHECKS, EASY_SOLVED = 3, 100, 4_000
"""Number of budgets with which to test whether a change of the map would help, and these numbers for all changes."""

PART = 4
"""Number of changes for which these are enough at least: what one leaves is for the others."""


@dataclass(frozen=True, slots=True, eq=False)
class FreeHands:
    """Grasp candidates of arms with a collision-free hand, and the counts of the others."""

    hands: list[Hand]
    reach: float
    """Greatest horizontal distance of a base from what it reaches [m]."""
    near: tuple[Array, float]
    """Centre (3,) and radius [m] of everything that the robot may touch."""
    counted: Rejections


@dataclass(slots=True, eq=False)
class Allowance:
    """Budget shared by several searches: numbers, unlike time, repeat exactly."""

    checks: int = MOST_CHECKS
    """Number of base poses that may still fail exact validation."""
    solved: int = MOST_SOLVED
    """Number of base poses for which inverse kinematics may still be solved, to the end of a block."""

    @property
    def is_spent(self) -> bool:
        """Whether nothing more can be validated."""
        return self.checks <= 0 or self.solved <= 0

    def part(self) -> Allowance:
        """Return the part of it that one of several searches may use: what is left, but no more than a share."""
        return Allowance(min(self.checks, EASY_CHECKS // PART), min(self.solved, EASY_SOLVED // PART))

    def grant(self, checks: int, solved: int) -> None:
        """Raise what is left to at least these numbers."""
        self.checks, self.solved = max(self.checks, checks), max(self.solved, solved)


@dataclass(slots=True, eq=False)
class Findings:
    """Findings of the searches for one location that later ones reuse, whatever has to be visible."""

    allowance: Allowance = field(default_factory=Allowance)
    """Shared by all searches for the location."""
    walled: bool = False
    """True if a place was rejected because the base cannot drive there; others are then tested for that first."""
    blind: Solution | None = None
    """First base pose that lacked only sight of the handled things: usable after a look from elsewhere."""
    untried: bool = False
    """True if candidates were left unexamined: there may be more without the need for sight."""
    stopped: dict[tuple[object, ...], Reason | None] = field(default_factory=dict)
    """Grasp candidates, and why the hand itself cannot perform them wherever the base stands; None if it can."""
    met: set[bytes] = field(default_factory=set)
    """Candidates that an arm cannot perform."""
    rooms: dict[bytes, bool] = field(default_factory=dict)
    """Base poses, and whether there is room for the base."""
    stances: dict[bytes, str | None] = field(default_factory=dict)
    """Base poses, and what an arm in its present posture collides with there, if anything."""
    hands: dict[int, FreeHands] = field(default_factory=dict)
    """By the stage of a search."""
    inversions: dict[tuple[int, float, int, bool], Inversion] = field(default_factory=dict)
    """By the stage of a search, the bounds of rows, and whether paths were required."""


@dataclass(frozen=True, slots=True)
class Question:
    """A location to search for: ``log`` receives rejections, ``known`` holds findings."""

    log: Rejections = field(default_factory=Rejections)
    known: Findings = field(default_factory=Findings)

    def uncounted(self) -> Question:
        """Copy the question with an empty log, for candidates that were counted already."""
        return replace(self, log=self.log.uncounted())


T = TypeVar("T")


def as_keys(rows: Array) -> list[bytes]:
    """Convert rows (n, k) to hashable values."""
    keys: list[bytes] = np.ascontiguousarray(rows).view(f"V{rows.itemsize * rows.shape[1]}").ravel().tolist()
    return keys


def once(known: dict[bytes, T], rows: Array, find: Callable[[Array], Sequence[T]]) -> list[T]:
    """Look up results about rows (n, k); ``find`` computes those that are not ``known``."""
    keys = as_keys(rows)
    if new := {key: number for number, key in enumerate(keys) if key not in known}:
        known.update(zip(new, find(rows[list(new.values())]), strict=True))
    return [known[key] for key in keys]
