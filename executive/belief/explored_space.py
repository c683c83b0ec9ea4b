"""Explored part of a room, as an occupancy grid: free cells, cells with a surface, and unknown cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from executive.motion import Grid
from planlang.geometry import Array

KNOWN = 0.4
"""Least share of cells seen as free above a floor cell for a robot to stand there: the camera misses low cells."""
CELL = 0.05
"""Side of a cell [m]."""
TOP = 2.0
"""Height up to which a room is explored [m]."""
STEP = 0.04
"""Spacing of samples on a line of sight that mark free cells [m]: less than a cell."""
BEFORE = 0.01
"""Distance before a surface at which a line of sight ends to be free [m]."""
EVERY = 3
"""Stride of the lines of a depth image that mark free cells; all lines mark surfaces."""
UNKNOWN, FREE, SURFACE = 0, 1, 2
Mask = NDArray[np.bool_]


class ExploredSpace:
    """Occupancy grid over the bounds of a map."""

    def __init__(self, bounds: tuple[float, float, float, float]) -> None:
        """Begin with nothing explored within ``bounds``: x_min, y_min, x_max, y_max [m]."""
        self.bounds = bounds
        x_min, y_min, x_max, y_max = bounds
        self.low = np.array([x_min, y_min, 0.0]) - CELL  # walls and floor get cells of their own
        shape = np.ceil((np.array([x_max + CELL, y_max + CELL, TOP]) - self.low) / CELL - 1e-6).astype(int)
        self.cells: NDArray[np.uint8] = np.zeros(tuple(np.maximum(shape, 1)), np.uint8)
        """State of each cell (nx, ny, nz)."""
        self.tries: NDArray[np.uint8] = np.zeros_like(self.cells)
        """Number of images that should have shown each cell and did not."""

    def index(self, points: Array) -> tuple[NDArray[np.intp], Mask]:
        """Compute the cells (n, 3) of map points (n, 3), and a mask (n,) of those inside the grid."""
        cells = np.floor((points - self.low) / CELL).astype(np.intp)
        return cells, np.asarray(((cells >= 0) & (cells < self.cells.shape)).all(axis=1))

    def centres(self, cells: NDArray[np.intp]) -> Array:
        """Compute the centres (n, 3) of cells (n, 3) in the map."""
        return np.asarray(self.low + (cells + 0.5) * CELL)

    def integrate(self, eye: Array, ends: Array, hit: Mask) -> None:
        """Mark cells by lines of sight from an eye (3,) to ends (n, 3); ``hit`` (n,): whether at a surface."""
        lines = ends[::EVERY] - eye
        lengths = np.linalg.norm(lines, axis=1)
        free = np.maximum(lengths - BEFORE * hit[::EVERY], 0.0)
        steps = np.arange(0.0, float(lengths.max(initial=0.0)), STEP)
        along = steps[None] / np.maximum(lengths, 1e-9)[:, None]
        points = (eye + lines[:, None] * along[..., None])[steps[None] < free[:, None]]
        self._mark(points, FREE)
        self._mark(ends[hit], SURFACE)

    def _mark(self, points: Array, state: int) -> None:
        cells, inside = self.index(points)
        index = tuple(cells[inside].T)
        if state == SURFACE:
            self.cells[index] = SURFACE
        else:
            self.cells[index] = np.where(self.cells[index] == SURFACE, SURFACE, state)

    def free_disc(self, place: Sequence[float], radius: float) -> None:
        """Mark the unknown cells of the column in which the robot stands as free."""
        x, y = (self.low[k] + (np.arange(self.cells.shape[k]) + 0.5) * CELL for k in (0, 1))
        inside = np.hypot(x[:, None] - place[0], y[None] - place[1]) <= radius
        column = self.cells[inside]
        self.cells[inside] = np.where(column == UNKNOWN, FREE, column)

    def give_up(self, points: Array) -> None:
        """Count an image that should have shown the cells of points (n, 3); for known cells the count is unused."""
        cells, inside = self.index(points)
        index = tuple(cells[inside].T)
        self.tries[index] = np.minimum(self.tries[index], 250) + 1

    def among(self, points: Array, others: Array) -> Mask:
        """Mark the points (n, 3) that share a cell with one of ``others`` (m, 3), (n,)."""
        marked = np.zeros(self.cells.shape, bool)
        cells, inside = self.index(others)
        marked[tuple(cells[inside].T)] = True
        cells, inside = self.index(points)
        shared = np.zeros(len(points), bool)
        shared[inside] = marked[tuple(cells[inside].T)]
        return shared

    def frontier(self, tries: int) -> Array:
        """Find the centres (n, 3) of unknown cells beside free ones that fewer than ``tries`` images failed to show.

        Frontier-based exploration as in Yamauchi (CIRA 1997).
        """
        free = np.pad(self.cells == FREE, 1)
        beside = np.zeros(self.cells.shape, bool)
        for axis in range(3):
            for shift in (-1, 1):
                beside |= np.roll(free, shift, axis)[1:-1, 1:-1, 1:-1]
        return self.centres(np.argwhere(beside & (self.cells == UNKNOWN) & (self.tries < tries)))

    def clear(self, starts: Array, ends: Array) -> Mask:
        """Mark the lines from starts (n, 3) to ends (n, 3) that cross free cells only, (n,); except at their ends."""
        origins, steps = (starts - self.low) / CELL, ends - starts
        lengths = np.linalg.norm(steps, axis=1)
        steps /= np.maximum(lengths, 1e-9)[:, None]
        free = np.pad(self.cells == FREE, 1, constant_values=True)
        active, good = np.arange(len(starts)), np.ones(len(starts), bool)
        for distance in np.arange(0.3, float(lengths.max(initial=0.0)), CELL):
            active = active[lengths[active] - CELL > distance]
            cells = np.floor(origins[active] + steps[active] * (distance / CELL)).astype(np.intp) + 1
            passed = free[tuple(np.clip(cells, 0, np.array(free.shape) - 1).T)]
            good[active[~passed]] = False
            active = active[passed]
        return good

    def unknown(self, eye: Array, rays: Array, far: float) -> Array:
        """Count the unknown cells (...) on rays (..., 3) from an eye (3,), up to a surface or ``far`` [m]."""
        lengths = np.arange(0.1, far, 2 * CELL)
        points = eye + rays[..., None, :] * lengths[:, None]
        cells, inside = self.index(points.reshape(-1, 3))
        flat = np.full(len(cells), SURFACE, np.uint8)
        flat[inside] = self.cells[tuple(cells[inside].T)]
        states = flat.reshape(points.shape[:-1])
        before = np.cumsum(states == SURFACE, axis=-1) == 0
        return np.asarray(((states == UNKNOWN) & before).sum(axis=-1))

    def room(self, grid: Grid, height: float, radius: float) -> Mask:
        """Mark the cells of a grid (rows, columns) in which a robot of a height and radius [m] has explored room."""
        free = self.standable(height, radius)
        centres = grid.centres().reshape(-1, 2)
        cells, inside = self.index(np.column_stack([centres, np.zeros(len(centres))]))
        room = np.zeros(len(centres), bool)
        room[inside] = free[tuple(cells[inside, :2].T)]
        return room.reshape(grid.rows, grid.columns)

    def standable(self, height: float, radius: float) -> Mask:
        """Mark the floor cells (nx, ny) in which a robot can stand and turn."""
        blocked = ~self.passable(height)
        count = math.ceil(radius / CELL)
        padded, dilated = np.pad(blocked, count, constant_values=True), np.zeros_like(blocked)
        for i, j in product(range(-count, count + 1), repeat=2):
            if math.hypot(i, j) * CELL <= radius:
                dilated |= padded[count + i : count + i + blocked.shape[0], count + j : count + j + blocked.shape[1]]
        return ~dilated

    def passable(self, height: float) -> Mask:
        """Mark the floor cells (nx, ny) that are seen to be free up to a height [m]."""
        column = self.cells[:, :, 2 : max(3, int(height / CELL))]
        return np.asarray(~(column == SURFACE).any(axis=2) & ((column == FREE).mean(axis=2) >= KNOWN))
