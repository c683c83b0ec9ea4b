"""Outlines of a robot from above, with which it can stand closer to things than its silhouette has room to turn.

A robot that is not round can stand closer to things with the right heading: its corners point where there is room. For
that, each link, and what the hands hold, has an outline from above, which it fills over its whole height.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from executive.motion.clearance import ROUNDING, Band, Boxes
from planlang.geometry import Array
from planlang.records import dataclass

TOUCHING = 0.002
"""Smallest overlap of an outline and a box that counts [m]; exact queries decide about less."""


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Link from above, between heights ``low`` and ``high`` [m]: a convex polygon in the base frame."""

    low: float
    high: float
    corners: Array
    """(n, 2), counter-clockwise."""
    normals: Array
    """Outward normals of the edges, (n, 2)."""
    offsets: Array
    """Distances of the edges from the base's origin along the normals (n,) [m]."""
    radius: float
    """Radius of the smallest circle about the base's origin that contains the outline [m]."""
    inner: float
    """Radius of the largest circle about the base's origin inside the outline [m]; negative if outside of it."""

    @staticmethod
    def of(low: float, high: float, corners: Array) -> Outline:
        """Create an outline from corners (n, 2) in counter-clockwise order."""
        edges = np.roll(corners, -1, axis=0) - corners
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1)[:, None]
        offsets = np.einsum("nk,nk->n", normals, corners)
        radius = float(np.linalg.norm(corners, axis=1).max())
        return Outline(low, high, corners, normals, offsets, radius, float(offsets.min()))


def outlines(shapes: Iterable[tuple[float, float, Array]]) -> tuple[Outline, ...]:
    """Create the outlines of links (z_low, z_high, corners), without those that a single other one covers."""
    candidates = [Outline.of(*shape) for shape in shapes if len(shape[2]) > 2]
    kept: list[Outline] = []
    for one in sorted(candidates, key=lambda one: -one.radius):
        if not any(k.low <= one.low and one.high <= k.high and one.radius <= k.inner for k in kept):
            kept.append(one)
    return tuple(kept)


def cores(shapes: Sequence[Outline]) -> tuple[Band, ...]:
    """List the circles inside the outlines: the space that a robot takes with any heading."""
    return tuple((one.low, one.high, one.inner) for one in shapes if one.inner > 0.0)


def stands_in_none(bases: Array, boxes: Boxes, shapes: Sequence[Outline]) -> NDArray[np.bool_]:
    """Check at which bases (m, 3) no outline overlaps a box, by separating axes (m,)."""
    free = np.ones(len(bases), bool)
    bottom = boxes.centres[:, 2] - boxes.half_extents[:, 2]
    top = boxes.centres[:, 2] + boxes.half_extents[:, 2]
    c, s = np.cos(boxes.yaws), np.sin(boxes.yaws)
    x, y = (bases[:, None, axis] - boxes.centres[:, axis] for axis in (0, 1))
    along = np.maximum(np.abs(c * x + s * y) - boxes.half_extents[:, 0], 0.0)
    across = np.maximum(np.abs(c * y - s * x) - boxes.half_extents[:, 1], 0.0)
    squares = along * along + across * across
    for one in shapes:
        same_height = (bottom < one.high) & (top > one.low)
        rows, columns = np.nonzero((squares < one.radius**2) & same_height & free[:, None])
        if len(rows):
            inside = _overlap(bases[rows], boxes.only(columns), one)
            free[rows[inside]] = False
    return free


def _overlap(bases: Array, boxes: Boxes, one: Outline) -> NDArray[np.bool_]:
    """Check where an outline at a base (p, 3) overlaps its box (p,)."""
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


HEADINGS = 16
"""Number of headings tested for room."""
TURN = 2 * math.pi / HEADINGS
"""Angle between neighbouring headings [rad]."""


def deciding(boxes: Boxes, shapes: Sequence[Outline]) -> list[tuple[Outline, NDArray[np.intp]]]:
    """List each outline, the largest first, with the boxes that no other outline around it meets, too."""
    bottom = boxes.centres[:, 2] - boxes.half_extents[:, 2]
    top = boxes.centres[:, 2] + boxes.half_extents[:, 2]
    ordered = sorted(shapes, key=lambda one: -one.radius)
    meets = [(bottom < one.high) & (top > one.low) for one in ordered]
    deciding = []
    for number, one in enumerate(ordered):
        own = meets[number].copy()
        for other in range(number):
            if own.any() and (one.corners @ ordered[other].normals.T <= ordered[other].offsets + ROUNDING).all():
                own &= ~meets[other]
        if own.any():
            deciding.append((one, np.flatnonzero(own)))
    return deciding


def block(
    blocked: NDArray[np.bool_],
    places: Array,
    boxes: Boxes,
    against: Sequence[tuple[Outline, NDArray[np.intp]]],
    slacks: Sequence[float],
) -> None:
    """Mark the headings with which outlines at places (m, 2) enter a box by more than slacks (s,): (s, m, headings)."""
    most, loosest = math.sqrt(2.0) * max(0.0, -min(slacks)), int(np.argmax(slacks))
    low, high, every = places.min(axis=0), places.max(axis=0), np.arange(len(boxes))
    beyond = boxes.beyond(low, high, every)
    turns = np.arange(HEADINGS) * TURN
    for one, some in against:
        some = some[beyond[some] < one.radius + most]
        if not len(some):
            continue
        yaws, half = boxes.yaws[some], boxes.half_extents[some, :2]
        c, s = np.cos(yaws), np.sin(yaws)
        x, y = (places[:, None, axis] - boxes.centres[some, axis] for axis in (0, 1))
        x, y = c * x + s * y, c * y - s * x  # in the boxes' frames
        along, across = np.maximum(np.abs(x) - half[:, 0], 0.0), np.maximum(np.abs(y) - half[:, 1], 0.0)
        rows, columns = np.nonzero(along * along + across * across < (one.radius + most) ** 2)
        x, y = x[rows, columns], y[rows, columns]
        # a circle around the outline, which turns about the base, leaves out most headings
        middle = (one.corners.min(axis=0) + one.corners.max(axis=0)) / 2
        radius = float(np.linalg.norm(one.corners - middle, axis=1).max())
        turn = turns - yaws[:, None]
        cosine, sine = np.cos(turn), np.sin(turn)  # (boxes, headings)
        to_x, to_y = cosine * middle[0] - sine * middle[1], sine * middle[0] + cosine * middle[1]
        along = np.maximum(np.abs(x[:, None] + to_x[columns]) - half[columns, :1], 0.0)
        across = np.maximum(np.abs(y[:, None] + to_y[columns]) - half[columns, 1:], 0.0)
        near = (along * along + across * across < (radius + most) ** 2) & ~blocked[loosest, rows]
        pairs, headings = np.nonzero(near)
        if not len(pairs):
            continue
        rows, columns = rows[pairs], columns[pairs]
        apart = _apart(x[pairs], y[pairs], half, one, (cosine, sine), columns * HEADINGS + headings)
        for number, slack in enumerate(slacks):
            hit = apart < -slack - TOUCHING
            blocked[number, rows[hit], headings[hit]] = True


def _apart(x: Array, y: Array, half: Array, one: Outline, turns: tuple[Array, Array], cases: NDArray[np.intp]) -> Array:
    """Distances (p,) by which boxes have to grow on all sides to touch an outline at x, y (p,) in their frames [m].

    By separating axes. ``half``: half extents (b, 2) of the boxes; ``turns``: cosines and sines (b, headings) of the
    outline's headings in their frames; ``cases``: which of these each pair has (p,).
    """
    cosine, sine = (turn.reshape(-1, 1) for turn in turns)
    # the outline along the boxes' sides
    ahead = cosine * one.corners[:, 0] - sine * one.corners[:, 1]
    aside = sine * one.corners[:, 0] + cosine * one.corners[:, 1]
    extents = np.repeat(half, HEADINGS, axis=0)
    least = np.stack([ahead.min(axis=1), -ahead.max(axis=1), aside.min(axis=1), -aside.max(axis=1)], axis=1)
    least -= np.repeat(extents, 2, axis=1)
    apart = least[cases] + np.stack([x, -x, y, -y], axis=1)
    # the boxes along the outline's normals
    to_x = cosine * one.normals[:, 0] - sine * one.normals[:, 1]
    to_y = sine * one.normals[:, 0] + cosine * one.normals[:, 1]
    wide = np.abs(to_x) + np.abs(to_y)
    fixed = (one.offsets + np.abs(to_x) * extents[:, :1] + np.abs(to_y) * extents[:, 1:]) / wide
    beyond = -((to_x / wide)[cases] * x[:, None] + (to_y / wide)[cases] * y[:, None]) - fixed[cases]
    return np.asarray(np.maximum(apart.max(axis=1), beyond.max(axis=1)))
