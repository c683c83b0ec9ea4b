"""Source and age of what is believed, and holds of hands on things."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from planlang.geometry import Pose
from planlang.records import dataclass


class Source(Enum):
    """The source from which the robot knows where a thing is."""

    MAP = "map"
    TOLD = "told"
    """By the map, which the user trusts."""
    SEEN = "seen"
    FELT = "felt"
    DONE = "done"
    """It let the thing go there, or lost it."""


class Knowledge(NamedTuple):
    """The source of a thing's pose, and the time since which it is known."""

    source: Source
    time: float = 0.0
    """Plan time at which it came to be known [s]."""
    moves: int = 0
    """Number of moves of the base before."""


class Hold(NamedTuple):
    """One hand of several on a thing."""

    arm: str
    link: str
    offset: Pose
    """Pose of the thing in the link's frame."""


@dataclass(frozen=True, slots=True)
class Grip:
    """A hold on a thing: of a hand, the first one, and of others."""

    arm: str
    link: str
    offset: Pose
    """Pose of the thing in the link's frame."""
    before: Pose
    """Pose of the thing in the map when it was grasped: what locations relative to it refer to until it is let go."""
    others: tuple[Hold, ...] = ()
    riders: tuple[str, ...] = ()
    """Things that stand on it and go with it."""

    @property
    def hands(self) -> tuple[Hold, ...]:
        """Return the holds of all hands."""
        return (Hold(self.arm, self.link, self.offset), *self.others)

    @property
    def arms(self) -> tuple[str, ...]:
        """Return the arms whose hands hold it."""
        return tuple(hand.arm for hand in self.hands)
