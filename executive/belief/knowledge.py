"""Source and age of what is believed."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


class Source(Enum):
    """How the robot knows where a thing is."""

    MAP = "map"
    TOLD = "told"
    """By the map, which the user trusts."""
    SEEN = "seen"
    FELT = "felt"
    DONE = "done"
    """It let the thing go there, or lost it."""


class Knowledge(NamedTuple):
    """How a thing's pose is known, and since when."""

    source: Source
    time: float = 0.0
    """Plan time at which it came to be known [s]."""
    moves: int = 0
    """Number of moves of the base before."""
