"""State of one query for base poses: what its searches have found out, besides what they report."""

from __future__ import annotations

from dataclasses import field, replace

from executive.locations.base_candidates import Inversion
from executive.locations.budgets import MOST_CHECKS, MOST_SOLVED
from executive.locations.grasp_candidates import Hand
from executive.locations.rejections import Reason, Rejections
from planlang.geometry import Array
from planlang.protocols import Solution
from planlang.records import dataclass


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
