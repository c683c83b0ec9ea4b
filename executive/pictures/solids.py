"""Closed surfaces as building blocks of shapes: bevelled boxes, surfaces of revolution, tubes, extruded outlines.

The triangles of a :class:`Solid` share their vertices. :func:`shaded` duplicates vertices along edges, so that averaged
vertex normals make round surfaces look smooth and edges sharp.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from planlang.geometry import Array
from planlang.geometry.polygons import FLAT, Faces, ears
from planlang.records import dataclass

AROUND = 24
"""Segments of a surface of revolution."""
AROUND_TUBE = 8
"""Segments around a tube."""
CREASE = math.radians(50)
"""Angle between faces above which their common edge is sharp [rad]."""
BEND = 5
"""Segments of a smooth tube between two given points."""


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A closed surface: ``vertices`` (n, 3), and ``faces`` (m, 3), counterclockwise seen from outside."""

    vertices: Array
    faces: Faces

    def moved(self, scale: Sequence[float] | Array, shift: Sequence[float] | Array) -> Solid:
        """Scale along the axes, then shift; an even number of factors may be negative, else faces would turn inside."""
        return Solid(self.vertices * np.asarray(scale) + np.asarray(shift), self.faces)

    def mirrored(self, axis: int) -> Solid:
        """Mirror at the plane through the origin across an axis."""
        vertices = self.vertices.copy()
        vertices[:, axis] *= -1.0
        return Solid(vertices, self.faces[:, ::-1])


def box(size: Sequence[float] | Array, bevel: float = 0.0) -> Solid:
    """Make a box about the origin, with bevelled edges if ``bevel`` [m] is positive."""
    half = np.asarray(size, float) / 2
    bevel = min(bevel, 0.45 * float(half.min()) * 2)
    if bevel <= FLAT:
        return Solid(_SIGNS * half, _faces_of_box())
    return Solid(_bevelled_corners(half, bevel), _faces_of_bevelled_box())


_SIGNS = 2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1
"""Corners (8, 3) of a cube of side 2 about the origin."""


def _bevelled_corners(half: Array, bevel: float) -> Array:
    """Vertices (24, 3) of a bevelled box: three at each corner, of which the k-th is on the face normal to axis k."""
    inner = _SIGNS * (half - bevel)
    return np.asarray(inner[:, None, :] + np.eye(3) * (bevel * _SIGNS)[:, None, :]).reshape(-1, 3)


@cache
def _faces_of_box() -> Faces:
    """Triangles of a box, which are the same for all sizes."""
    signs = list(np.ndindex(2, 2, 2))
    rings = [[k for k, one in enumerate(signs) if one[axis] == side] for axis in range(3) for side in (0, 1)]
    return _convex(_SIGNS, [[a, b, d, c] for a, b, c, d in rings])


@cache
def _faces_of_bevelled_box() -> Faces:
    """Triangles of a bevelled box, which are the same for all sizes."""
    signs = [(a, b, c) for a, b, c in np.ndindex(2, 2, 2)]
    number = {(*one, k): 3 * index + k for index, one in enumerate(signs) for k in range(3)}
    rings = [[number[(*one, k)] for k in range(3)] for one in signs]
    for k in range(3):
        across, m = (k + 1) % 3, (k + 2) % 3
        for a in (0, 1):
            around = ((0, 0), (0, 1), (1, 1), (1, 0))
            rings.append([number[(*_corner(k, a, across, b, m, c), k)] for b, c in around])
            for b in (0, 1):
                low, high = _corner(k, a, across, b, m, 0), _corner(k, a, across, b, m, 1)
                rings.append([number[(*low, k)], number[(*high, k)], number[(*high, across)], number[(*low, across)]])
    return _convex(_bevelled_corners(np.ones(3), 0.1), rings)


def _corner(k: int, a: int, across: int, b: int, m: int, c: int) -> tuple[int, int, int]:
    """Corner of the unit cube with coordinates a, b, c along the axes k, across, m."""
    corner = [0, 0, 0]
    corner[k], corner[across], corner[m] = a, b, c
    return corner[0], corner[1], corner[2]


def _convex(points: Array, rings: Sequence[Sequence[int]]) -> Faces:
    """Triangulate the polygons of a convex surface about the origin, whatever their orientation."""
    faces = []
    for ring in rings:
        a, b, c = points[list(ring[:3])]
        outside = float(np.cross(b - a, c - a) @ points[list(ring)].mean(axis=0)) > 0
        oriented = list(ring) if outside else list(ring)[::-1]
        faces += [[oriented[0], oriented[k], oriented[k + 1]] for k in range(1, len(oriented) - 1)]
    return np.array(faces, np.int64)


def lathe(profile: Sequence[Sequence[float]], around: int = AROUND) -> Solid:
    """Make a surface of revolution about the z axis from a profile of points (radius, height).

    A profile that does not begin and end on the axis is closed with discs. The outside is to its right, so outer
    profiles go upwards.
    """
    points = [(float(r), float(z)) for r, z in profile]
    points = [(0.0, points[0][1])] * (points[0][0] > FLAT) + points + [(0.0, points[-1][1])] * (points[-1][0] > FLAT)
    turns = np.arange(around) * (2 * math.pi / around)
    circle = np.column_stack([np.cos(turns), np.sin(turns)])
    vertices = [np.array([[0.0, 0.0, points[0][1]]])]
    for r, z in points[1:-1]:
        vertices.append(np.column_stack([circle * r, np.full(around, z)]))
    vertices.append(np.array([[0.0, 0.0, points[-1][1]]]))
    here, there = np.arange(around), (np.arange(around) + 1) % around
    last = 1 + around * (len(points) - 2)
    faces = [np.column_stack([np.zeros(around, np.int64), 1 + there, 1 + here])]
    for k in range(len(points) - 3):
        low, high = 1 + k * around, 1 + (k + 1) * around
        faces.append(np.column_stack([low + here, low + there, high + there]))
        faces.append(np.column_stack([low + here, high + there, high + here]))
    faces.append(np.column_stack([last - around + here, last - around + there, np.full(around, last)]))
    return Solid(np.concatenate(vertices), np.concatenate(faces))


def ball(around: int = AROUND) -> Solid:
    """Make a unit sphere about the origin."""
    tilts = np.linspace(-math.pi / 2, math.pi / 2, around // 2 + 1)
    return lathe([(max(math.cos(tilt), 0.0), math.sin(tilt)) for tilt in tilts], around)


def tube(path: Array, radii: Sequence[float], *, smooth: bool = False, flat: float = 1.0) -> Solid:
    """Make a tube along points (n, 3), closed at its ends, with a radius at each point [m].

    ``smooth`` interpolates the points by a Catmull-Rom spline (1974); ``flat`` scales one cross-section axis, as for
    straps.
    """
    path, widths = np.asarray(path, float), np.asarray(radii, float)
    if smooth and len(path) > 2:
        path, widths = (
            _spline(path),
            np.interp(np.linspace(0, len(path) - 1, BEND * (len(path) - 1) + 1), range(len(widths)), widths),
        )
    ahead = np.diff(path, axis=0)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), FLAT)
    along = np.vstack([ahead[:1], ahead[1:] + ahead[:-1], ahead[-1:]])
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), FLAT)
    start = np.eye(3)[int(np.argmin(np.abs(along[0])))]
    turns = np.arange(AROUND_TUBE) * (2 * math.pi / AROUND_TUBE)
    rings = []
    for at, forward, radius in zip(path, along, widths, strict=True):  # each frame follows the one before: no twist
        aside = start - forward * float(start @ forward)
        start = aside / max(float(np.linalg.norm(aside)), FLAT)
        up = np.cross(forward, start)
        rings.append(at + radius * (np.cos(turns)[:, None] * start + flat * np.sin(turns)[:, None] * up))
    profile = lathe([(0, 0), *[(1, k) for k in range(len(path))], (0, len(path))], AROUND_TUBE)
    return Solid(np.concatenate([path[:1], *rings, path[-1:]]), profile.faces)


def _spline(path: Array) -> Array:
    ends = np.vstack([2 * path[0] - path[1], path, 2 * path[-1] - path[-2]])
    t = (np.arange(BEND) / BEND)[:, None]
    parts = []
    for a, b, c, d in zip(ends, ends[1:], ends[2:], ends[3:], strict=False):
        parts.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))
    return np.vstack([*parts, path[-1:]])


def prism(outline: Sequence[Sequence[float]] | Array) -> Solid:
    """Extrude a simple polygon (n, 2) along z from 0 to 1."""
    flat = np.asarray(outline, float)
    following = np.roll(flat, -1, axis=0)
    if float((flat[:, 0] * following[:, 1] - flat[:, 1] * following[:, 0]).sum()) < 0:
        flat = flat[::-1]
    count = len(flat)
    lid = np.array(ears(flat), np.int64)
    here, there = np.arange(count), (np.arange(count) + 1) % count
    sides = [np.column_stack([here, there, count + there]), np.column_stack([here, count + there, count + here])]
    vertices = np.vstack([np.column_stack([flat, np.zeros(count)]), np.column_stack([flat, np.ones(count)])])
    return Solid(vertices, np.concatenate([lid[:, ::-1], lid + count, *sides]))


def normals_of(vertices: Array, faces: Faces) -> tuple[Array, Array]:
    """Unit normals of triangles (m, 3), zero for degenerate ones, and twice their areas (m,)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    twice = np.linalg.norm(across, axis=1)
    return across / np.maximum(twice, 1e-30)[:, None], twice


def vertex_normals(vertices: Array, faces: Faces) -> Array:
    """Unit normals (n, 3) at vertices: means of the normals of adjacent faces, weighted by area."""
    normals, twice = normals_of(vertices, faces)
    sums = np.zeros_like(vertices)
    for k in range(3):
        for axis in range(3):
            sums[:, axis] += np.bincount(faces[:, k], normals[:, axis] * twice, len(sums))
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.asarray(sums / np.maximum(lengths, 1e-12))


def shaded(solids: Sequence[Solid]) -> Solid:
    """Merge solids, with vertices duplicated along sharp edges."""
    vertices, faces, first = [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
    for one in solids:
        own, corners = _split(one)
        vertices.append(own)
        faces.append(corners + first)
        first += len(own)
    return Solid(np.concatenate(vertices), np.concatenate(faces))


def _split(solid: Solid) -> tuple[Array, Faces]:
    """Duplicate vertices between faces that do not meet smoothly; returns the new vertices and faces."""
    unit_normals, _ = normals_of(solid.vertices, solid.faces)
    normals = unit_normals.tolist()  # Python numbers are faster here than arrays of three
    corners = solid.faces.reshape(-1)
    order = np.argsort(corners, kind="stable")
    least = math.cos(CREASE)
    sources: list[int] = []
    numbers = np.zeros(len(corners), np.int64)
    starts = np.flatnonzero(np.r_[True, np.diff(corners[order]) > 0, True])
    for begin, end in zip(starts[:-1].tolist(), starts[1:].tolist(), strict=True):
        group: list[tuple[float, float, float, int]] = []
        for at in order[begin:end].tolist():
            x, y, z = normals[at // 3]
            known = next((number for a, b, c, number in group if a * x + b * y + c * z >= least), None)
            if known is None:
                known = len(sources)
                sources.append(at)
                group.append((x, y, z, known))
            numbers[at] = known
    return solid.vertices[corners[sources]].reshape(-1, 3), numbers.reshape(-1, 3)
