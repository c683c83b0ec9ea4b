"""What relations demand of a base, a hand or a thing, bound to bodies: tasks of a hand, and what has to hold there.

Areas of the floor are demands, too (:mod:`planlang.geometry.areas`). They need numpy, which compiling and plans in
virtual time do without: here they are types only, and relations get them from the blocks of the bodies.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import TYPE_CHECKING, Literal, Protocol

from planlang.records import dataclass

if TYPE_CHECKING:
    from planlang.geometry.areas import Block, Door

Bounds = tuple[float, float]
"""Least and greatest distance [m]."""
Subject = Literal["base", "hand", "thing"]
"""Subject of a relation to X: the robot's base, a hand with the object in it, an object."""
SUBJECTS: tuple[Subject, ...] = ("base", "hand", "thing")
Viewer = tuple[float, float]
"""Position of a viewer in the map [m]."""

HEIGHTS: Bounds = (0.02, 0.15)
"""Height above a surface that counts as above it [m]: clear of it, and near enough for putting down."""


@dataclass(frozen=True, slots=True)
class Conjunct:
    """A relation of a location, bound to bodies: relation, bodies, distances if stated [m], and negation."""

    name: str
    bodies: tuple[str, ...]
    within: float | None = None
    beyond: float | None = None
    negated: bool = False
    viewer: Viewer | None = None
    """Whose left and right is meant if a body has no front of its own."""

    @property
    def body(self) -> str:
        """The first of the bodies, or the only one."""
        return self.bodies[0]

    @property
    def words(self) -> str:
        """The conjunct in words, as reasons state it."""
        words = f"{self.name.strip('_').replace('_', ' ')} {' and '.join(self.bodies)}"
        return f"not {words}" if self.negated else words


class ReachKind(Enum):
    """Purpose of a hand pose, by precedence: the first of several conjuncts generates poses, the others filter."""

    RETREAT = "retreat"
    """Retreat, raised, with the held thing."""
    GRASP = "grasp"
    OFFER = "offer"
    """Hold something where a person takes it."""
    PLACE = "place"
    ABOVE = "above"


@dataclass(frozen=True, slots=True)
class Reach:
    """Task of a hand with respect to one body."""

    kind: ReachKind
    body: str
    grasp: str | None = None
    """Required grasp class."""
    arms: tuple[str, ...] | None = None
    """Names of the arms that may do it; None: all."""
    heights: Bounds = HEIGHTS
    """For ABOVE: bounds of the lowest point's height above the body's top [m]."""
    inside: bool = False
    """For PLACE: True in the body, False on it."""
    also: tuple[Conjunct, ...] = ()
    """Other conjuncts for the hand."""
    before: bool = False
    """For GRASP and RETREAT: True if these apply to the pre-grasp pose instead of the grasp pose."""
    then: tuple[Reach, ...] = ()
    """For GRASP: later tasks of hands with the thing, which the grip has to suit."""
    clear: tuple[str, ...] = ()
    """For PLACE: doors and drawers that later steps move, whose way and handles stay free."""

    def bodies(self) -> tuple[str, ...]:
        """Return the bodies that the task and its other conjuncts name."""
        return self.body, *(body for term in self.also for body in term.bodies)


@dataclass(frozen=True, slots=True)
class See:
    """The camera of a base sees a body."""

    body: str


@dataclass(frozen=True, slots=True)
class Rest:
    """A thing rests on a body, or inside it."""

    body: str
    inside: bool = False


@dataclass(frozen=True, slots=True)
class InZone:
    """A thing, or a hand, is inside a person's comfort zone."""

    person: str


@dataclass(frozen=True, slots=True)
class AtGrip:
    """A hand is where a body is gripped."""

    body: str


@dataclass(frozen=True, slots=True)
class BeforeGrip:
    """A hand is at the pre-grasp of a body."""

    body: str


@dataclass(frozen=True, slots=True)
class Over:
    """A level hand is over a body, its lowest point within heights above the body's top [m]."""

    body: str
    heights: Bounds


class Bodies(Protocol):
    """What relations ask about bodies, which are given by name."""

    def block(self, name: str) -> Block:
        """Compute its block."""
        ...

    def doors(self, name: str) -> Sequence[Door]:
        """List its doors, or itself."""
        ...

    def front(self, name: str) -> float | None:
        """Compute the heading of its front in the map [rad]; None if it has none."""
        ...

    def support(self, name: str) -> str | None:
        """Find what it stands on."""
        ...

    def rests_at(self, name: str) -> float | None:
        """Compute the height of its level top, or of a room's floor [m]; None without one."""
        ...

    def size(self, name: str) -> tuple[float, float, float]:
        """Look up its extents [m]."""
        ...

    def names(self) -> Sequence[str]:
        """List all bodies."""
        ...

    def is_room(self, name: str) -> bool:
        """Check whether it is a room."""
        ...

    def is_person(self, name: str) -> bool:
        """Check whether it is a person."""
        ...

    def is_solid(self, name: str) -> bool:
        """Check whether it can be touched, which a mere place cannot."""
        ...

    def is_graspable(self, name: str) -> bool:
        """Check whether a hand can grasp it."""
        ...

    def is_held(self, name: str) -> bool:
        """Check whether a hand holds it."""
        ...
