"""Blocks, which bodies are seen from above, and areas of the floor (or of a surface) that are described by them.

``Area`` lies within a distance of a block, on some sides of it; ``Strip`` between two; ``Facing`` is a heading,
``Clear`` the space outside a block and the sweep of its doors. Distances are between outlines seen from above.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from planlang.geometry.matrices import Array, Pose
from planlang.geometry.shapes import outline_of
from planlang.records import dataclass

FACING = math.radians(30)
"""Angle from its heading within which a base faces something [rad]."""
HAIR = 1e-3
"""Margin of an area's border, since poses are rounded to a tenth of a millimetre [m]."""
STEEPEST = math.sqrt(2)
"""Greatest approach to a border per metre of motion: being on a side depends on a difference of two distances."""
POOREST = 1e-12
"""Smallest score of a point inside an area."""
THINNEST = 0.05
"""Least half width of what a strip leads to [m]: a mere place has no size."""
ROUND = 64
"""Corners of a round outline: they are within a thousandth of the radius."""


Bounds = tuple[float, float]
"""Least and greatest distance [m]."""


@dataclass(frozen=True, slots=True)
class Block:
    """Vertical prism over an oriented rectangle; lengths [m], ``yaw`` of its local x in the map [rad]."""

    x: float
    y: float
    yaw: float
    half_x: float
    half_y: float
    low: float
    high: float
    round: bool = False
    """True for an upright cylinder."""
    wall: float = 0.0
    """Wall thickness of a vessel that is open at the top [m]; 0 for a solid body."""
    soft: bool = False
    """True for cloth, which folds between fingers that close on it from above."""
    axis: float | None = None
    """Yaw of the axis of a lying cylinder in the map [rad]; None for other bodies."""

    @staticmethod
    def of(pose: Pose, size: tuple[float, float, float], *, cylinder: bool = False) -> Block:
        """Fit the smallest prism around a box of extents ``size`` [m], aligned with its most horizontal axis."""
        rotation = pose.matrix()[:3, :3]
        half = np.asarray(size) / 2
        vertical = int(np.argmax(np.abs(rotation[2])))
        first = (vertical + 1) % 3 if vertical else 1
        if vertical == 2:
            first = 0
        yaw = math.atan2(rotation[1, first], rotation[0, first])
        along = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        across = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
        half_x, half_y = (float(np.abs(axis @ rotation) @ half) for axis in (along, across))
        half_z = float(np.abs(rotation[2]) @ half)
        x, y, z = pose.position
        stands = cylinder and vertical == 2
        axis = math.atan2(rotation[1, 2], rotation[0, 2]) if cylinder and not stands else None
        return Block(x, y, yaw, half_x, half_y, z - half_z, z + half_z, stands, axis=axis)

    @property
    def centre(self) -> Array:
        """Centre of the prism, (3,)."""
        return np.array([self.x, self.y, (self.low + self.high) / 2])

    def to_map(self, local: Array) -> Array:
        """Transform points (n, 2) from the rectangle's frame to the map."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.asarray(local @ np.array([[c, s], [-s, c]]) + np.array([self.x, self.y]))

    def to_local(self, points: Array) -> Array:
        """Transform points (n, 2 or more) from the map to the rectangle's frame, (n, 2)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.asarray((points[:, :2] - np.array([self.x, self.y])) @ np.array([[c, -s], [s, c]]))

    def distance(self, points: Array) -> Array:
        """Compute the horizontal distances (n,) of map points (n, 2) from the outline, 0 inside [m]."""
        if self.round:
            away = np.hypot(points[:, 0] - self.x, points[:, 1] - self.y) - max(self.half_x, self.half_y)
            return np.asarray(np.maximum(away, 0.0))
        outside = np.maximum(np.abs(self.to_local(points)) - np.array([self.half_x, self.half_y]), 0.0)
        return np.asarray(np.hypot(outside[:, 0], outside[:, 1]))

    def away(self, point: Array) -> float:
        """Compute the distance of a map point (3,) from the prism, 0 inside [m]."""
        return float(np.linalg.norm(point - self.nearest(point)))

    def nearest(self, point: Array) -> Array:
        """Find the point (3,) of the prism that is nearest to a map point (3,)."""
        half = np.array([self.half_x, self.half_y])
        local = self.to_local(point[None, :2])
        clipped = np.clip(local, -half, half)
        if self.round:
            clipped = local * min(1.0, self.half_x / max(float(np.linalg.norm(local)), 1e-9))
        return np.array([*self.to_map(clipped)[0], np.clip(point[2], self.low, self.high)])

    def support(self, direction: float) -> float:
        """Compute the extent of the prism from its centre in a heading of the map (its support function) [m]."""
        if self.round:
            return max(self.half_x, self.half_y)
        turn = direction - self.yaw
        return abs(math.cos(turn)) * self.half_x + abs(math.sin(turn)) * self.half_y

    def around(self, words: str, body: str, headings: tuple[float, ...], bounds: Bounds, radius: float) -> Area:
        """Make the area within distances of it [m], on sides with these headings [rad], all around without any."""
        return Area(words, body, self, radius, *bounds, headings)

    def inside(self, words: str, body: str, radius: float, *, negated: bool = False) -> Area:
        """Make the places of a round outline of a radius [m] that is wholly inside it, or wholly outside if negated.

        In a room that is narrower than the outline its middle is on the middle line.
        """
        if negated:
            return Area(words, body, self, radius, 0.0, 0.0, negated=True)
        half_x, half_y = max(self.half_x - radius, 0.0), max(self.half_y - radius, 0.0)
        return Area(words, body, replace(self, half_x=half_x, half_y=half_y), 0.0, 0.0, 0.0)

    def towards(self, words: str, other: Block) -> Strip:
        """Make the strip between it and another block."""
        return Strip(words, self, other)

    def faced(self, words: str) -> Facing:
        """Make the headings of a base towards it."""
        return Facing(words, self)

    def cleared(self, words: str, body: str, doors: tuple[Door, ...], radius: float) -> Clear:
        """Make the places clear of it and of doors, one of which may be the body itself, which its sweep surrounds."""
        is_door = any(door.name == body for door in doors)
        return Clear(words, None if is_door else self, doors, radius)

    def covers(self, other: Block) -> bool:
        """Check whether the outline has all of another's inside."""
        return not self.distance(other.outline()).any()

    def outline(self) -> Array:
        """Corners (n, 2) of the outline in the map; those of a polygon inside a round one."""
        half = np.maximum([self.half_x, self.half_y], THINNEST)
        if not self.round:
            return self.to_map(half * [[1, 1], [-1, 1], [-1, -1], [1, -1]])
        turns = np.arange(ROUND) * (2 * math.pi / ROUND)
        return self.to_map(half.max() * np.column_stack([np.cos(turns), np.sin(turns)]))

    def grid(self, spacing: float, inset: float) -> Array:
        """Sample map points (n, 2) over the rectangle shrunk by ``inset``, about ``spacing`` apart; at least one."""
        axes = []
        for half in (self.half_x, self.half_y):
            reach = max(half - inset, 0.0)
            axes.append(np.linspace(-reach, reach, 2 * round(reach / spacing) + 1))
        mesh = np.stack(np.meshgrid(axes[0], axes[1], indexing="ij"), -1).reshape(-1, 2)
        return self.to_map(mesh)


@dataclass(frozen=True, slots=True)
class Door:
    """Leaf on a vertical hinge: position of the hinge and width [m], heading of the closed leaf from the hinge [rad].

    Maps do not state which way it opens, so it is assumed to sweep both sides.
    """

    name: str
    x: float
    y: float
    width: float
    heading: float


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
    room: Block | None = None
    """The room that the area ends at: what is near on the other side of its wall is not in the area."""

    def score(self, points: Array) -> Array:
        """Rate points (n, 2 or more), (n,) in [0, 1]; 0 exactly if they are outside the area."""
        if self.negated:
            return np.asarray(~self._inside(points), float)
        return np.where(self._inside(points), self._preference(points), 0.0)

    def of_thing(self, block: Block) -> Area:
        """Adapt the area to a thing turned as a block: on a side its extent towards that side counts."""
        return replace(self, radius=block.support(self.directions[0])) if self.directions else self

    def anchor(self) -> tuple[float, float, float, float] | None:
        """Centre (x, y), heading and radius of a circle around it, up to 3 m around the block; None if endless."""
        if self.negated or math.isinf(self.most):
            return None
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
        around = self._around(points, border)
        return around if self.room is None else around & (self.room.distance(points) <= border)

    def _around(self, points: Array, border: float) -> NDArray[np.bool_]:
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
class Strip:
    """Points between two blocks: on a straight line from one outline to the other, and outside of both."""

    words: str
    """The relation in words."""
    block: Block
    other: Block
    negated: bool = False

    directions: ClassVar[tuple[float, ...]] = ()
    """No side of either is meant."""

    def score(self, points: Array) -> Array:
        """Rate points (n, 2 or more), (n,) in [0, 1]: best in the middle; 0 exactly if they are outside the strip."""
        points = points[:, :2]
        gaps = self.block.distance(points), self.other.distance(points)
        inside = (self._beyond(points) <= HAIR) & (gaps[0] > 0) & (gaps[1] > 0)
        if self.negated:
            return np.asarray(~inside, float)
        heading = self._heading()
        aside = (points - self._middle()) @ [-math.sin(heading), math.cos(heading)]
        width = min(one.support(heading + math.pi / 2) for one in (self.block, self.other)) + THINNEST
        halfway = 1.0 - np.abs(gaps[0] - gaps[1]) / np.maximum(gaps[0] + gaps[1], HAIR)
        return np.where(inside, np.maximum(halfway * np.exp(-((aside / width) ** 2)), POOREST), 0.0)

    def of_thing(self, block: Block) -> Strip:
        """Of a thing the middle counts, however it is turned."""
        return self

    def anchor(self) -> tuple[float, float, float, float] | None:
        """Centre (x, y), heading and radius of a circle around both outlines; None if it is endless."""
        middle = self._middle()
        radius = float(np.linalg.norm(self._outline() - middle, axis=1).max())
        return None if self.negated else (float(middle[0]), float(middle[1]), self._heading(), radius)

    def nearly(self, points: Array, within: float) -> NDArray[np.bool_]:
        """Check whether the strip may have a point ``within`` [m] of points (n, 2); False is certain (n,)."""
        beyond = self._beyond(points)
        if not self.negated:
            return np.asarray(beyond <= HAIR + within)
        outside = np.minimum(self.block.distance(points), self.other.distance(points)) > within
        return np.asarray(~((beyond <= HAIR - within) & outside))

    def _middle(self) -> Array:
        """Point (2,) halfway between the centres."""
        return (self.block.centre + self.other.centre)[:2] / 2

    def _heading(self) -> float:
        """Heading from one centre to the other [rad]."""
        return math.atan2(self.other.y - self.block.y, self.other.x - self.block.x)

    def _outline(self) -> Array:
        """Corners (n, 2) of the hull of both outlines, counter-clockwise."""
        return outline_of(np.concatenate([self.block.outline(), self.other.outline()]))

    def _beyond(self, points: Array) -> Array:
        """How far points are outside the hull, beyond the edge that is farthest [m], (n,); negative inside.

        A point is between two convex outlines if and only if their hull has it: the hull consists of the lines from
        one to the other.
        """
        corners = self._outline()
        along = np.roll(corners, -1, axis=0) - corners
        outwards = np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1)[:, None]
        return np.asarray((points @ outwards.T - (corners * outwards).sum(axis=1)).max(axis=1))


Region = Area | Strip
"""Places that a relation means."""


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
        """Rate points (n, 2 or more), (n,): 1 where they are clear, slightly less close to the border, else 0."""
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
