"""Doors, drawers and lids: bodies that turn about, or slide along, one axis; closed, their joint's value is 0.

Values are in radians for what turns, in metres for what slides; greater ones are more open.
"""

from __future__ import annotations

import math
from enum import StrEnum

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import cross_matrix, product, rotated
from planlang.records import dataclass

SHUT = 0.03
"""Share of its range up to which a joint counts as closed."""
WIDE = 0.7
"""Share of its range from which on it counts as open: 63 of 90 degrees."""
Point = tuple[float, float, float]


class JointKind(StrEnum):
    """The kinds of joints."""

    HINGED = "hinged"
    PRISMATIC = "prismatic"


@dataclass(frozen=True, slots=True)
class Articulation:
    """The joint between a leaf (a door, a drawer, a lid) and what it belongs to, at a fixed place in the map."""

    leaf: str
    """The body that moves."""
    kind: JointKind
    point: Point
    """A point of the axis in the map [m]."""
    axis: Point
    """Unit vector in the map: the leaf turns about it by the right hand, or slides along it."""
    lower: float
    upper: float
    holder: str | None = None
    """The body that it belongs to."""
    parts: tuple[str, ...] = ()
    """Bodies that move with the leaf: handles, knobs, the front of a drawer."""
    handle: str | None = None
    """The body of them by which a hand moves it."""
    first: float = 0.0
    """Its value at the beginning."""
    sign: float = 1.0
    """-1 if the file that describes it has smaller values for more open, and its axis the other way round."""

    def __post_init__(self) -> None:
        if not (self.lower <= 0.0 < self.upper and math.isfinite(self.lower + self.upper)):
            raise ValueError(f"the limits of {self.leaf} are {self.lower} and {self.upper}; 0 is closed")
        if not self.lower <= self.first <= self.upper:
            raise ValueError(f"{self.leaf} begins at {self.first}, beyond {self.lower} and {self.upper}")

    @property
    def bodies(self) -> tuple[str, ...]:
        """Return all bodies that move."""
        return (self.leaf, *self.parts)

    @property
    def is_knob(self) -> bool:
        """Return whether a hand turns the leaf itself: it opens nothing."""
        return self.handle == self.leaf

    def within(self, value: float) -> float:
        """Return the nearest value that the joint can have."""
        return min(max(value, self.lower), self.upper)

    @property
    def last_shut(self) -> float:
        """Return the greatest value at which the leaf counts as closed."""
        return SHUT * self.upper

    @property
    def first_open(self) -> float:
        """Return the least value at which the leaf counts as open."""
        return WIDE * self.upper

    def is_shut(self, value: float) -> bool:
        """Return whether the leaf counts as closed."""
        return abs(value) <= self.last_shut

    def is_open(self, value: float) -> bool:
        """Return whether the leaf counts as open."""
        return value >= self.first_open

    def motion(self, value: float) -> Pose:
        """Return how the leaf has moved in the map since it was closed (Rodrigues)."""
        axis, point = np.array(self.axis), np.array(self.point)
        if self.kind is JointKind.PRISMATIC:
            x, y, z = (value * axis).tolist()
            return Pose((x, y, z))
        x, y, z = (math.sin(value / 2) * axis).tolist()
        turn = Pose((0.0, 0.0, 0.0), (x, y, z, math.cos(value / 2)))
        x, y, z = (point - rotated(turn.rotation, point)).tolist()
        return Pose((x, y, z), turn.orientation)

    def value_at(self, closed: Array, now: Array) -> float:
        """Return the value, within the limits, at which a point of the leaf is nearest to ``now`` (3,) in the map.

        When the leaf is shut, the point is at ``closed`` (3,).
        """
        axis, point = np.array(self.axis), np.array(self.point)
        if self.kind is JointKind.PRISMATIC:
            return self.within(float((now - closed) @ axis))
        before, after = (arm - (arm @ axis) * axis for arm in (closed - point, now - point))
        angle = math.atan2(float(np.cross(before, after) @ axis), float(before @ after))
        options = (angle, angle + 2 * math.pi, angle - 2 * math.pi)
        return min(map(self.within, options), key=lambda value: min(abs(value - one) for one in options))

    def value_of(self, closed: Pose, now: Pose) -> float:
        """Return the value at which the leaf, at ``closed`` when it is shut, is at a pose."""
        if self.kind is JointKind.PRISMATIC:
            return self.value_at(np.array(closed.position), np.array(now.position))
        turn = product(now.rotation, closed.rotation.T)
        cross = cross_matrix(np.array(self.axis))
        sine, cosine = -np.trace(product(cross, turn)) / 2, (np.trace(turn) - 1) / 2
        return self.within(math.atan2(float(sine), float(cosine)))
