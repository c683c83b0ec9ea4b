"""Areas of the floor (or of a surface) described by relations to a body: scores and membership of points.

``Area`` lies within a distance of a body, ``Facing`` is a heading, ``Clear`` is the space outside a body and the sweep
of its doors. Directions are those of the body's own front if it has one; else of the viewer: in front is towards the
viewer, and left is the viewer's left. Distances are between outlines seen from above.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from executive.belief.believed_bodies import Block, Door
from planlang.geometry import Array
from planlang.records import dataclass

FACING = math.radians(30)
"""Angle from its heading within which a base faces something [rad]."""
HAIR = 1e-3
"""Margin of an area's border, since poses are rounded to a tenth of a millimetre [m]."""
STEEPEST = math.sqrt(2)
"""Greatest approach to a border per metre of motion: being on a side depends on a difference of two distances."""
POOREST = 1e-12
"""Smallest score of a point inside an area."""


@dataclass(frozen=True, slots=True)
class Area:
    """Points within a distance of a block, and on some sides of it."""

    words: str
    """The relation in words."""
    body: str
    block: Block
    radius: float
    """Radius of the outline of what is placed [m]."""
    least: float
    most: float
    directions: tuple[float, ...] = ()
    """Headings in the map of the allowed sides; empty: all."""
    negated: bool = False

    def score(self, points: Array) -> Array:
        """Rate points (n, 2), (n,) in [0, 1]; 0 exactly if they are outside the area."""
        if self.negated:
            return np.asarray(~self._inside(points), float)
        return np.where(self._inside(points), self._preference(points), 0.0)

    def holds(self, point: tuple[float, float]) -> bool:
        """Check whether a point is in the area."""
        return bool(self.score(np.array([point]))[0] > 0)

    def anchor(self) -> tuple[float, float, float, float]:
        """Centre (x, y), heading and radius of a circle around the area, up to 3 m around the block."""
        return (
            self.block.x,
            self.block.y,
            self.block.yaw,
            math.hypot(self.block.half_x, self.block.half_y) + min(self.most + self.radius, 3.0),
        )

    def nearly(self, points: Array, within: float) -> NDArray[np.bool_]:
        """Check whether the area may have a point ``within`` [m] of points (n, 2); False is certain (n,)."""
        border = STEEPEST * within
        return self._inside(points, HAIR + border) if not self.negated else ~self._inside(points, HAIR - border)

    def _inside(self, points: Array, border: float = HAIR) -> NDArray[np.bool_]:
        """Check whether points are in the area, ignoring its negation, with its border enlarged [m]."""
        if not self.directions:
            away = self._gap(points)
            return np.asarray((away >= self.least - border) & (away <= self.most + border))
        inside_any = np.zeros(len(points), bool)
        for direction in self.directions:
            ahead, aside = self._along(points, direction)
            away = ahead - self.radius
            inside = (away >= self.least - border) & (away <= self.most + border) & (np.abs(aside) <= ahead + border)
            inside_any |= inside
        return inside_any

    def _gap(self, points: Array) -> Array:
        """Distances (n,) between the outlines, 0 where they overlap [m]."""
        return np.maximum(self.block.distance(points) - self.radius, 0.0)

    def _preference(self, points: Array) -> Array:
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
        """Distances of points ahead of the block's side in a direction, and aside of it (n,) [m]."""
        c, s = math.cos(direction), math.sin(direction)
        dx, dy = points[:, 0] - self.block.x, points[:, 1] - self.block.y
        return c * dx + s * dy - self.block.support(direction), c * dy - s * dx


@dataclass(frozen=True, slots=True)
class Facing:
    """Headings of a base towards a block."""

    words: str
    block: Block
    negated: bool = False

    def bearing(self, points: Array) -> Array:
        """Headings (n,) from points (n, 2 or more) to its centre [rad]."""
        return np.arctan2(self.block.y - points[:, 1], self.block.x - points[:, 0])

    def score(self, bases: Array) -> Array:
        """Rate how well bases (n, 3) face it, (n,) in [0, 1]; 0 exactly if they do not."""
        bearing = self.bearing(bases)
        miss = np.abs(np.arctan2(np.sin(bases[:, 2] - bearing), np.cos(bases[:, 2] - bearing)))
        inside = miss <= FACING + HAIR
        return np.where(inside != self.negated, 1.0 if self.negated else np.cos(miss), 0.0)


@dataclass(frozen=True, slots=True)
class Clear:
    """Places where a round outline touches neither a block nor the sweep of its doors."""

    words: str
    block: Block | None
    """None if the body is a door itself, which its sweep surrounds."""
    doors: tuple[Door, ...]
    radius: float
    """Radius of the outline [m]."""
    negated: bool = False

    def score(self, points: Array) -> Array:
        """Rate points (n, 2), (n,): 1 where they are clear, slightly less close to the border, else 0."""
        gap = self._gap(points)
        if self.negated:
            return np.asarray(gap <= 0, float)
        return np.where(gap > 0, 0.7 + 0.3 * np.clip(gap / 0.3, 0.0, 1.0), 0.0)

    def nearly(self, points: Array, within: float) -> NDArray[np.bool_]:
        """Check whether a place within this distance [m] of points (n, 2) may be clear; False is certain (n,)."""
        gap = self._gap(points)
        return np.asarray(gap <= within if self.negated else gap > -within)

    def _gap(self, points: Array) -> Array:
        """Distances (n,) of the outline from the block and the sweeps [m]."""
        gaps = [_from_sweep(door, points) for door in self.doors]
        if self.block is not None:
            gaps.append(self.block.distance(points))
        return np.min(gaps, axis=0) - self.radius if gaps else np.full(len(points), np.inf)


def _from_sweep(door: Door, points: Array) -> Array:
    """Distances (n,) of points from the half disc that the leaf sweeps on both sides, 0 inside."""
    c, s = math.cos(door.heading), math.sin(door.heading)
    dx, dy = points[:, 0] - door.x, points[:, 1] - door.y
    along, across = c * dx + s * dy, np.abs(c * dy - s * dx)
    before = np.hypot(along, np.maximum(across - door.width, 0.0))
    return np.asarray(np.where(along >= 0, np.maximum(np.hypot(along, across) - door.width, 0.0), before))


def front_of(block: Block, front: float | None, viewer: tuple[float, float]) -> tuple[float, bool]:
    """Heading [rad] of a body's front, and whether it is the viewer's, in which case left and right swap."""
    if front is not None:
        return front, False
    return math.atan2(viewer[1] - block.y, viewer[0] - block.x), True


def area_of(
    words: str,
    body: str,
    block: Block,
    directions: tuple[float, ...],
    *,
    front: float | None,
    viewer: tuple[float, float],
    radius: float,
    bounds: tuple[float, float],
    negated: bool = False,
) -> Area:
    """Create the area within bounds of a body, on sides of it [rad from its front], or all around without any."""
    ahead, seen = front_of(block, front, viewer)
    # seen by the viewer, left and right are swapped
    headings = tuple(ahead + (-turn if seen else turn) for turn in directions)
    return Area(words, body, block, radius, bounds[0], bounds[1], headings, negated)
