"""Spheres inside a convex shape, and how far the shape sticks out of them.

What one of the spheres is inside of, the shape is inside of too. What is farther from all of them than ``slack``, the
shape does not touch. In between only an exact query can tell.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from executive.motion.hulls import Hull
from planlang.cache import Cache
from planlang.geometry import Array

MOST = 24
"""Spheres in one shape."""
OUT = 0.008
"""Largest distance by which a shape may stick out of its spheres where more of them help [m]."""
CENTRES, POINTS = 250, 300
"""Approximate numbers of places for spheres that are looked at, and of surface points that measure them."""
CELLS = 16_000
"""Into about how many cells the box around a shape is divided to measure its slack."""
_CACHE = Cache("spheres", most=1000)


@dataclass(frozen=True, slots=True, eq=False)
class Spheres:
    """Centres (k, 3) and radii (k,) [m] in the shape's frame; ``slack`` [m] is explained in the module's docstring."""

    centres: Array
    radii: Array
    slack: float


def kept_spheres(hull: Hull) -> Spheres:
    """Return :func:`spheres_in`, computed once for each shape and kept in the user's cache."""
    return _kept(np.ascontiguousarray(hull.points, float).tobytes(), hull.radius, hull.beyond)


def spheres_in(hull: Hull) -> Spheres:
    """Fill a shape: again and again the sphere that leaves least of the surface far from all spheres."""
    if hull.faces is None:
        return Spheres(hull.points.copy(), np.array([hull.radius]), hull.beyond)
    cells, _ = _cells(hull, CENTRES)
    depths = hull.depths(cells)
    centres, radii = cells[depths > 1e-4], depths[depths > 1e-4]
    if not len(centres):  # thinner than a cell
        centres = hull.faces.triangles.reshape(-1, 3).mean(axis=0, keepdims=True)
        radii = np.maximum(hull.depths(centres), 1e-4)
    points = np.concatenate([hull.surface(_spacing(hull)), centres])
    away = np.maximum(_distances(points, centres) - radii, OUT)
    nearest = np.full(len(points), np.ptp(hull.points, axis=0).max())
    chosen: list[int] = []
    while len(chosen) < MOST:
        gain = np.maximum(nearest[:, None] - away, 0.0).sum(axis=0)
        best = int(np.argmax(gain.round(9)))  # of equal ones the first, whatever the last digits are
        if gain[best] <= 1e-9 and chosen:  # even the smallest shape has one
            break
        chosen.append(best)
        nearest = np.minimum(nearest, away[:, best])
        points, away, nearest = (array[nearest > OUT] for array in (points, away, nearest))
    slack = _slack(hull, centres[chosen], radii[chosen]) + hull.beyond
    return Spheres(centres[chosen], radii[chosen], slack)


def _slack(hull: Hull, centres: Array, radii: Array) -> float:
    """Return an upper bound of the distance of points of a shape from its spheres [m]."""
    cells, half = _cells(hull, CELLS)
    met = cells[hull.depths(cells) >= -half]  # every point of the shape is in one of these
    return max(0.0, float((_distances(met, centres) - radii).min(axis=1).max()) + half)


def _cells(hull: Hull, number: int) -> tuple[Array, float]:
    """Centres (c, 3) of cells of the box around a shape, and half their diagonal [m]."""
    low, high = hull.points.min(axis=0), hull.points.max(axis=0)
    size = np.maximum(high - low, 1e-3)
    pitch = float(np.cbrt(size.prod() / number))
    counts = [max(1, round(extent / pitch)) for extent in size.tolist()]
    axes = [
        middle + extent * ((np.arange(count) + 0.5) / count - 0.5)
        for middle, extent, count in zip((low + high) / 2, size, counts, strict=True)
    ]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return centres, float(np.linalg.norm(size / counts) / 2)


def _spacing(hull: Hull) -> float:
    """Return the distance of about :data:`POINTS` points spread over the surface [m]."""
    assert hull.faces is not None
    first, second = (hull.faces.triangles[:, k] - hull.faces.triangles[:, 0] for k in (1, 2))
    area = float(np.linalg.norm(np.cross(first, second), axis=1).sum() / 2)
    return max(1e-3, float(np.sqrt(area / POINTS)))


def _distances(points: Array, centres: Array) -> Array:
    """(p, c)."""
    squares = (
        (points**2).sum(axis=1)[:, None] + (centres**2).sum(axis=1) - 2.0 * np.einsum("pk,ck->pc", points, centres)
    )
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


@cache
def _kept(points: bytes, radius: float, beyond: float) -> Spheres:
    hull = Hull(np.frombuffer(points).reshape(-1, 3), radius, beyond)
    key = repr((points, radius, beyond, MOST, OUT, CENTRES, POINTS, CELLS, _method()))
    if len(hull.points) == 1:
        return spheres_in(hull)
    content = _CACHE.load(key)
    if content is not None:
        rows = np.frombuffer(content).reshape(-1, 4)
        return Spheres(rows[1:, :3], rows[1:, 3], float(rows[0, 0]))
    found = spheres_in(hull)
    _CACHE.keep(key, np.vstack([[found.slack, 0, 0, 0], np.column_stack([found.centres, found.radii])]).tobytes())
    return found


@cache
def _method() -> str:
    """Digest of what shapes the result beside the shape."""
    digest = hashlib.sha256()
    for name in ("spheres.py", "hulls.py"):
        digest.update((Path(__file__).parent / name).read_bytes())
    return digest.hexdigest()
