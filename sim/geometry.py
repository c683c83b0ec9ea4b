"""Small spatial mathematics on NumPy arrays: quaternions are (x, y, z, w), boxes are centre, axes, half extents."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planlang.protocols import Array, Pose

_FIRST, _SECOND = np.array([5, 1, 2, 1, 0, 6, 2, 6, 0]), np.array([10, 11, 7, 11, 10, 3, 7, 3, 5])
_SIGN = np.array([[1.0], [-1.0], [1.0], [1.0], [1.0], [-1.0], [-1.0], [1.0], [1.0]])
"""Entry k of a rotation matrix, by rows, is made of two products of parts i and j of a quaternion, number 4 i + j."""


def rotations(quaternions: Array) -> Array:
    """(n, 4) unit quaternions -> (n, 3, 3) rotation matrices."""
    parts = quaternions.T
    products = (2 * (parts[:, None] * parts)).reshape(16, -1)
    entries = products[_FIRST] + _SIGN * products[_SECOND]
    entries[::4] = 1 - entries[::4]
    return np.ascontiguousarray(entries.T).reshape(-1, 3, 3)


def overlaps(lower: Array, upper: Array, other_lower: Array, other_upper: Array) -> NDArray[np.bool_]:
    """(n, m): which of n boxes along the map's axes, told by their corners (n, 3), overlap which of m others."""
    found = lower[:, 0, None] <= other_upper[:, 0]
    found &= upper[:, 0, None] >= other_lower[:, 0]
    for axis in (1, 2):
        found &= lower[:, axis, None] <= other_upper[:, axis]
        found &= upper[:, axis, None] >= other_lower[:, axis]
    return np.asarray(found)


def rotation(pose: Pose) -> Array:
    """(3, 3) rotation matrix of a pose."""
    return pose.matrix()[:3, :3]


def facing(origin: Sequence[float], forward: Array, up: Array) -> Pose:
    """The pose at ``origin`` whose x axis points along ``forward`` and whose z axis is as near to ``up`` as can be."""
    x = forward / np.linalg.norm(forward)
    y = np.cross(up, x)
    if float(np.linalg.norm(y)) < 1e-9:
        y = np.cross(np.array([1.0, 0.0, 0.0]) if abs(x[0]) < 0.9 else np.array([0.0, 1.0, 0.0]), x)
    y = y / np.linalg.norm(y)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, y, np.cross(x, y), np.asarray(origin, dtype=float)
    return Pose.from_matrix(matrix)


def corners(pose: Pose, size: Sequence[float] | Array) -> Array:
    """(8, 3) corners of the box of that size whose centre is at the pose."""
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)
    points: Array = signs * (np.asarray(size, dtype=float) / 2) @ rotation(pose).T + np.asarray(pose.position)
    return points


def hull(points: Array) -> Array:
    """Convex hull of (n, 2) points, counter-clockwise, (m, 2): Andrew's monotone chain."""
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
    """Area of a counter-clockwise polygon (n, 2)."""
    if len(polygon) < 3:
        return 0.0
    following = np.roll(polygon, -1, axis=0)
    return float(np.sum(polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]) / 2)


def inside(polygon: Array, point: Sequence[float] | Array, margin: float = 0.0) -> bool:
    """Whether a point is in a counter-clockwise convex polygon (n, 2), by ``margin`` from every edge."""
    if len(polygon) < 3:
        return False
    edges = np.roll(polygon, -1, axis=0) - polygon
    to_point = np.asarray(point, dtype=float)[:2] - polygon
    distance = (edges[:, 0] * to_point[:, 1] - edges[:, 1] * to_point[:, 0]) / np.linalg.norm(edges, axis=1)
    return bool(np.all(distance >= margin - 1e-9))
