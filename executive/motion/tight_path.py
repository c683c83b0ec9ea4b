"""Paths of a base that has to turn before it drives on, since it is not round: search over positions and headings.

The path with the fewest steps over the cells of :mod:`executive.motion.drivable`, pulled straight and checked exactly.
Slower than :mod:`executive.motion.base_path`, for places where that finds no path.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from executive.motion.base_path import Planar, Touching, poses_along
from executive.motion.clearance import Grid
from executive.motion.drivable import EVERY, HEADINGS, TURN, Cell, Poses, around, flood, has
from executive.motion.errors import NoPath
from planlang.geometry import Array

STEPS = (
    *((0, down, side) for down, side in ((0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1))),
    (1, 0, 0),
    (-1, 0, 0),
)
"""Steps between poses, straight ones first, so that a path turns as little as possible."""


def plan_tight_path(
    start: Planar,
    goal: Planar,
    grid: Grid,
    free: Poses,
    touching: Touching,
    resolution: float = 0.08,
    *,
    replans: int = 40,
) -> Array:
    """Plan waypoints (n, 3) of x, y [m] and yaw [rad] from start to goal; yaw is continuous.

    ``free`` holds the poses with room. ``touching(x, y, yaw)`` is called at steps of ``resolution`` [m, rad] along the
    path; steps that touch something are removed and the path is planned again, at most ``replans`` times. Raises
    :class:`NoPath` with counts.
    """
    free, turns, known = free.copy(), np.full_like(free, EVERY), dict[Planar, bool]()

    def hits(path: Array) -> list[Planar]:
        poses = list(poses_along(path, resolution))
        for pose in poses:
            if pose not in known:
                known[pose] = bool(touching(*pose))
        return [pose for pose in poses if known[pose]]

    def connected(pose: Planar) -> list[Cell]:
        return [cell for cell in around(pose, grid) if has(free, cell) and not hits(_path(pose, pose, grid, [cell]))]

    begin, end, attempts = connected(start), connected(goal), 0
    while attempts <= replans:
        attempts += 1
        cells = _shortest(free, turns, begin, end)
        if cells is None:
            break
        path = _path(start, goal, grid, cells)
        if not hits(pulled := _pulled(path, grid, free)):
            return pulled
        blocked = [(a, b) for a, b in pairwise(cells) if hits(_path(None, None, grid, [a, b]))]
        if not blocked:
            return path
        for a, b in blocked:
            _forbid(free, turns, a, b)
    raise NoPath(start, goal, {"exact checks": len(known), "attempts": attempts})


def _forbid(free: Poses, turns: Poses, a: Cell, b: Cell) -> None:
    """Exclude a step from further paths: its turn, or else the pose to which it leads."""
    if a[0] == b[0]:
        free[b[1], b[2]] &= ~np.uint16(1 << b[0])
    else:
        turns[a[1], a[2]] &= ~np.uint16(1 << _lower(a, b))


def _shortest(free: Poses, turns: Poses, begin: list[Cell], end: list[Cell]) -> list[Cell] | None:
    """Find a path with the fewest steps from one of some poses to one of others."""
    steps = flood(free, begin, turns)
    last = next((cell for cell in end if has(steps[-1], cell)), None)
    if last is None:
        return None
    rows, columns = free.shape
    path = [last]
    for reached in reversed(steps[: next(k for k, reached in enumerate(steps) if has(reached, last))]):
        heading, row, column = path[-1]
        before = (((heading + turn) % HEADINGS, row + down, column + side) for turn, down, side in STEPS)
        inside = (cell for cell in before if 0 <= cell[1] < rows and 0 <= cell[2] < columns)
        path.append(next(cell for cell in inside if has(reached, cell) and _may(turns, cell, path[-1])))
    return path[::-1]


def _may(turns: Poses, a: Cell, b: Cell) -> bool:
    """Check that a step is no forbidden turn."""
    return a[0] == b[0] or has(turns, (_lower(a, b), a[1], a[2]))


def _lower(a: Cell, b: Cell) -> int:
    """Heading from which a left turn leads from one of two poses to the other."""
    return a[0] if (a[0] + 1) % HEADINGS == b[0] else b[0]


def _path(start: Planar | None, goal: Planar | None, grid: Grid, cells: list[Cell]) -> Array:
    """Build the path (n, 3) over the poses of cells, from a start and to a goal near them; yaw is continuous."""
    poses = [
        (grid.x + column * grid.resolution, grid.y + row * grid.resolution, heading * TURN)
        for heading, row, column in cells
    ]
    path = np.array([pose for pose in (start, *poses, goal) if pose is not None])
    path[:, 2] = np.unwrap(path[:, 2])
    return np.asarray(path[np.append(True, (np.abs(np.diff(path, axis=0)) > 1e-9).any(axis=1))])


def _pulled(path: Array, grid: Grid, free: Poses) -> Array:
    """Drop the waypoints that a straight line over free poses can skip."""
    kept = [0]
    while kept[-1] < len(path) - 1:
        first = kept[-1]
        last = first + 1
        while last + 1 < len(path) and _is_free(path[[first, last + 1]], grid, free):
            last += 1
        kept.append(last)
    return path[kept]


def _is_free(line: Array, grid: Grid, free: Poses) -> bool:
    """Check whether the poses next to a straight line (2, 3) are free."""
    turn = float(line[1, 2] - line[0, 2])
    count = 2 * math.ceil(max(float(np.hypot(*np.diff(line[:, :2], axis=0)[0])) / grid.resolution, abs(turn) / TURN))
    poses = line[0] + np.linspace(0.0, 1.0, count + 1)[:, None] * (line[1] - line[0])
    row = np.rint((poses[:, 1] - grid.y) / grid.resolution).astype(int)
    column = np.rint((poses[:, 0] - grid.x) / grid.resolution).astype(int)
    low, high = (rounded(poses[:, 2] / TURN).astype(int) % HEADINGS for rounded in (np.floor, np.ceil))
    free_headings = free[np.clip(row, 0, grid.rows - 1), np.clip(column, 0, grid.columns - 1)]
    return bool((free_headings >> low & free_headings >> high & 1).all())
