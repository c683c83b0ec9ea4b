"""Convex shapes as points that span them: their faces, depths inside of them, points spread over their surface."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array

FLAT = 1e-7
"""Points nearer to a face than this are on it [m]."""
THINNEST = 1e-3
"""Least extent of a shape: flatter ones are thickened to it [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """The surface of a convex polyhedron: x is inside where normals (f, 3) @ x <= offsets (f,)."""

    triangles: Array
    """Corners (f, 3, 3)."""
    normals: Array
    offsets: Array


@dataclass(frozen=True, eq=False)
class Hull:
    """The smallest convex set around ``points`` (n, 3) [m]; of a single one the ball of a ``radius`` [m]."""

    points: Array
    radius: float = 0.0
    beyond: float = 0.0
    """Distance by which the real shape goes beyond this one: points on a round shape span a little less [m]."""

    @cached_property
    def faces(self) -> Faces | None:
        """None for a ball."""
        return None if len(self.points) == 1 else _faces(_thickened(self.points))

    def depths(self, places: Array) -> Array:
        """Return depths of points (m, 3) inside (m,) [m]; negative outside, and there no more than a bound."""
        if self.faces is None:
            return np.asarray(self.radius - np.linalg.norm(places - self.points[0], axis=1))
        return np.asarray((self.faces.offsets - np.einsum("mk,fk->mf", places, self.faces.normals)).min(axis=1))

    def surface(self, spacing: float) -> Array:
        """Points (m, 3) on the surface, such that no point of it is farther from one than ``spacing`` [m]."""
        assert self.faces is not None, "of a ball everything is known"
        pending, done = self.faces.triangles, [self.faces.triangles.reshape(-1, 3)]
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


def _thickened(points: Array) -> Array:
    """Return points that span a volume: the points of a flat shape are doubled across it."""
    centre = points.mean(axis=0)
    axes = np.linalg.eigh((points - centre).T @ (points - centre))[1].T
    spread = np.ptp((points - centre) @ axes.T, axis=0)
    for axis, extent in zip(axes, spread, strict=True):
        if extent < THINNEST:
            points = np.concatenate([points + axis * THINNEST / 2, points - axis * THINNEST / 2])
    return points


def _faces(points: Array) -> Faces:
    """Return the convex hull, by adding one point after another."""
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
