"""Clearance of a standing robot at each point of a map: distances from oriented boxes to its silhouette."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from planlang.geometry import Array, Pose

Band = tuple[float, float, float]
"""A slice of a robot's silhouette: from z_low to z_high [m] above the floor it stays within a radius [m]."""


ROUNDING = 1e-6
"""Boxes are left out only if they are farther away by this [m]."""
AT_ONCE = 8192
"""Distances of places from boxes that are computed in one go, so that they stay in the processor's cache."""


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Upright boxes: ``centres`` (n, 3) and ``half_extents`` (n, 3) [m], ``yaws`` (n,) [rad], in the map."""

    centres: Array
    half_extents: Array
    yaws: Array

    @staticmethod
    def around(poses: Iterable[Pose], sizes: ArrayLike) -> Boxes:
        """Boxes with poses and sizes (n, 3); a tilted one is replaced by the smallest upright prism along an edge."""
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
        """Return some of the boxes, by index, several indices or a mask."""
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
        """Return the grid whose cells cover the rectangle between two corners [m] without leaving it."""
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
        """Row and column of the cell that holds a place, None outside the grid."""
        row, column = round((y - self.y) / self.resolution), round((x - self.x) / self.resolution)
        return (row, column) if 0 <= row < self.rows and 0 <= column < self.columns else None


def clearance_at(points: ArrayLike, boxes: Boxes, silhouette: Sequence[Band]) -> Array:
    """Room (k,) [m] around a robot standing at points (k, 2); negative where its silhouette meets a box.

    The smallest horizontal distance of any band from any box in its heights, less the band's radius; inf without one.
    Inside a box distances count negative, to the nearest side.
    """
    return clearances_at(points, boxes, (silhouette,)).reshape(-1)


def clearances_at(
    points: ArrayLike, boxes: Boxes, silhouettes: Sequence[Sequence[Band]], most: float = np.inf
) -> Array:
    """Return clearances for several silhouettes, (s, k); values above ``most`` [m] may be too large."""
    places = np.asarray(points, float).reshape(-1, 2)
    rooms = np.full((len(silhouettes), len(places)), np.inf)
    bottom = boxes.centres[:, 2] - boxes.half_extents[:, 2]
    top = boxes.centres[:, 2] + boxes.half_extents[:, 2]
    # the widest band that meets a box decides for it
    widest = np.full((len(silhouettes), len(boxes)), -np.inf)
    for number, silhouette in enumerate(silhouettes):
        for low, high, radius in silhouette:
            met = (bottom < high) & (top > low)
            widest[number] = np.maximum(widest[number], np.where(met, radius, -np.inf))
    cosines, sines = np.cos(boxes.yaws)[:, None], np.sin(boxes.yaws)[:, None]
    least = widest.max(axis=0, initial=-np.inf)
    if most < np.inf and len(places):
        least = np.where(_from_rectangle(places, boxes, cosines, sines) - least > most + ROUNDING, -np.inf, least)
    meant = np.flatnonzero(np.isfinite(least))
    together = max(1, AT_ONCE // max(1, len(places)))
    for some in (meant[first : first + together] for first in range(0, len(meant), together)):
        dx, dy = places[:, 0] - boxes.centres[some, :1], places[:, 1] - boxes.centres[some, 1:2]
        cosine, sine = cosines[some], sines[some]
        along = np.abs(cosine * dx + sine * dy) - boxes.half_extents[some, :1]
        across = np.abs(cosine * dy - sine * dx) - boxes.half_extents[some, 1:2]
        inside = np.minimum(np.maximum(along, across), 0.0)
        outside = np.sqrt(np.square(np.maximum(along, 0.0)) + np.square(np.maximum(across, 0.0)))
        outside += inside
        for room, radii in zip(rooms, widest[:, some], strict=True):
            np.minimum(room, (outside - radii[:, None]).min(axis=0), out=room)
    return rooms


def _from_rectangle(places: Array, boxes: Boxes, cosines: Array, sines: Array) -> Array:
    """Return least distances of boxes (n,) from the rectangle around points (k, 2), along one of its sides [m]."""
    low, high = places.min(axis=0), places.max(axis=0)
    turned = np.abs(np.concatenate([cosines, sines], axis=1))
    x, y = boxes.half_extents[:, 0], boxes.half_extents[:, 1]
    extents = x[:, None] * turned + y[:, None] * turned[:, ::-1]
    centres = boxes.centres[:, :2]
    return np.asarray((np.maximum(low - centres, centres - high) - extents).max(axis=1))


def clearance_field(grid: Grid, boxes: Boxes, silhouette: Sequence[Band]) -> Array:
    """Room (rows, columns) [m] at the cell centres of a grid, as :func:`clearance_at`."""
    return clearance_at(grid.centres(), boxes, silhouette).reshape(grid.rows, grid.columns)
