"""Clearance of a standing robot at each point of a map, and tests whether it fits with a heading.

A silhouette is the space of a robot that turns on the spot, compared with upright boxes. A robot that is not round can
stand closer to things with the right heading: its corners point where there is room. For that, each link has an outline
from above, which it fills over its whole height.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planlang.geometry import Array, Pose
from planlang.records import dataclass

Band = tuple[float, float, float]
"""Slice of a robot's silhouette: z_low, z_high above the floor, and radius [m]."""


ROUNDING = 1e-6
"""Margin for leaving out distant boxes [m]."""
AT_ONCE = 8192
"""Point-box distances computed together, so that they stay in the processor's cache."""


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Upright boxes: ``centres`` (n, 3) and ``half_extents`` (n, 3) [m], ``yaws`` (n,) [rad], in the map."""

    centres: Array
    half_extents: Array
    yaws: Array

    @staticmethod
    def around(poses: Iterable[Pose], sizes: ArrayLike) -> Boxes:
        """Enclose boxes with poses and sizes (n, 3); a tilted one by the smallest upright prism along an edge."""
        matrices = Pose.matrices(poses)
        half = np.asarray(sizes, float).reshape(-1, 3) / 2
        if len(matrices) != len(half):
            raise ValueError(f"{len(matrices)} poses do not go with {len(half)} sizes")
        columns = matrices[:, :3, :3]
        flat = np.linalg.norm(columns[:, :2], axis=1)
        # the three candidates for the prism's x direction: each edge of the box seen from above
        candidates = np.where(flat > 1e-9, np.arctan2(columns[:, 1], columns[:, 0]), 0.0)
        cosine, sine = np.cos(candidates), np.sin(candidates)
        along = cosine[:, :, None] * columns[:, None, 0] + sine[:, :, None] * columns[:, None, 1]
        across = -sine[:, :, None] * columns[:, None, 0] + cosine[:, :, None] * columns[:, None, 1]
        x = (np.abs(along) * half[:, None]).sum(axis=2)
        y = (np.abs(across) * half[:, None]).sum(axis=2)
        best = np.argmin(np.where(flat > 1e-9, np.round(x * y, 12), np.inf), axis=1)
        rows = np.arange(len(half))
        z = (np.abs(columns[:, 2]) * half).sum(axis=1)
        return Boxes(matrices[:, :3, 3], np.stack([x[rows, best], y[rows, best], z], axis=1), candidates[rows, best])

    def __len__(self) -> int:
        return len(self.yaws)

    def only(self, index: ArrayLike) -> Boxes:
        """Select boxes by index, indices or a mask."""
        rows = np.atleast_1d(np.asarray(index))
        return Boxes(self.centres[rows], self.half_extents[rows], self.yaws[rows])


@dataclass(frozen=True, slots=True)
class Grid:
    """Square cells over a rectangle of the map; ``x`` and ``y`` [m] are the centre of cell (0, 0).

    An array over the grid has shape (rows, columns): rows go along y, columns along x.
    """

    x: float
    y: float
    columns: int
    rows: int
    resolution: float = 0.05

    @staticmethod
    def over(lower: tuple[float, float], upper: tuple[float, float], resolution: float = 0.05) -> Grid:
        """Cover the rectangle between two corners [m] by whole cells that do not leave it."""
        counts = [int(np.floor((high - low) / resolution + 1e-9)) for low, high in zip(lower, upper, strict=True)]
        if min(counts) < 1:
            raise ValueError(f"no cell of {resolution} m fits between {lower} and {upper}")
        return Grid(lower[0] + resolution / 2, lower[1] + resolution / 2, counts[0], counts[1], resolution)

    def centres(self) -> Array:
        """Cell centres (rows, columns, 2) [m]."""
        xs = self.x + self.resolution * np.arange(self.columns)
        ys = self.y + self.resolution * np.arange(self.rows)
        return np.stack(np.meshgrid(xs, ys), axis=-1)

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Row and column of the cell that contains a point; None outside the grid."""
        row, column = round((y - self.y) / self.resolution), round((x - self.x) / self.resolution)
        return (row, column) if 0 <= row < self.rows and 0 <= column < self.columns else None


def clearance_at(points: ArrayLike, boxes: Boxes, silhouette: Sequence[Band]) -> Array:
    """Compute the clearance (k,) [m] of a robot standing at points (k, 2); negative where its silhouette meets a box.

    The smallest horizontal distance between any band and any box at its height, minus the band's radius; inf without
    boxes. Inside a box distances are negative, to the nearest side.
    """
    return clearances_at(points, boxes, (silhouette,)).reshape(-1)


def clearances_at(
    points: ArrayLike, boxes: Boxes, silhouettes: Sequence[Sequence[Band]], most: float = np.inf
) -> Array:
    """Compute clearances for several silhouettes, (s, k); values above ``most`` [m] may be too large."""
    places = np.asarray(points, float).reshape(-1, 2)
    clearances = np.full((len(silhouettes), len(places)), np.inf)
    bottom = boxes.centres[:, 2] - boxes.half_extents[:, 2]
    top = boxes.centres[:, 2] + boxes.half_extents[:, 2]
    # the widest band that meets a box decides for it
    widest = np.full((len(silhouettes), len(boxes)), -np.inf)
    for number, silhouette in enumerate(silhouettes):
        for low, high, radius in silhouette:
            overlaps = (bottom < high) & (top > low)
            widest[number] = np.maximum(widest[number], np.where(overlaps, radius, -np.inf))
    cosines, sines = np.cos(boxes.yaws)[:, None], np.sin(boxes.yaws)[:, None]
    least = widest.max(axis=0, initial=-np.inf)
    if most < np.inf and len(places):
        least = np.where(_from_rectangle(places, boxes, cosines, sines) - least > most + ROUNDING, -np.inf, least)
    relevant = np.flatnonzero(np.isfinite(least))
    batch = max(1, AT_ONCE // max(1, len(places)))
    for some in (relevant[first : first + batch] for first in range(0, len(relevant), batch)):
        dx, dy = places[:, 0] - boxes.centres[some, :1], places[:, 1] - boxes.centres[some, 1:2]
        cosine, sine = cosines[some], sines[some]
        along = np.abs(cosine * dx + sine * dy) - boxes.half_extents[some, :1]
        across = np.abs(cosine * dy - sine * dx) - boxes.half_extents[some, 1:2]
        inside = np.minimum(np.maximum(along, across), 0.0)
        outside = np.sqrt(np.square(np.maximum(along, 0.0)) + np.square(np.maximum(across, 0.0)))
        outside += inside
        for clearance, radii in zip(clearances, widest[:, some], strict=True):
            np.minimum(clearance, (outside - radii[:, None]).min(axis=0), out=clearance)
    return clearances


def _from_rectangle(places: Array, boxes: Boxes, cosines: Array, sines: Array) -> Array:
    """Lower bounds of the distances of boxes (n,) from the bounding rectangle of points (k, 2) [m]."""
    low, high = places.min(axis=0), places.max(axis=0)
    turned = np.abs(np.concatenate([cosines, sines], axis=1))
    x, y = boxes.half_extents[:, 0], boxes.half_extents[:, 1]
    extents = x[:, None] * turned + y[:, None] * turned[:, ::-1]
    centres = boxes.centres[:, :2]
    return np.asarray((np.maximum(low - centres, centres - high) - extents).max(axis=1))


def clearance_field(grid: Grid, boxes: Boxes, silhouette: Sequence[Band]) -> Array:
    """Compute :func:`clearance_at` at the cell centres of a grid, (rows, columns) [m]."""
    return clearance_at(grid.centres(), boxes, silhouette).reshape(grid.rows, grid.columns)


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
