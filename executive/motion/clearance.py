"""Clearance of a standing robot at each point of a map.

A silhouette is the space of a robot that turns on the spot, compared with upright boxes. ``outlines`` has the robot's
shape with a heading, ``floods`` where its base can drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

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
FEW = 16
"""Number of boxes that are compared with points without dividing these further."""
TOGETHER = 32_768
"""Point-box distances for which dividing the points would cost more than it saves."""


@dataclass(frozen=True, eq=False)
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

    @cached_property
    def _axes(self) -> tuple[Array, Array]:
        """Cosines and sines (n, 1) of the yaws."""
        return np.cos(self.yaws)[:, None], np.sin(self.yaws)[:, None]

    def distances(self, places: Array, some: NDArray[np.intp]) -> Array:
        """Distances (m, k) from above of points (k, 2) from some boxes (m,); negative inside, to the nearest side."""
        dx, dy = places[:, 0] - self.centres[some, :1], places[:, 1] - self.centres[some, 1:2]
        cosine, sine = (turn[some] for turn in self._axes)
        along = np.abs(cosine * dx + sine * dy) - self.half_extents[some, :1]
        across = np.abs(cosine * dy - sine * dx) - self.half_extents[some, 1:2]
        inside = np.minimum(np.maximum(along, across), 0.0)
        outside = np.sqrt(np.square(np.maximum(along, 0.0)) + np.square(np.maximum(across, 0.0)))
        outside += inside
        return np.asarray(outside)

    def beyond(self, low: Array, high: Array, some: NDArray[np.intp]) -> Array:
        """Lower bounds (m,) of these distances of some boxes from all points of a rectangle."""
        turned = np.abs(np.concatenate([turn[some] for turn in self._axes], axis=1))
        x, y = self.half_extents[some, :1], self.half_extents[some, 1:2]
        extents, centres = x * turned + y * turned[:, ::-1], self.centres[some, :2]
        return np.asarray((np.maximum(low - centres, centres - high) - extents).max(axis=1))


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

    def between(self) -> Grid:
        """The grid whose cell centres are the corners between four cells of this one."""
        aside = self.resolution / 2
        return Grid(self.x + aside, self.y + aside, max(1, self.columns - 1), max(1, self.rows - 1), self.resolution)

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
    relevant = np.flatnonzero(np.isfinite(widest.max(axis=0, initial=-np.inf)))
    close = boxes.only(relevant)
    for rows, some in _together(places, close, widest[:, relevant], most):
        here, radii = places[rows], widest[:, relevant[some]]
        least, batch = np.full((len(silhouettes), len(here)), np.inf), max(1, AT_ONCE // len(here))
        for first in range(0, len(some), batch):
            distances = close.distances(here, some[first : first + batch])
            for clearance, radius in zip(least, radii[:, first : first + batch], strict=True):
                np.minimum(clearance, (distances - radius[:, None]).min(axis=0), out=clearance)
        clearances[:, rows] = least
    return clearances


Part = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Numbers of points that lie together, and of the boxes that matter to them."""


def _together(places: Array, boxes: Boxes, widest: Array, most: float) -> Iterator[Part]:
    """Divide points (k, 2) into groups, each with the boxes that may be the nearest to one of its points.

    A box whose distance from the group's rectangle is above the clearance that the group has anyway, by another box,
    cannot be: so each point is compared with those around it, however many there are in the map.
    """
    every = np.arange(len(boxes))
    left: list[Part] = [(np.arange(len(places)), every)] if len(places) and len(every) else []
    while left:
        rows, some = left.pop()
        low, high = places[rows].min(axis=0), places[rows].max(axis=0)
        if len(some) > FEW:
            middle, radii = (low + high) / 2, widest[:, some]
            room = boxes.distances(middle[None], some)[:, 0] - radii
            largest = np.minimum(room.min(axis=1) + float(np.hypot(*(high - low))) / 2, most)
            least = boxes.beyond(low, high, some) - radii
            some = some[(least <= largest[:, None] + ROUNDING).any(axis=0)]
        wide = int(np.argmax(high - low))
        is_low = places[rows, wide] <= (low[wide] + high[wide]) / 2
        if len(some) <= FEW or len(rows) * len(some) <= TOGETHER or is_low.all():
            if len(some):
                yield rows, some
        else:
            left += [(rows[~is_low], some), (rows[is_low], some)]


def clearance_field(grid: Grid, boxes: Boxes, silhouette: Sequence[Band]) -> Array:
    """Compute :func:`clearance_at` at the cell centres of a grid, (rows, columns) [m]."""
    return clearance_at(grid.centres(), boxes, silhouette).reshape(grid.rows, grid.columns)


Mask = NDArray[np.bool_]


def free_cells(grid: Grid, boxes: Boxes, silhouette: Sequence[Band], slack: float) -> Mask:
    """Find the cells at whose centres no band of a silhouette enters a box by more than ``slack`` [m]."""
    free = np.ones((grid.rows, grid.columns), bool)
    for centre, half, yaw in zip(boxes.centres, boxes.half_extents, boxes.yaws.tolist(), strict=True):
        radii = [r for low, high, r in silhouette if centre[2] - half[2] < high and centre[2] + half[2] > low]
        radius = max(radii, default=0.0) - slack
        if not radii or radius <= 0.0:  # the lintel over a doorway takes no clearance
            continue
        c, s = math.cos(yaw), math.sin(yaw)
        reach = np.array([abs(c) * half[0] + abs(s) * half[1], abs(s) * half[0] + abs(c) * half[1]]) + radius
        low = np.floor((centre[:2] - reach - (grid.x, grid.y)) / grid.resolution).astype(int)
        high = np.ceil((centre[:2] + reach - (grid.x, grid.y)) / grid.resolution).astype(int) + 1
        (left, bottom), (right, top) = np.maximum(low, 0).tolist(), np.maximum(high, 0).tolist()
        window = free[bottom:top, left:right]
        if not window.size:
            continue
        x = grid.x + grid.resolution * np.arange(left, left + window.shape[1]) - centre[0]
        y = grid.y + grid.resolution * np.arange(bottom, bottom + window.shape[0])[:, None] - centre[1]
        along = np.maximum(np.abs(c * x + s * y) - half[0], 0.0)
        across = np.maximum(np.abs(c * y - s * x) - half[1], 0.0)
        window &= np.square(along) + np.square(across) >= radius * radius
    return free
