"""One question for base poses: what its searches know, and decide by, beside what they report."""

from __future__ import annotations

from dataclasses import field, replace

from executive.locations.base_candidates import Inversion
from executive.locations.grasp_candidates import Hand
from executive.locations.rejections import Reason, Rejections
from planlang.geometry import Array
from planlang.protocols import Solution
from planlang.records import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class FreeHands:
    """Grasp candidates of arms in which the hand itself is inside nothing, and how others were counted."""

    hands: list[Hand]
    reach: float
    """Farthest that a base is from what it reaches, horizontally [m]."""
    near: tuple[Array, float]
    """Middle (3,) and radius [m] of all that the robot may meet."""
    counted: Rejections


@dataclass(slots=True, eq=False)
class Findings:
    """What searches for one location have found out, for the later ones, whatever has to be seen from a base pose."""

    walled: bool = False
    """True if a place was rejected because the base cannot drive there: others are asked for that first, then."""
    blind: Solution | None = None
    """The first base pose that lacked nothing but sight of what is handled: it will do after a look from elsewhere."""
    untried: bool = False
    """True if not all candidates were looked at: without sight there may be more."""
    stopped: dict[tuple[object, ...], Reason | None] = field(default_factory=dict)
    """Grasp candidates, and why the hand itself cannot do them, wherever the base stands; None if it can."""
    met: set[bytes] = field(default_factory=set)
    """Candidates that an arm cannot do."""
    rooms: dict[bytes, bool] = field(default_factory=dict)
    """Base poses, and whether there is room for the base."""
    stances: dict[bytes, str | None] = field(default_factory=dict)
    """Base poses, and what an arm in its present posture is inside of there, None if nothing."""
    hands: dict[int, FreeHands] = field(default_factory=dict)
    """By the stage of a search."""
    inversions: dict[tuple[int, float, int, bool], Inversion] = field(default_factory=dict)
    """By the stage of a search, the bounds of rows, and whether ways were asked for."""


@dataclass(frozen=True, slots=True)
class Question:
    """A location that is searched for: ``log`` receives what is refused, and why; ``known`` is what is found out."""

    log: Rejections = field(default_factory=Rejections)
    known: Findings = field(default_factory=Findings)

    def uncounted(self) -> Question:
        """Return the same question with a log of what has not been counted yet."""
        return replace(self, log=self.log.uncounted())
