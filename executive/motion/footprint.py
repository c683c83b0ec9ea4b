"""Checks of whether a robot fits at a base pose: outlines of its links from above against upright boxes.

A silhouette is the room of a robot that turns on the spot. One that is not round stands closer to things
than that with the right heading: its corners point where there is room. Each link counts with its whole outline in all
its heights.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.motion.clearance import Band, Boxes
from planlang.geometry import Array

TOUCHING = 0.002
"""Least depth of an outline in a box that counts [m]: less is left to exact queries."""


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """A link from above, between two heights ``low`` and ``high`` [m]: a convex polygon in the base frame."""

    low: float
    high: float
    corners: Array
    """(n, 2), counter-clockwise."""
    normals: Array
    """The edges' outward normals, (n, 2)."""
    offsets: Array
    """The edges' distances from the base's origin along the normals (n,) [m]."""
    radius: float
    """The radius of the smallest circle about the base's origin that holds the outline [m]."""
    inner: float
    """The radius of the largest circle about the base's origin in the outline [m], below zero if that is outside."""

    @staticmethod
    def of(low: float, high: float, corners: Array) -> Outline:
        """Return an outline from corners (n, 2) in counter-clockwise order."""
        edges = np.roll(corners, -1, axis=0) - corners
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1)[:, None]
        offsets = np.einsum("nk,nk->n", normals, corners)
        radius = float(np.linalg.norm(corners, axis=1).max())
        return Outline(low, high, corners, normals, offsets, radius, float(offsets.min()))


def outlines(shapes: Iterable[tuple[float, float, Array]]) -> tuple[Outline, ...]:
    """Return the outlines of links (z_low, z_high, corners) that take room which no single other one takes."""
    every = [Outline.of(*shape) for shape in shapes if len(shape[2]) > 2]
    kept: list[Outline] = []
    for one in sorted(every, key=lambda one: -one.radius):
        if not any(k.low <= one.low and one.high <= k.high and one.radius <= k.inner for k in kept):
            kept.append(one)
    return tuple(kept)


def cores(shapes: Sequence[Outline]) -> tuple[Band, ...]:
    """Return what a robot takes with any heading: the circles inside its outlines."""
    return tuple((one.low, one.high, one.inner) for one in shapes if one.inner > 0.0)


def stands_in_none(bases: Array, boxes: Boxes, shapes: Sequence[Outline]) -> NDArray[np.bool_]:
    """Return at which bases (m, 3) no outline is in a box, by separating axes (m,)."""
    free = np.ones(len(bases), bool)
    bottom = boxes.centres[:, 2] - boxes.half_extents[:, 2]
    top = boxes.centres[:, 2] + boxes.half_extents[:, 2]
    reach = np.linalg.norm(boxes.half_extents[:, :2], axis=1)
    away = bases[:, None, :2] - boxes.centres[:, :2]
    squares = np.einsum("mkc,mkc->mk", away, away)
    for one in shapes:
        met = (bottom < one.high) & (top > one.low)
        rows, columns = np.nonzero((squares < (reach + one.radius) ** 2) & met & free[:, None])
        if len(rows):
            inside = _overlap(bases[rows], boxes.only(columns), one)
            free[rows[inside]] = False
    return free


def _overlap(bases: Array, boxes: Boxes, one: Outline) -> NDArray[np.bool_]:
    """Return True where an outline at a base (p, 3) is in the box beside it (p,)."""
    turn = bases[:, 2] - boxes.yaws
    c, s = np.cos(boxes.yaws), np.sin(boxes.yaws)
    x, y = (bases[:, :2] - boxes.centres[:, :2]).T
    half_x, half_y = (boxes.half_extents[:, :2] - TOUCHING).T
    cosine, sine = np.cos(turn)[:, None], np.sin(turn)[:, None]
    # the outline in the box's frame
    along = (c * x + s * y)[:, None] + cosine * one.corners[:, 0] - sine * one.corners[:, 1]
    across = (c * y - s * x)[:, None] + sine * one.corners[:, 0] + cosine * one.corners[:, 1]
    inside = (along.min(axis=1) < half_x) & (along.max(axis=1) > -half_x)
    inside &= (across.min(axis=1) < half_y) & (across.max(axis=1) > -half_y)
    # the box along the outline's normals
    c, s = np.cos(bases[:, 2]), np.sin(bases[:, 2])
    ahead, left = -(c * x + s * y)[:, None], -(c * y - s * x)[:, None]
    middle = ahead * one.normals[:, 0] + left * one.normals[:, 1]
    in_box_x = cosine * one.normals[:, 0] - sine * one.normals[:, 1]
    in_box_y = sine * one.normals[:, 0] + cosine * one.normals[:, 1]
    nearest = middle - np.abs(in_box_x) * half_x[:, None] - np.abs(in_box_y) * half_y[:, None]
    return np.asarray(inside & (nearest < one.offsets).all(axis=1))
