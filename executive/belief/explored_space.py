"""The part of a room that the camera has shown: cells that are free, cells with a surface, and all others."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from executive.motion import Grid
from planlang.geometry import Array

KNOWN = 0.4
"""Share of the cells over a place that must have been seen for a robot to stand there: the camera misses low ones."""
CELL = 0.05
"""Side of a cell [m]."""
TOP = 2.0
"""Height up to which a room is explored [m]."""
STEP = 0.04
"""Distance of points on a line of sight that are taken as free [m]: less than a cell."""
BEFORE = 0.01
"""Lines of sight are free up to this far before a surface [m]; the cell of the surface counts as such all the same."""
EVERY = 3
"""Of so many lines of a picture one frees cells; all that end at a surface count."""
UNKNOWN, FREE, SURFACE = 0, 1, 2
Mask = NDArray[np.bool_]


class ExploredSpace:
    """A grid of cells over the bounds of a map."""

    def __init__(self, bounds: tuple[float, float, float, float]) -> None:
        """Begin with nothing explored within ``bounds``: x_min, y_min, x_max, y_max [m]."""
        self.bounds = bounds
        x_min, y_min, x_max, y_max = bounds
        self.low = np.array([x_min, y_min, 0.0]) - CELL  # walls and floor get cells of their own
        shape = np.ceil((np.array([x_max + CELL, y_max + CELL, TOP]) - self.low) / CELL - 1e-6).astype(int)
        self.cells: NDArray[np.uint8] = np.zeros(tuple(np.maximum(shape, 1)), np.uint8)
        """State of each cell (nx, ny, nz)."""
        self.tries: NDArray[np.uint8] = np.zeros_like(self.cells)
        """Number of pictures in which each cell should have been and was not."""

    def index(self, points: Array) -> tuple[NDArray[np.intp], Mask]:
        """Return the cells (n, 3) of points (n, 3), and which of them are inside the grid, (n,)."""
        cells = np.floor((points - self.low) / CELL).astype(np.intp)
        return cells, np.asarray(((cells >= 0) & (cells < self.cells.shape)).all(axis=1))

    def centres(self, cells: NDArray[np.intp]) -> Array:
        """Return the middles (n, 3) of cells (n, 3)."""
        return np.asarray(self.low + (cells + 0.5) * CELL)

    def integrate(self, eye: Array, ends: Array, hit: Mask) -> None:
        """Learn from lines of sight from an eye (3,) to ends (n, 3), which are at a surface or in free space."""
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
        chosen = tuple(cells[inside].T)
        if state == SURFACE:
            self.cells[chosen] = SURFACE
        else:
            self.cells[chosen] = np.where(self.cells[chosen] == SURFACE, SURFACE, state)

    def free_disc(self, place: Sequence[float], radius: float) -> None:
        """Learn that a column around a place is free: the robot stands there."""
        x, y = (self.low[k] + (np.arange(self.cells.shape[k]) + 0.5) * CELL for k in (0, 1))
        inside = np.hypot(x[:, None] - place[0], y[None] - place[1]) <= radius
        column = self.cells[inside]
        self.cells[inside] = np.where(column == UNKNOWN, FREE, column)

    def give_up(self, points: Array) -> None:
        """Record that cells, by points (n, 3), should have been in a picture; those that are known do not matter."""
        cells, inside = self.index(points)
        chosen = tuple(cells[inside].T)
        self.tries[chosen] = np.minimum(self.tries[chosen], 250) + 1

    def among(self, points: Array, others: Array) -> Mask:
        """Return which points (n, 3) are in cells in which others (m, 3) are, too."""
        marked = np.zeros(self.cells.shape, bool)
        cells, inside = self.index(others)
        marked[tuple(cells[inside].T)] = True
        cells, inside = self.index(points)
        found = np.zeros(len(points), bool)
        found[inside] = marked[tuple(cells[inside].T)]
        return found

    def frontier(self, tries: int) -> Array:
        """Return the middles (n, 3) of unknown cells beside free ones, unless so many pictures failed to show them."""
        free = np.pad(self.cells == FREE, 1)
        beside = np.zeros(self.cells.shape, bool)
        for axis in range(3):
            for shift in (-1, 1):
                beside |= np.roll(free, shift, axis)[1:-1, 1:-1, 1:-1]
        return self.centres(np.argwhere(beside & (self.cells == UNKNOWN) & (self.tries < tries)))

    def clear(self, starts: Array, ends: Array) -> Mask:
        """Return which lines from starts (n, 3) to ends (n, 3) pass free cells alone, the last cell left out, (n,)."""
        places, steps = (starts - self.low) / CELL, ends - starts
        lengths = np.linalg.norm(steps, axis=1)
        steps /= np.maximum(lengths, 1e-9)[:, None]
        free = np.pad(self.cells == FREE, 1, constant_values=True)
        left, good = np.arange(len(starts)), np.ones(len(starts), bool)
        for away in np.arange(0.3, float(lengths.max(initial=0.0)), CELL):
            left = left[lengths[left] - CELL > away]
            cells = np.floor(places[left] + steps[left] * (away / CELL)).astype(np.intp) + 1
            passed = free[tuple(np.clip(cells, 0, np.array(free.shape) - 1).T)]
            good[left[~passed]] = False
            left = left[passed]
        return good

    def unknown(self, eye: Array, rays: Array, far: float) -> Array:
        """Return how many unknown cells rays (..., 3) from an eye (3,) meet up to a surface or ``far`` [m], (...)."""
        lengths = np.arange(0.1, far, 2 * CELL)
        points = eye + rays[..., None, :] * lengths[:, None]
        cells, inside = self.index(points.reshape(-1, 3))
        flat = np.full(len(cells), SURFACE, np.uint8)
        flat[inside] = self.cells[tuple(cells[inside].T)]
        states = flat.reshape(points.shape[:-1])
        before = np.cumsum(states == SURFACE, axis=-1) == 0
        return np.asarray(((states == UNKNOWN) & before).sum(axis=-1))

    def room(self, grid: Grid, height: float, radius: float) -> Mask:
        """Return where on a grid (rows, columns) a robot of a height and radius [m] has room, as far as was seen."""
        free = self.standable(height, radius)
        centres = grid.centres().reshape(-1, 2)
        cells, inside = self.index(np.column_stack([centres, np.zeros(len(centres))]))
        found = np.zeros(len(centres), bool)
        found[inside] = free[tuple(cells[inside, :2].T)]
        return found.reshape(grid.rows, grid.columns)

    def standable(self, height: float, radius: float) -> Mask:
        """Return in which cells of the floor (nx, ny) a robot can stand and turn."""
        blocked = ~self.passable(height)
        count = math.ceil(radius / CELL)
        padded, found = np.pad(blocked, count, constant_values=True), np.zeros_like(blocked)
        for i, j in product(range(-count, count + 1), repeat=2):
            if math.hypot(i, j) * CELL <= radius:
                found |= padded[count + i : count + i + blocked.shape[0], count + j : count + j + blocked.shape[1]]
        return ~found

    def passable(self, height: float) -> Mask:
        """Return over which cells of the floor (nx, ny) nothing is up to a height [m], as far as was seen."""
        column = self.cells[:, :, 2 : max(3, int(height / CELL))]
        return np.asarray(~(column == SURFACE).any(axis=2) & ((column == FREE).mean(axis=2) >= KNOWN))


KNOWN = 0.4
"""Share of the cells over a place that must have been seen for a robot to stand there: the camera misses low ones."""
