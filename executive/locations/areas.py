"""Areas of the floor (or of a surface) that relations to a body mean: scores of points, and whether they are inside.

Directions are those of the body's own front if it has one; else of whoever looks: in front is towards the viewer, and
left is the viewer's left. Distances are between outlines seen from above.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.belief.believed_bodies import Block
from planlang.geometry import Array

SIDES: Mapping[str, tuple[float, ...]] = {
    "in_front_of": (0.0,),
    "behind": (math.pi,),
    "left_of": (math.pi / 2,),
    "right_of": (-math.pi / 2,),
    "next_to": (math.pi / 2, -math.pi / 2),
}
"""Relation -> directions relative to the front in which a place may be, within 45 degrees."""
OF_A_BASE: Mapping[str, tuple[float, float]] = {
    **dict.fromkeys(SIDES, (0.1, 1.1)),
    "near": (0.0, 1.0),
    "far_from": (2.0, math.inf),
}
"""Least and greatest distance [m] of a base, unless the designator says others."""
OF_A_THING: Mapping[str, tuple[float, float]] = {
    **dict.fromkeys(SIDES, (0.0, 0.3)),
    "near": (0.0, 0.3),
    "far_from": (0.6, math.inf),
}
"""The same of a hand or an object."""
HEIGHTS = (0.02, 0.15)
"""Least and greatest height of the lowest point over a top, for `above` [m]."""
FACING = math.radians(30)
"""A base faces what is within this angle of its heading [rad]."""
HAIR = 1e-3
"""Places come to a tenth of a millimetre: an area has its border this much farther out [m]."""
STEEPEST = math.sqrt(2)
"""How much nearer a border may come with each metre: to be on a side is a difference of two distances."""
POOREST = 1e-12
"""Score of a point that is in an area and as bad as can be."""


@dataclass(frozen=True, slots=True)
class Area:
    """Points within a distance of a block, and on some sides of it."""

    words: str
    """The relation, for people."""
    body: str
    block: Block
    radius: float
    """Of the outline of what is placed [m]."""
    least: float
    most: float
    directions: tuple[float, ...] = ()
    """Headings in the map of the sides on which a point may be; empty: on any."""
    negated: bool = False

    def score(self, points: Array) -> Array:
        """How good points (n, 2) are, (n,) in [0, 1]; 0 exactly where they are not in the area."""
        if self.negated:
            return np.asarray(~self._inside(points), float)
        return np.where(self._inside(points), self._likeable(points), 0.0)

    def holds(self, point: tuple[float, float]) -> bool:
        """Whether a point is in the area."""
        return bool(self.score(np.array([point]))[0] > 0)

    def anchor(self) -> tuple[float, float, float, float]:
        """Middle (x, y), heading and radius of a circle around the area; only as far as 3 m around the block."""
        return (
            self.block.x,
            self.block.y,
            self.block.yaw,
            math.hypot(self.block.half_x, self.block.half_y) + min(self.most + self.radius, 3.0),
        )

    def nearly(self, points: Array, within: float) -> NDArray[np.bool_]:
        """Whether the area may have a point within so many metres of points (n, 2); if not, it surely has none (n,)."""
        border = STEEPEST * within
        return self._inside(points, HAIR + border) if not self.negated else ~self._inside(points, HAIR - border)

    def _inside(self, points: Array, border: float = HAIR) -> NDArray[np.bool_]:
        """Whether points are in the area, without its negation, with its border so much farther out [m]."""
        if not self.directions:
            away = self._gap(points)
            return np.asarray((away >= self.least - border) & (away <= self.most + border))
        found = np.zeros(len(points), bool)
        for direction in self.directions:
            ahead, aside = self._along(points, direction)
            away = ahead - self.radius
            inside = (away >= self.least - border) & (away <= self.most + border) & (np.abs(aside) <= ahead + border)
            found |= inside
        return found

    def _gap(self, points: Array) -> Array:
        """Distances (n,) between the outlines, 0 where they overlap [m]."""
        return np.maximum(self.block.distance(points) - self.radius, 0.0)

    def _likeable(self, points: Array) -> Array:
        if self.directions:
            best = np.zeros(len(points))
            middle = self.least + 0.4 * (min(self.most, self.least + 2.0) - self.least)
            for direction in self.directions:
                ahead, aside = self._along(points, direction)
                width = max(min(self.most, self.least + 2.0) - self.least, 0.1)
                score = np.exp(-(((ahead - self.radius - middle) / width) ** 2) - (aside / np.maximum(ahead, 0.1)) ** 2)
                best = np.maximum(best, score)
            return np.maximum(best, POOREST)
        away = self._gap(points)
        if math.isinf(self.most):
            return np.asarray(1.0 - 0.5 * np.exp(-np.maximum(away - self.least, -HAIR)))
        share = (away - self.least) / max(self.most - self.least, 1e-6)
        return np.asarray(np.maximum(1.0 - 0.5 * share, POOREST))

    def _along(self, points: Array, direction: float) -> tuple[Array, Array]:
        """How far points are before the side of the block in a direction, and how far aside of its middle (n,) [m]."""
        c, s = math.cos(direction), math.sin(direction)
        dx, dy = points[:, 0] - self.block.x, points[:, 1] - self.block.y
        return c * dx + s * dy - self.block.support(direction), c * dy - s * dx


@dataclass(frozen=True, slots=True)
class Facing:
    """Headings of a base that point at a block."""

    words: str
    block: Block
    negated: bool = False

    def bearing(self, points: Array) -> Array:
        """Headings (n,) from points (n, 2 or more) to its middle [rad]."""
        return np.arctan2(self.block.y - points[:, 1], self.block.x - points[:, 0])

    def score(self, bases: Array) -> Array:
        """How well bases (n, 3) face it, (n,) in [0, 1]; 0 exactly where they do not."""
        bearing = self.bearing(bases)
        miss = np.abs(np.arctan2(np.sin(bases[:, 2] - bearing), np.cos(bases[:, 2] - bearing)))
        inside = miss <= FACING + HAIR
        return np.where(inside != self.negated, 1.0 if self.negated else np.cos(miss), 0.0)


def front_of(block: Block, front: float | None, viewer: tuple[float, float]) -> tuple[float, bool]:
    """The heading [rad] that counts as a body's front, and whether it is the viewer's: then left is the other side."""
    if front is not None:
        return front, False
    return math.atan2(viewer[1] - block.y, viewer[0] - block.x), True


def area_of(
    relation: str,
    words: str,
    body: str,
    block: Block,
    front: float | None,
    viewer: tuple[float, float],
    radius: float,
    bounds: tuple[float, float],
    *,
    negated: bool = False,
) -> Area:
    """The area that a relation of SIDES, "near" or "far_from" means."""
    directions: tuple[float, ...] = ()
    if relation in SIDES:
        ahead, seen = front_of(block, front, viewer)
        # from the viewer's side, left and right are exchanged
        directions = tuple(ahead + (-turn if seen else turn) for turn in SIDES[relation])
    return Area(words, body, block, radius, bounds[0], bounds[1], directions, negated)
