"""Poses that a base can reach: a flood fill from its pose over the free cells and headings of a grid.

The base moves without turning, or turns on the spot, and thus reaches places where its circumscribed circle has no
room.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from executive.motion.clearance import TOGETHER, Band, Boxes, Grid, Mask, free_cells
from executive.motion.outlines import HEADINGS, TOUCHING, TURN, Outline, block, cores, deciding
from planlang.geometry import Array
from planlang.records import dataclass

Poses = NDArray[np.uint16]
"""Headings of each cell (rows, columns) of a grid, a bit for each."""
EVERY = np.uint16(2**HEADINGS - 1)
"""All headings."""
SPARE = 0.02
"""Clearance required at poses from which the base may drive or turn to the next: real moves are arcs [m]."""
Cell = tuple[int, int, int]
"""Heading, row and column."""
LACKING = 0.05
"""Clearance that may be missing where no path must be ruled out: the distance of a pose from its cell's centre [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Drivable:
    """Poses over a grid to which a base can drive."""

    grid: Grid
    poses: Poses
    beyond: bool = False
    """True if places off the grid may be reachable, too."""

    def __call__(self, bases: Array) -> Mask:
        """Check which base poses (n, 3) may be reachable, (n,)."""
        row = np.rint((bases[:, 1] - self.grid.y) / self.grid.resolution).astype(int)
        column = np.rint((bases[:, 0] - self.grid.x) / self.grid.resolution).astype(int)
        inside = (row >= 0) & (row < self.grid.rows) & (column >= 0) & (column < self.grid.columns)
        row, column = np.clip(row, 0, self.grid.rows - 1), np.clip(column, 0, self.grid.columns - 1)
        heading = np.floor(bases[:, 2] / TURN).astype(int) % HEADINGS
        return np.asarray(np.where(inside, _turned(self.poses)[row, column] >> heading & 1, self.beyond).astype(bool))

    def around(self, places: Array, within: float) -> Mask:
        """Check around which places (n, 2) the base may come at least ``within`` [m] near along both axes, (n,)."""
        grid, steps = self.grid, math.ceil(within / self.grid.resolution) + 1
        total = np.zeros((grid.rows + 1, grid.columns + 1), int)
        total[1:, 1:] = (self.poses > 0).cumsum(axis=0).cumsum(axis=1)
        row = np.rint((places[:, 1] - grid.y) / grid.resolution).astype(int)
        column = np.rint((places[:, 0] - grid.x) / grid.resolution).astype(int)
        low, high = (np.clip(row + step, 0, grid.rows) for step in (-steps, steps + 1))
        left, right = (np.clip(column + step, 0, grid.columns) for step in (-steps, steps + 1))
        found = total[high, right] - total[low, right] - total[high, left] + total[low, left]
        return np.asarray((found > 0) | self.beyond)

    def comes_near(self, place: Array, within: float) -> bool:
        """Check whether the base may come ``within`` [m] of a place (2,)."""
        return self.beyond or self.near(place, within) > 0

    def near(self, place: Array, within: float) -> int:
        """Count the reachable cells ``within`` [m] of a place (2,)."""
        centres = self.grid.centres()[self.poses > 0]
        return int((np.hypot(centres[:, 0] - place[0], centres[:, 1] - place[1]) <= within).sum())


def drivable(start: tuple[float, float, float], grid: Grid, free: Poses, turns: Poses | None = None) -> Drivable:
    """Find the poses that a base at ``start`` can reach over free poses, with one cell of tolerance at both ends.

    ``turns``: poses between which it may turn; None allows all.
    """
    (last,) = deque(flood(free, around(start, grid), turns), maxlen=1)
    return Drivable(grid, _beside(last))


def free_poses(
    grid: Grid, boxes: Boxes, silhouette: Sequence[Band], shapes: Sequence[Outline], slack: float = -SPARE
) -> Poses:
    """Find the poses in which a robot enters no box by more than ``slack`` [m]; negative slack is clearance.

    ``silhouette``: its room to turn; ``shapes``: its outlines, which decide in doubtful cells.
    """
    return poses_for(grid, boxes, silhouette, shapes, (slack,))[0]


def poses_for(
    grid: Grid, boxes: Boxes, silhouette: Sequence[Band], shapes: Sequence[Outline], slacks: Sequence[float]
) -> list[Poses]:
    """Find the :func:`free_poses` for each of several slacks [m]: outlines and boxes are compared once for all."""
    any_heading = [free_cells(grid, boxes, silhouette, slack) for slack in slacks]
    doubtful = free_cells(grid, boxes, cores(shapes), max(slacks) + TOUCHING) & ~np.logical_and.reduce(any_heading)
    cells, centres = np.flatnonzero(doubtful), grid.centres().reshape(-1, 2)
    against = deciding(boxes, shapes)
    blocked = np.zeros((len(slacks), len(cells), HEADINGS), bool)
    for first in range(0, len(cells), TOGETHER // 8):
        part = slice(first, first + TOGETHER // 8)
        block(blocked[:, part], centres[cells[part]], boxes, against, slacks)
    bits = (1 << np.arange(HEADINGS)).astype(np.uint16)
    poses = []
    for mask, occupied in zip(any_heading, blocked, strict=True):
        free = np.where(mask, EVERY, np.uint16(0)).reshape(-1)
        free[cells] |= (~occupied * bits).sum(axis=1, dtype=np.uint16)
        poses.append(free.reshape(grid.rows, grid.columns))
    return poses


def around(pose: tuple[float, float, float], grid: Grid) -> list[Cell]:
    """List the grid poses near a pose, nearest first: a base that stands close to something starts at one of them."""
    exact = pose[2] / TURN, (pose[1] - grid.y) / grid.resolution, (pose[0] - grid.x) / grid.resolution
    near = product(*(range(math.floor(value) - 1, math.floor(value) + 3) for value in exact))
    return [
        (heading % HEADINGS, row, column)
        for heading, row, column in sorted(near, key=lambda one: math.dist(exact, one))
        if 0 <= row < grid.rows and 0 <= column < grid.columns
    ]


def has(poses: Poses, cell: Cell) -> bool:
    """Check whether a set of poses contains a cell."""
    heading, row, column = cell
    return bool(poses[row, column] >> heading & 1)


def flood(free: Poses, begin: Sequence[Cell], turns: Poses | None = None) -> Iterator[Poses]:
    """Yield the free poses reachable from some of them in no step, in at most one, two and so on.

    ``turns`` are the headings from which the base may turn to the next one and back; None allows all.
    """
    reached = np.zeros_like(free)
    for heading, row, column in begin:
        reached[row, column] |= np.uint16(1 << heading)
    last, grown = None, reached & free
    while last is None or not np.array_equal(grown, last):
        yield grown
        last, grown = grown, (_beside(grown) | _turned(grown, EVERY if turns is None else turns)) & free


def _beside(poses: Poses) -> Poses:
    """Add the neighbouring cells, with the same headings."""
    wide = poses.copy()
    wide[:, 1:] |= poses[:, :-1]
    wide[:, :-1] |= poses[:, 1:]
    grown = wide.copy()
    grown[1:] |= wide[:-1]
    grown[:-1] |= wide[1:]
    return grown


def _turned(poses: Poses, turns: Poses | np.uint16 = EVERY) -> Poses:
    """Add the next heading to either side, where turning is allowed."""
    turning, last = poses & turns, HEADINGS - 1
    grown = poses | turning << 1 | turning >> last | (poses >> 1 | poses << last) & turns
    return grown.astype(np.uint16, copy=False)
