"""The area that a base can drive to: one flood fill from where it stands, over cells in which it has room.

It allows more than :func:`executive.motion.base_path.plan_base_path` does: what it rules out, no path leads to.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from executive.motion.base_path import ESCAPE
from executive.motion.clearance import TOUCHING, Band, Boxes, Grid
from planlang.geometry import Array
from planlang.records import dataclass

Mask = NDArray[np.bool_]
WINDING = 1.5
"""Greatest length of a way out of a tight place, relative to a straight one."""


@dataclass(frozen=True, slots=True, eq=False)
class Drivable:
    """The cells (rows, columns) of a grid to which a base can drive."""

    grid: Grid
    cells: Mask
    beyond: bool = False
    """True if it may get to places off the grid."""

    def __call__(self, bases: Array) -> Mask:
        """Return which base poses (n, 3) may be driven to, (n,)."""
        row = np.rint((bases[:, 1] - self.grid.y) / self.grid.resolution).astype(int)
        column = np.rint((bases[:, 0] - self.grid.x) / self.grid.resolution).astype(int)
        inside = (row >= 0) & (row < self.grid.rows) & (column >= 0) & (column < self.grid.columns)
        row, column = np.clip(row, 0, self.grid.rows - 1), np.clip(column, 0, self.grid.columns - 1)
        return np.asarray(np.where(inside, self.cells[row, column], self.beyond))

    def comes_near(self, place: Array, within: float) -> bool:
        """Return True if the base may get ``within`` [m] of a place (2,)."""
        return self.beyond or self.near(place, within) > 0

    def near(self, place: Array, within: float) -> int:
        """Count the cells ``within`` [m] of a place (2,) that the base can get to."""
        centres = self.grid.centres()[self.cells]
        return int((np.hypot(centres[:, 0] - place[0], centres[:, 1] - place[1]) <= within).sum())


def drivable(
    start: tuple[float, float], grid: Grid, boxes: Boxes, silhouette: Sequence[Band], core: Sequence[Band]
) -> Drivable:
    """Return where a base at ``start`` can get to among boxes.

    Its way leads over cells in which it can turn, by its ``silhouette``; around its start, and for as far from there at
    its end, in which it may stand with some heading, by its ``core``.
    """
    slack = TOUCHING + grid.resolution  # a cell is entered where its middle has not quite enough room
    fits = free_cells(grid, boxes, core, slack)
    turns = fits & free_cells(grid, boxes, silhouette, 0.0)
    centres = grid.centres()
    near = np.hypot(centres[..., 0] - start[0], centres[..., 1] - start[1]) <= ESCAPE
    begin = np.zeros_like(fits)
    begin[near & (np.hypot(centres[..., 0] - start[0], centres[..., 1] - start[1]) <= grid.resolution)] = True
    main = _flooded(begin, turns | (near & fits))
    found = _flooded(main, fits, math.ceil(WINDING * ESCAPE / grid.resolution))
    return Drivable(grid, _flooded(found, np.ones_like(found), 1))


def free_cells(grid: Grid, boxes: Boxes, silhouette: Sequence[Band], slack: float) -> Mask:
    """Return the cells in whose middles no band of a silhouette is deeper than ``slack`` [m] in a box."""
    free = np.ones((grid.rows, grid.columns), bool)
    for centre, half, yaw in zip(boxes.centres, boxes.half_extents, boxes.yaws.tolist(), strict=True):
        met = [r for low, high, r in silhouette if centre[2] - half[2] < high and centre[2] + half[2] > low]
        radius = max(met, default=0.0) - slack
        if radius <= 0.0:
            continue
        c, s = math.cos(yaw), math.sin(yaw)
        reach = np.array([abs(c) * half[0] + abs(s) * half[1], abs(s) * half[0] + abs(c) * half[1]]) + radius
        low = np.floor((centre[:2] - reach - (grid.x, grid.y)) / grid.resolution).astype(int)
        high = np.ceil((centre[:2] + reach - (grid.x, grid.y)) / grid.resolution).astype(int) + 1
        (left, bottom), (right, top) = np.maximum(low, 0).tolist(), np.maximum(high, 0).tolist()
        part = free[bottom:top, left:right]
        if not part.size:
            continue
        x = grid.x + grid.resolution * np.arange(left, left + part.shape[1]) - centre[0]
        y = grid.y + grid.resolution * np.arange(bottom, bottom + part.shape[0])[:, None] - centre[1]
        along = np.maximum(np.abs(c * x + s * y) - half[0], 0.0)
        across = np.maximum(np.abs(c * y - s * x) - half[1], 0.0)
        part &= np.square(along) + np.square(across) >= radius * radius
    return free


def _flooded(begin: Mask, over: Mask, steps: int | None = None) -> Mask:
    """Return the cells of ``over`` that are joined to others, in at most so many steps, with these others."""
    width = begin.shape[1] + 2
    allowed, seen = np.pad(over, 1).ravel(), np.pad(begin, 1).ravel()
    moves = np.array([1, -1, width, -width, width + 1, width - 1, 1 - width, -1 - width])
    front = np.flatnonzero(seen)
    while len(front) and steps != 0:
        around = (front[:, None] + moves).ravel()
        around = around[allowed[around] & ~seen[around]]
        seen[around] = True
        front = np.unique(around)
        steps = None if steps is None else steps - 1
    return np.asarray(seen.reshape(-1, width)[1:-1, 1:-1])
