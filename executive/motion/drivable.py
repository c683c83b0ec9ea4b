"""Reachability of base poses: one flood fill from the robot's pose over free cells and headings.

The base moves without turning, or turns on the spot. A base that is not round thus reaches places where its
circumscribed circle has no room.
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
"""Headings of each cell (rows, columns) of a grid, a bit for each."""
HEADINGS = 16
"""Number of headings tested for room."""
EVERY = np.uint16(2**HEADINGS - 1)
"""All headings."""
SPARE = 0.02
"""Clearance required at poses from which the base may drive or turn to the next: real moves are arcs [m]."""
Cell = tuple[int, int, int]
"""Heading, row and column."""
TURN = 2 * math.pi / HEADINGS
"""Angle between neighbouring headings [rad]."""
THIN = 0.01
"""Least half width to which boxes are shrunk [m]: walls must not vanish."""
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

    def comes_near(self, place: Array, within: float) -> bool:
        """Check whether the base may come ``within`` [m] of a place (2,)."""
        return self.beyond or self.near(place, within) > 0

    def near(self, place: Array, within: float) -> int:
        """Count the reachable cells ``within`` [m] of a place (2,)."""
        centres = self.grid.centres()[self.poses > 0]
        return int((np.hypot(centres[:, 0] - place[0], centres[:, 1] - place[1]) <= within).sum())


def drivable(start: tuple[float, float, float], grid: Grid, free: Poses) -> Drivable:
    """Find the poses that a base at ``start`` can reach over free poses, with one cell of tolerance at both ends."""
    return Drivable(grid, _beside(flood(free, around(start, grid))[-1]))


def free_poses(
    grid: Grid, boxes: Boxes, silhouette: Sequence[Band], shapes: Sequence[Outline], slack: float = -SPARE
) -> Poses:
    """Find the poses in which a robot enters no box by more than ``slack`` [m]; negative slack is clearance.

    ``silhouette``: its room to turn; ``shapes``: its outlines, which decide in doubtful cells.
    """
    any_heading = free_cells(grid, boxes, silhouette, slack)
    doubtful = free_cells(grid, boxes, cores(shapes), slack + TOUCHING) & ~any_heading
    free = np.where(any_heading, EVERY, np.uint16(0))
    places = grid.centres()[doubtful]
    thinnest = np.minimum(boxes.half_extents, THIN)
    shrunk = Boxes(boxes.centres, np.maximum(boxes.half_extents - (slack, slack, 0.0), thinnest), boxes.yaws)
    for heading in range(HEADINGS if len(places) else 0):
        bases = np.column_stack([places, np.full(len(places), heading * TURN)])
        free[doubtful] |= stands_in_none(bases, shrunk, shapes).astype(np.uint16) << np.uint16(heading)
    return free


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


def flood(free: Poses, begin: Sequence[Cell], turns: Poses | None = None) -> list[Poses]:
    """Find the free poses reachable from some of them in no step, in at most one, two and so on.

    ``turns`` are the headings from which the base may turn to the next one and back; None allows all.
    """
    reached = np.zeros_like(free)
    for heading, row, column in begin:
        reached[row, column] |= np.uint16(1 << heading)
    steps = [reached & free]
    while True:
        grown = (_beside(steps[-1]) | _turned(steps[-1], EVERY if turns is None else turns)) & free
        if np.array_equal(grown, steps[-1]):
            return steps
        steps.append(grown)


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
