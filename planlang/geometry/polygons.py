"""Polygons as triangles: fans of convex ones, ears of others, bridges to their holes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from planlang.geometry.matrices import Array

Faces = NDArray[np.int64]
FLAT = 1e-9
"""Tolerance below which an area or a distance counts as zero."""
MOST_EARS = 1_000_000
"""Greatest sum of squared numbers of corners of the polygons that are split by ears: beyond it, fans have to do."""


def fans(counts: Sequence[int], corners: Faces) -> Faces:
    """Split polygons with the given ``counts`` of corners into fans of triangles (m, 3)."""
    if len(counts) and min(counts) == max(counts) == 3:
        return corners[: 3 * len(counts)].reshape(-1, 3)
    found, first = [np.zeros((0, 3), np.int64)], 0
    for count in counts:
        ring = corners[first : first + count]
        first += count
        if len(ring) == count >= 3:
            found.append(np.column_stack([np.full(count - 2, ring[0]), ring[1:-1], ring[2:]]))
    return np.concatenate(found)


def triangles(counts: Faces, corners: Faces, points: Array) -> Faces:
    """Split polygons, with ``counts`` (k,) of ``corners``, into triangles (m, 3); corners are indices of ``points``.

    A polygon that crosses itself becomes a fan, as do all beyond :data:`MOST_EARS`. Polygons that lack corners are left
    out.
    """
    ends = np.cumsum(counts)
    counts = np.where(ends <= len(corners), counts, 0)
    first = np.cumsum(np.maximum(counts - 2, 0)) - np.maximum(counts - 2, 0)
    found = np.full((int(np.maximum(counts - 2, 0).sum()), 3), -1, np.int64)
    effort = 0
    for count in np.unique(counts[counts >= 3]).tolist():
        which = np.flatnonzero(counts == count)
        rings = corners[(ends[which] - count)[:, None] + np.arange(count)]
        rows = first[which][:, None] + np.arange(count - 2)
        found[rows] = np.stack([np.broadcast_to(rings[:, :1], rows.shape), rings[:, 1:-1], rings[:, 2:]], axis=-1)
        if count == 3:
            continue
        turns = _turns(points[rings])
        concave = np.flatnonzero((turns < -FLAT).any(axis=1))
        if count == 4:  # a fan from the corner that turns the other way
            start = turns[concave].argmin(axis=1)[:, None]
            a, b, c, d = np.take_along_axis(rings[concave], (start + np.arange(4)) % 4, axis=1).T
            found[rows[concave]] = np.stack([np.column_stack([a, b, c]), np.column_stack([a, c, d])], axis=1)
            continue
        for k in concave:
            effort += count**2
            if effort > MOST_EARS or (flat := _flat(points[rings[k]])) is None:
                continue
            try:
                split = rings[k][np.array(ears(flat), np.int64)]
            except ValueError:
                continue
            found[rows[k]] = -1
            found[rows[k][: len(split)]] = split
    return found[found[:, 0] >= 0]


def bridged(outer: Faces, holes: Sequence[Faces], points: Array) -> Faces:
    """Return one ring around a polygon and its holes, connected by bridges that are passed twice.

    Holes with the greatest coordinate come first, so that each bridge sees the ring that it leads to (D. Eberly,
    Triangulation by Ear Clipping).
    """
    normal = _normal(points[outer])
    along = _axes(normal)[0]
    ring = list(outer.tolist())
    for hole in sorted((hole for hole in holes if len(hole) >= 3), key=lambda one: -float((points[one] @ along).max())):
        if float(_normal(points[hole]) @ normal) > 0:  # it runs the other way round
            hole = hole[::-1]
        start = int(np.argmax(points[hole] @ along))
        turned = [*hole[start:].tolist(), *hole[: start + 1].tolist()]
        at = _seen(turned[0], ring, turned, points, normal)
        ring[at : at + 1] = [ring[at], *turned, ring[at]]
    return np.array(ring, np.int64)


def ears(flat: Array) -> list[tuple[int, int, int]]:
    """Triangulate a simple polygon (n, 2), counterclockwise, by ear clipping (G. H. Meisters, 1975).

    Raises ValueError if it crosses itself. Corners may coincide where bridges lead to holes.
    """
    left, found = list(range(len(flat))), []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            if _turn(flat[a], flat[b], flat[c]) <= FLAT:
                continue
            others = flat[[one for one in left if one not in (a, b, c)]]
            inside = np.ones(len(others), bool)
            for start, end in ((a, b), (b, c), (c, a)):
                inside &= _turn(flat[start], flat[end], others.T) >= -FLAT
                inside &= np.abs(others - flat[start]).max(axis=1, initial=0.0) > 0
            if inside.any():
                continue
            found.append((a, b, c))
            del left[k]
            break
        else:
            flattest = next((k for k in range(len(left)) if _is_level(flat, left, k)), None)
            if flattest is None:
                raise ValueError(f"the outline {flat.tolist()} crosses itself")
            del left[flattest]
    return [*found, (left[0], left[1], left[2])]


def _is_level(flat: Array, left: Sequence[int], k: int) -> bool:
    """Check whether a corner lies on the line between its neighbours: such a one is no ear, and needs no triangle."""
    a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
    return bool(abs(_turn(flat[a], flat[b], flat[c])) <= FLAT)


def _turn(a: Array, b: Array, c: Array) -> Array:
    """Twice the area of triangles, positive if counterclockwise."""
    area: Array = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return area


def _seen(start: int, ring: Sequence[int], hole: Sequence[int], points: Array, normal: Array) -> int:
    """Return the place of the nearest corner of a ring that a corner of a hole sees."""
    frame = np.stack(_axes(normal))
    flat = {index: frame @ points[index] for index in {*ring, *hole}}
    edges = [(ring[k - 1], ring[k]) for k in range(len(ring))] + list(pairwise(hole))
    here = flat[start]

    def is_seen(k: int) -> bool:
        there = flat[ring[k]]
        for one, other in edges:
            if {one, other} & {start, ring[k]}:
                continue
            sides = _turn(here, there, flat[one]) * _turn(here, there, flat[other])
            ends = _turn(flat[one], flat[other], here) * _turn(flat[one], flat[other], there)
            if float(sides) <= 0 and float(ends) <= 0:
                return False
        return True

    near = sorted(range(len(ring)), key=lambda k: float(np.abs(flat[ring[k]] - here).max()))
    return next(filter(is_seen, near), near[0])


def _normal(rings: Array) -> Array:
    """Return the normals (..., 3) of polygons (..., n, 3), as long as twice their areas (Newell)."""
    rings = rings - rings[..., :1, :]
    total: Array = np.cross(rings, np.roll(rings, -1, axis=-2)).sum(axis=-2)
    return total


def _axes(normal: Array) -> tuple[Array, Array]:
    """Return two axes of the plane with a normal."""
    length = float(np.linalg.norm(normal))
    up = normal / length if length > 0 else np.array([0.0, 0.0, 1.0])
    across = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    across /= np.linalg.norm(across)
    return across, np.cross(up, across)


def _flat(ring: Array) -> Array | None:
    """Return a polygon (n, 3) in its plane (n, 2), counterclockwise, of size one; None if it has no area."""
    ring = ring - ring[0]
    size = float(np.abs(ring).max())
    normal = _normal(ring / size) if 0 < size < np.inf else np.zeros(3)
    return (ring / size) @ np.stack(_axes(normal)).T if np.abs(normal).max() > FLAT else None


def _turns(rings: Array) -> Array:
    """Return how polygons (k, n, 3) turn at their corners (k, n), relative to their areas; negative: the other way."""
    normals = _normal(rings)
    before, ahead = rings - np.roll(rings, 1, axis=1), np.roll(rings, -1, axis=1) - rings
    across = (np.cross(before, ahead) * normals[:, None]).sum(axis=2)
    turns: Array = across / np.maximum((normals**2).sum(axis=1), 1e-300)[:, None]
    return turns
