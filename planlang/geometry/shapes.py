"""Boxes, convex outlines in the plane, and convex solids.

Boxes are oriented, given by pose and extents, or axis-aligned in the map, given by lower and upper corner. Outlines are
counter-clockwise polygons (n, 2). Solids are the convex hulls of points: boxes, cylinders, spheres, capsules and
meshes.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from planlang.geometry.matrices import Array, Pose, moved, rotated
from planlang.records import dataclass

Size = tuple[float, float, float]
"""Extents along a box's own axes [m]."""

_SIGNS = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)


def corners(pose: Pose, size: Sequence[float] | Array) -> Array:
    """Corners (8, 3) of a box with its centre at the pose."""
    return moved(pose.matrix(), _SIGNS * (np.asarray(size, dtype=float) / 2))


def half_extents(pose: Pose, size: Sequence[float] | Array) -> Array:
    """Half extents (3,) of the axis-aligned bounding box of a box at the pose."""
    return rotated(np.abs(pose.rotation), np.asarray(size, dtype=float) / 2)


def overlaps(lower: Array, upper: Array, other_lower: Array, other_upper: Array) -> NDArray[np.bool_]:
    """Test which of n axis-aligned boxes, given by corners (n, 3), overlap which of m others; returns (n, m)."""
    found = lower[:, 0, None] <= other_upper[:, 0]
    found &= upper[:, 0, None] >= other_lower[:, 0]
    for axis in (1, 2):
        found &= lower[:, axis, None] <= other_upper[:, axis]
        found &= upper[:, axis, None] >= other_lower[:, axis]
    return np.asarray(found)


AROUND = 16
"""Corners of the polygon that approximates a circle, within 2 % of its radius; divisible by 4, to hit the axes."""


def outline_of(points: Array) -> Array:
    """Convex hull (m, 2) of points (n, 2), counter-clockwise; Andrew's monotone chain (1979)."""
    ordered = sorted({(float(x), float(y)) for x, y in points})
    if len(ordered) < 3:
        return np.array(ordered, dtype=float).reshape(-1, 2)

    def half(sequence: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
        chain: list[tuple[float, float]] = []
        for point in sequence:
            while len(chain) >= 2 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        return chain[:-1]

    return np.array(half(ordered) + half(ordered[::-1]), dtype=float)


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def area(polygon: Array) -> float:
    """Area of a polygon (n, 2) [m^2]."""
    if len(polygon) < 3:
        return 0.0
    following = np.roll(polygon, -1, axis=0)
    return float(np.sum(polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]) / 2)


def inside(polygon: Array, point: Sequence[float] | Array, margin: float = 0.0) -> bool:
    """Test whether a point is inside a convex polygon (n, 2), at least ``margin`` [m] from every edge."""
    if len(polygon) < 3:
        return False
    edges = np.roll(polygon, -1, axis=0) - polygon
    to_point = np.asarray(point, dtype=float)[:2] - polygon
    distance = (edges[:, 0] * to_point[:, 1] - edges[:, 1] * to_point[:, 0]) / np.linalg.norm(edges, axis=1)
    return bool(np.all(distance >= margin - 1e-9))


def footprint(pose: Pose, size: Sequence[float], *, cylinder: bool = False) -> Array:
    """Outline (n, 2) of a body seen from above; an upright cylinder becomes a 16-gon."""
    if cylinder and abs(pose.rotation[2, 2]) > 0.99:
        angles = np.arange(AROUND) * (2 * np.pi / AROUND)
        circle = np.stack([np.cos(angles), np.sin(angles)], axis=1) * max(size[0], size[1]) / 2
        return outline_of(circle + np.asarray(pose.position[:2]))
    return outline_of(corners(pose, size)[:, :2])


class SolidKind(StrEnum):
    """Kinds of convex solids; round ones have their axis along z."""

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"
    CAPSULE = "capsule"
    MESH = "mesh"


@dataclass(frozen=True, slots=True, eq=False)
class ConvexSolid:
    """A convex solid: its kind, its extents (zero for a mesh) and its pose.

    It is the convex hull of ``points`` (n, 3) [m] in its own frame, inflated by ``radius`` for a sphere. A round shape
    extends past the hull by up to ``beyond`` [m].
    """

    kind: SolidKind
    size: Size
    pose: Pose
    points: Array
    radius: float = 0.0
    beyond: float = 0.0


def convex_solid(kind: SolidKind, size: Size, pose: Pose) -> ConvexSolid:
    """Make a primitive at a pose; the height of a capsule excludes its caps."""
    x, y, z = size
    if kind == SolidKind.BOX:
        points = np.array([np.where(side, size, np.negative(size)) / 2 for side in np.ndindex(2, 2, 2)])
    elif kind == SolidKind.SPHERE:
        points = np.zeros((1, 3))
    else:
        points = _round(max(x, y) / 2, z, capped=kind == SolidKind.CAPSULE)
    if kind == SolidKind.SPHERE:
        return ConvexSolid(kind, size, pose, points, radius=max(x, y) / 2)
    share = {SolidKind.BOX: 0.0, SolidKind.CYLINDER: 1.0 - np.cos(np.pi / AROUND)}.get(
        kind, 1.0 - np.cos(np.pi / AROUND) ** 2
    )
    return ConvexSolid(kind, size, pose, points, beyond=float(share) * max(x, y) / 2)


def _round(radius: float, height: float, *, capped: bool) -> Array:
    """Points on the rims of a cylinder along z and, if ``capped``, on the hemispheres at its ends."""
    turns = np.arange(AROUND) * 2 * np.pi / AROUND
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    tilts = np.arange(AROUND // 4 + 1 if capped else 1) * 2 * np.pi / AROUND
    levels = [(height / 2 + radius * np.sin(tilt), radius * np.cos(tilt)) for tilt in tilts]
    rows = [np.column_stack([wide * ring, np.full(AROUND, side * z)]) for z, wide in levels for side in (-1, 1)]
    return np.concatenate(rows)
