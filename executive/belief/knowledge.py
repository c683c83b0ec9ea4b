"""Source and age of believed poses, and grips of hands on objects."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from planlang.geometry import Pose
from planlang.records import dataclass


class Source(Enum):
    """Source of a believed pose."""

    MAP = "map"
    TOLD = "told"
    """The map, if the user trusts it (--trust-map)."""
    SEEN = "seen"
    FELT = "felt"
    DONE = "done"
    """The robot's own action: it released, pushed or lost the object there."""


class Knowledge(NamedTuple):
    """Source and age of an object's pose."""

    source: Source
    time: float = 0.0
    """Plan time at which the pose became known [s]."""
    moves: int = 0
    """Number of motions of the base before that."""


class Hold(NamedTuple):
    """Hold of one hand on an object."""

    arm: str
    link: str
    offset: Pose
    """Pose of the object in the link's frame."""


@dataclass(frozen=True, slots=True)
class Grip:
    """Grip of one or more hands on an object; the first hand's hold is ``arm``, ``link`` and ``offset``."""

    arm: str
    link: str
    offset: Pose
    """Pose of the object in the link's frame."""
    before: Pose
    """Pose of the object in the map when it was grasped, to which relative locations refer until it is released."""
    others: tuple[Hold, ...] = ()
    """Holds of further hands."""
    riders: tuple[str, ...] = ()
    """Objects that stand on it and move with it."""

    @property
    def hands(self) -> tuple[Hold, ...]:
        """Holds of all hands."""
        return (Hold(self.arm, self.link, self.offset), *self.others)

    @property
    def arms(self) -> tuple[str, ...]:
        """Arms of all hands."""
        return tuple(hand.arm for hand in self.hands)
