"""Spheres inside a convex shape, and how far the shape sticks out of them; for that its faces.

What one of the spheres is inside of, the shape is inside of too. What is farther from all of them than ``slack``, the
shape does not touch. In between only an exact query can tell.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planlang.cache import Cache
from planlang.geometry import Array

MOST = 24
"""Spheres in one shape."""
OUT = 0.008
"""Largest distance by which a shape may stick out of its spheres where more of them help [m]."""
CENTRES, POINTS = 250, 300
"""Approximate numbers of places for spheres that are looked at, and of surface points that measure them."""
CELLS = 16_000
"""Into about how many cells the box around a shape is divided to measure its slack.

The slack comes out too large by half the diagonal of a cell: 5 mm for a link of 10 by 10 by 30 cm.
"""
FLAT = 1e-7
"""Points nearer to a face than this are on it [m]: rounding of coordinates of some metres stays below."""
THINNEST = 1e-3
"""Least extent of a shape: flatter ones are thickened to it [m], that they have an inside."""
_CACHE = Cache("spheres", most=1000)


@dataclass(frozen=True, slots=True, eq=False)
class Spheres:
    """Centres and radii (k, 4) [m] in the shape's frame; ``slack`` [m] is explained in the module's docstring."""

    balls: Array
    slack: float


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """The surface of a convex polyhedron: x is inside where normals (f, 3) @ x <= offsets (f,)."""

    triangles: Array
    """Corners (f, 3, 3)."""
    normals: Array
    offsets: Array

    def depths(self, places: Array) -> Array:
        """Return depths of points (m, 3) inside (m,) [m]; negative outside, and there no more than a bound."""
        return np.asarray((self.offsets - np.einsum("mk,fk->mf", places, self.normals)).min(axis=1))

    def surface(self, spacing: float) -> Array:
        """Points (m, 3) on the surface, such that no point of it is farther from one than ``spacing`` [m]."""
        pending, done = self.triangles, [self.triangles.reshape(-1, 3)]
        while len(pending):  # halve the longest side; the corners of one that is short enough are near to all of it
            sides = np.linalg.norm(np.roll(pending, -1, axis=1) - pending, axis=2)
            long = sides.max(axis=1) > np.sqrt(3.0) * spacing
            pending, first = pending[long], np.argmax(sides[long], axis=1)
            rows = np.arange(len(pending))
            a, b, c = (pending[rows, (first + k) % 3] for k in range(3))
            middle = (a + b) / 2
            done.append(middle)
            pending = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        return np.concatenate(done)

    def spacing(self) -> float:
        """Return the distance of about :data:`POINTS` points spread over the surface [m]."""
        first, second = (self.triangles[:, k] - self.triangles[:, 0] for k in (1, 2))
        area = float(np.linalg.norm(np.cross(first, second), axis=1).sum() / 2)
        return max(1e-3, float(np.sqrt(area / POINTS)))


@cache
def kept_spheres(points: bytes, radius: float, beyond: float) -> Spheres:
    """Return :func:`spheres_in` of points (n, 3), as bytes, computed once and kept in the user's cache."""
    rows = np.frombuffer(points).reshape(-1, 3)
    if len(rows) == 1:
        return spheres_in(rows, radius, beyond)
    key = repr((points, radius, beyond, _method()))
    content = _CACHE.load(key)
    if content is not None:
        kept = np.frombuffer(content).reshape(-1, 4)
        return Spheres(kept[1:], float(kept[0, 0]))
    found = spheres_in(rows, radius, beyond)
    _CACHE.keep(key, np.vstack([[found.slack, 0, 0, 0], found.balls]).tobytes())
    return found


def spheres_in(points: Array, radius: float = 0.0, beyond: float = 0.0) -> Spheres:
    """Fill the hull of points (n, 3): again and again by the sphere that leaves least surface far from all spheres.

    A single point means the ball of a ``radius`` [m]; ``beyond`` [m] is how far the shape goes beyond the hull.
    """
    if len(points) == 1:
        return Spheres(np.append(points, [[radius]], axis=1), beyond)
    faces = faces_of(points)
    cells, _ = _cells(points, CENTRES)
    depths = faces.depths(cells)
    centres, radii = cells[depths > 1e-4], depths[depths > 1e-4]
    if not len(centres):  # thinner than a cell
        centres = faces.triangles.reshape(-1, 3).mean(axis=0, keepdims=True)
        radii = np.maximum(faces.depths(centres), 1e-4)
    marks = np.concatenate([faces.surface(faces.spacing()), centres])
    away = np.maximum(_distances(marks, centres) - radii, OUT)
    nearest = np.full(len(marks), np.ptp(points, axis=0).max())
    chosen: list[int] = []
    while len(chosen) < MOST:
        gain = np.maximum(nearest[:, None] - away, 0.0).sum(axis=0)
        best = int(np.argmax(gain.round(9)))  # of equal ones the first, whatever the last digits are
        if gain[best] <= 1e-9 and chosen:  # even the smallest shape has one
            break
        chosen.append(best)
        nearest = np.minimum(nearest, away[:, best])
        marks, away, nearest = (array[nearest > OUT] for array in (marks, away, nearest))
    centres, radii = centres[chosen], radii[chosen]
    cells, half = _cells(points, CELLS)
    met = cells[faces.depths(cells) >= -half]  # every point of the shape is in one of these
    slack = max(0.0, float((_distances(met, centres) - radii).min(axis=1).max()) + half)
    return Spheres(np.column_stack([centres, radii]), slack + beyond)


def _cells(points: Array, number: int) -> tuple[Array, float]:
    """Return centres (c, 3) of cells of the box around points, and half their diagonal [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 1e-3)
    pitch = float(np.cbrt(size.prod() / number))
    counts = [max(1, round(extent / pitch)) for extent in size.tolist()]
    axes = [
        middle + extent * ((np.arange(count) + 0.5) / count - 0.5)
        for middle, extent, count in zip((low + high) / 2, size, counts, strict=True)
    ]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return centres, float(np.linalg.norm(size / counts) / 2)


def _distances(points: Array, centres: Array) -> Array:
    """Return distances (p, c) between points (p, 3) and centres (c, 3)."""
    products = np.einsum("pk,ck->pc", points, centres)
    squares = (points**2).sum(axis=1)[:, None] + (centres**2).sum(axis=1) - 2.0 * products
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


@cache
def _method() -> str:
    """Return a digest of what the result depends on beside the shape: this file."""
    return hashlib.sha256(Path(__file__).read_bytes()).hexdigest()


def _thickened(points: Array) -> Array:
    """Return points that span a volume: the points of a flat shape are doubled across it."""
    centre = points.mean(axis=0)
    axes = np.linalg.eigh((points - centre).T @ (points - centre))[1].T
    spread = np.ptp((points - centre) @ axes.T, axis=0)
    for axis, extent in zip(axes, spread, strict=True):
        if extent < THINNEST:
            points = np.concatenate([points + axis * THINNEST / 2, points - axis * THINNEST / 2])
    return points


def faces_of(points: Array) -> Faces:
    """Return the faces of the convex hull of points (n, 3), by adding one after another to a tetrahedron."""
    points = _thickened(points)
    corners = _first_four(points)
    centre = points[corners].mean(axis=0)
    faces = np.array([[corners[k] for k in range(4) if k != left] for left in range(4)])
    triangles, normals, offsets = _outward(points, faces, centre)
    for number in _by_distance(points, centre):
        seen = normals @ points[number] > offsets + FLAT
        if not seen.any():
            continue
        edges = np.concatenate([triangles[seen][:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        there = {(int(a), int(b)) for a, b in edges}
        rim = [edge for edge in there if (edge[1], edge[0]) not in there]
        more = np.array([(a, b, number) for a, b in sorted(rim)])
        added = _outward(points, more, centre)
        triangles, normals, offsets = (
            np.concatenate([old[~seen], new]) for old, new in zip((triangles, normals, offsets), added, strict=True)
        )
    return Faces(points[triangles], normals, offsets)


def _first_four(points: Array) -> list[int]:
    """Numbers of four points that span a volume."""
    first = int(np.argmin(points[:, 0]))
    second = int(np.argmax(np.linalg.norm(points - points[first], axis=1)))
    along = points[second] - points[first]
    third = int(np.argmax(np.linalg.norm(np.cross(points - points[first], along), axis=1)))
    normal = np.cross(along, points[third] - points[first])
    return [first, second, third, int(np.argmax(np.abs((points - points[first]) @ normal)))]


def _by_distance(points: Array, centre: Array) -> NDArray[np.intp]:
    """Return the farthest points first: most of the others are inside then."""
    return np.argsort(-np.linalg.norm(points - centre, axis=1), kind="stable")


def _outward(points: Array, triangles: Array, inside: Array) -> tuple[Array, Array, Array]:
    """Triangles (f, 3) of point numbers, turned so that normals point away from a point inside; normals; offsets."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(lengths, 1e-30)[:, None]
    offsets = np.einsum("fk,fk->f", normals, a)
    back = normals @ inside > offsets
    triangles = np.where(back[:, None], triangles[:, ::-1], triangles)
    normals[back] *= -1
    offsets[back] *= -1
    return triangles, normals, offsets
