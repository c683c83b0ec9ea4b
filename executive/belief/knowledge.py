"""Source and age of believed poses."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple


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
