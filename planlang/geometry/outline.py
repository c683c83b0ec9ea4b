"""Convex outlines in the plane: polygons (n, 2), counter-clockwise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from planlang.geometry.box import corners
from planlang.geometry.matrices import Array
from planlang.geometry.pose import Pose

AROUND = 16
"""Points on a circle that stands for a round shape: within 2 % of its radius; a multiple of four, to hit the axes."""


def outline_of(points: Array) -> Array:
    """Return the convex hull (m, 2) of points (n, 2), counter-clockwise: Andrew's monotone chain (1979)."""
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
    """Return the area of a polygon (n, 2) [m^2]."""
    if len(polygon) < 3:
        return 0.0
    following = np.roll(polygon, -1, axis=0)
    return float(np.sum(polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]) / 2)


def inside(polygon: Array, point: Sequence[float] | Array, margin: float = 0.0) -> bool:
    """Return whether a point is in a convex polygon (n, 2), by ``margin`` [m] from every edge."""
    if len(polygon) < 3:
        return False
    edges = np.roll(polygon, -1, axis=0) - polygon
    to_point = np.asarray(point, dtype=float)[:2] - polygon
    distance = (edges[:, 0] * to_point[:, 1] - edges[:, 1] * to_point[:, 0]) / np.linalg.norm(edges, axis=1)
    return bool(np.all(distance >= margin - 1e-9))


def footprint(pose: Pose, size: Sequence[float], *, cylinder: bool = False) -> Array:
    """Return the outline (n, 2) of a body seen from above; of a standing cylinder 16 points of a circle."""
    if cylinder and abs(pose.rotation[2, 2]) > 0.99:
        angles = np.arange(AROUND) * (2 * np.pi / AROUND)
        circle = np.stack([np.cos(angles), np.sin(angles)], axis=1) * max(size[0], size[1]) / 2
        return outline_of(circle + np.asarray(pose.position[:2]))
    return outline_of(corners(pose, size)[:, :2])
