"""Where a base can drive to: one flood fill from where it stands, over places and headings in which it has room.

It moves without turning, or turns on the spot. So a base that is not round gets where a circle about it would not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from executive.motion.clearance import TOUCHING, Band, Boxes, Grid, Outline, cores, stands_in_none
from planlang.geometry import Array
from planlang.records import dataclass

Mask = NDArray[np.bool_]
Poses = NDArray[np.uint16]
"""Headings for each cell (rows, columns) of a grid: a bit for each of them."""
HEADINGS = 16
"""Headings in which it is looked whether a base has room."""
EVERY = np.uint16(2**HEADINGS - 1)
"""All headings."""
SPARE = 0.02
"""Room that there is beside a pose from which the base may drive or turn on to the next: it does so in an arc [m]."""
Cell = tuple[int, int, int]
"""A heading, a row and a column."""
TURN = 2 * math.pi / HEADINGS
"""From one heading to the next [rad]."""
THIN = 0.01
"""Half the width of a box below which none is taken to be smaller than it is [m]: nothing drives through a wall."""
LACKING = 0.05
"""Room that a pose may lack where no way is to be ruled out: the middle of its cell is as far away from it [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Drivable:
    """The poses over a grid to which a base can drive."""

    grid: Grid
    poses: Poses
    beyond: bool = False
    """True if it may get to places off the grid."""

    def __call__(self, bases: Array) -> Mask:
        """Return which base poses (n, 3) may be driven to, (n,)."""
        row = np.rint((bases[:, 1] - self.grid.y) / self.grid.resolution).astype(int)
        column = np.rint((bases[:, 0] - self.grid.x) / self.grid.resolution).astype(int)
        inside = (row >= 0) & (row < self.grid.rows) & (column >= 0) & (column < self.grid.columns)
        row, column = np.clip(row, 0, self.grid.rows - 1), np.clip(column, 0, self.grid.columns - 1)
        heading = np.floor(bases[:, 2] / TURN).astype(int) % HEADINGS
        return np.asarray(np.where(inside, _turned(self.poses)[row, column] >> heading & 1, self.beyond).astype(bool))

    def comes_near(self, place: Array, within: float) -> bool:
        """Return True if the base may get ``within`` [m] of a place (2,)."""
        return self.beyond or self.near(place, within) > 0

    def near(self, place: Array, within: float) -> int:
        """Count the cells ``within`` [m] of a place (2,) that the base can get to."""
        centres = self.grid.centres()[self.poses > 0]
        return int((np.hypot(centres[:, 0] - place[0], centres[:, 1] - place[1]) <= within).sum())


def drivable(start: tuple[float, float, float], grid: Grid, free: Poses) -> Drivable:
    """Return where a base at ``start`` can get to over free poses: as near to its start and its end as cells are."""
    return Drivable(grid, _beside(flood(free, around(start, grid))[-1]))


def free_poses(
    grid: Grid, boxes: Boxes, silhouette: Sequence[Band], shapes: Sequence[Outline], slack: float = -SPARE
) -> Poses:
    """Return in which poses a robot is no deeper than ``slack`` [m] in a box; if that is negative, so far from all.

    ``silhouette``: its room to turn; ``shapes``: its outlines, which are asked where that does not decide.
    """
    turns = free_cells(grid, boxes, silhouette, slack)
    doubtful = free_cells(grid, boxes, cores(shapes), slack + TOUCHING) & ~turns
    free = np.where(turns, EVERY, np.uint16(0))
    places = grid.centres()[doubtful]
    least = np.minimum(boxes.half_extents, THIN)
    smaller = Boxes(boxes.centres, np.maximum(boxes.half_extents - (slack, slack, 0.0), least), boxes.yaws)
    for heading in range(HEADINGS if len(places) else 0):
        bases = np.column_stack([places, np.full(len(places), heading * TURN)])
        free[doubtful] |= stands_in_none(bases, smaller, shapes).astype(np.uint16) << np.uint16(heading)
    return free


def around(pose: tuple[float, float, float], grid: Grid) -> list[Cell]:
    """Return the poses over a grid near a pose, nearest first: a base that stands close to something goes to one."""
    exact = pose[2] / TURN, (pose[1] - grid.y) / grid.resolution, (pose[0] - grid.x) / grid.resolution
    near = product(*(range(math.floor(value) - 1, math.floor(value) + 3) for value in exact))
    return [
        (heading % HEADINGS, row, column)
        for heading, row, column in sorted(near, key=lambda one: math.dist(exact, one))
        if 0 <= row < grid.rows and 0 <= column < grid.columns
    ]


def has(poses: Poses, cell: Cell) -> bool:
    """Return whether a pose is one of some."""
    heading, row, column = cell
    return bool(poses[row, column] >> heading & 1)


def flood(free: Poses, begin: Sequence[Cell], turns: Poses | None = None) -> list[Poses]:
    """Return the free poses that are got to from some of them in no step, in one at most, in two at most and so on.

    ``turns``: from which headings the base may turn to the next, and back; from all if it is None.
    """
    reached = np.zeros_like(free)
    for heading, row, column in begin:
        reached[row, column] |= np.uint16(1 << heading)
    steps = [reached & free]
    while True:
        further = (_beside(steps[-1]) | _turned(steps[-1], EVERY if turns is None else turns)) & free
        if np.array_equal(further, steps[-1]):
            return steps
        steps.append(further)


def _beside(poses: Poses) -> Poses:
    """Return poses and those beside them, with the same headings."""
    wide = poses.copy()
    wide[:, 1:] |= poses[:, :-1]
    wide[:, :-1] |= poses[:, 1:]
    found = wide.copy()
    found[1:] |= wide[:-1]
    found[:-1] |= wide[1:]
    return found


def _turned(poses: Poses, turns: Poses | np.uint16 = EVERY) -> Poses:
    """Return poses and those with the next heading to either side, where a turn is allowed."""
    ahead, last = poses & turns, HEADINGS - 1
    found = poses | ahead << 1 | ahead >> last | (poses >> 1 | poses << last) & turns
    return found.astype(np.uint16, copy=False)


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
