"""Paths of a base that is not round, where it has to turn before it drives on: over places and headings.

The way with the fewest steps over the cells of :mod:`executive.motion.drivable`, pulled straight, checked exactly. It
takes longer to find than one of :mod:`executive.motion.base_path`, and is found where that has none.
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
"""Steps between poses: straight ones first, so that a way turns as little as it can."""


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
    """Return waypoints (n, 3) of x, y [m] and yaw [rad] from start to goal; yaw is continuous.

    ``free`` says where there is room. ``touching(x, y, yaw)`` is asked at steps of ``resolution`` [m, rad] along the
    path found; where something touches it is planned anew without these steps, at most ``replans`` times. Raises
    :class:`NoPath` with counts.
    """
    free, turns, known = free.copy(), np.full_like(free, EVERY), dict[Planar, bool]()

    def hits(path: Array) -> list[Planar]:
        poses = list(poses_along(path, resolution))
        for pose in poses:
            if pose not in known:
                known[pose] = bool(touching(*pose))
        return [pose for pose in poses if known[pose]]

    def joined(pose: Planar) -> list[Cell]:
        return [cell for cell in around(pose, grid) if has(free, cell) and not hits(_path(pose, pose, grid, [cell]))]

    begin, end, attempts = joined(start), joined(goal), 0
    while attempts <= replans:
        attempts += 1
        cells = _way(free, turns, begin, end)
        if cells is None:
            break
        path = _path(start, goal, grid, cells)
        if not hits(pulled := _pulled(path, grid, free)):
            return pulled
        met = [(a, b) for a, b in pairwise(cells) if hits(_path(None, None, grid, [a, b]))]
        if not met:
            return path
        for a, b in met:
            _forbid(free, turns, a, b)
    raise NoPath(start, goal, {"exact checks": len(known), "attempts": attempts})


def _forbid(free: Poses, turns: Poses, a: Cell, b: Cell) -> None:
    """Keep the next way from a step: from a turn there, or else from the pose to which it leads."""
    if a[0] == b[0]:
        free[b[1], b[2]] &= ~np.uint16(1 << b[0])
    else:
        turns[a[1], a[2]] &= ~np.uint16(1 << _lower(a, b))


def _way(free: Poses, turns: Poses, begin: list[Cell], end: list[Cell]) -> list[Cell] | None:
    """Return a way with the fewest steps from one of some poses to another of some."""
    steps = flood(free, begin, turns)
    last = next((cell for cell in end if has(steps[-1], cell)), None)
    if last is None:
        return None
    rows, columns = free.shape
    way = [last]
    for reached in reversed(steps[: next(k for k, reached in enumerate(steps) if has(reached, last))]):
        heading, row, column = way[-1]
        before = (((heading + turn) % HEADINGS, row + down, column + side) for turn, down, side in STEPS)
        inside = (cell for cell in before if 0 <= cell[1] < rows and 0 <= cell[2] < columns)
        way.append(next(cell for cell in inside if has(reached, cell) and _may(turns, cell, way[-1])))
    return way[::-1]


def _may(turns: Poses, a: Cell, b: Cell) -> bool:
    """Return whether a step turns nowhere where that is forbidden."""
    return a[0] == b[0] or has(turns, (_lower(a, b), a[1], a[2]))


def _lower(a: Cell, b: Cell) -> int:
    """Return the heading from which a turn to the left leads from one of two poses to the other."""
    return a[0] if (a[0] + 1) % HEADINGS == b[0] else b[0]


def _path(start: Planar | None, goal: Planar | None, grid: Grid, cells: list[Cell]) -> Array:
    """Return the path (n, 3) over the poses of cells, from a start and to a goal beside them; yaw is continuous."""
    poses = [
        (grid.x + column * grid.resolution, grid.y + row * grid.resolution, heading * TURN)
        for heading, row, column in cells
    ]
    path = np.array([pose for pose in (start, *poses, goal) if pose is not None])
    path[:, 2] = np.unwrap(path[:, 2])
    return np.asarray(path[np.append(True, (np.abs(np.diff(path, axis=0)) > 1e-9).any(axis=1))])


def _pulled(path: Array, grid: Grid, free: Poses) -> Array:
    """Leave out the waypoints that a straight line passes by over free poses."""
    kept = [0]
    while kept[-1] < len(path) - 1:
        first = kept[-1]
        last = first + 1
        while last + 1 < len(path) and _is_free(path[[first, last + 1]], grid, free):
            last += 1
        kept.append(last)
    return path[kept]


def _is_free(line: Array, grid: Grid, free: Poses) -> bool:
    """Return whether the poses next to a straight line (2, 3) are free."""
    turn = float(line[1, 2] - line[0, 2])
    count = 2 * math.ceil(max(float(np.hypot(*np.diff(line[:, :2], axis=0)[0])) / grid.resolution, abs(turn) / TURN))
    poses = line[0] + np.linspace(0.0, 1.0, count + 1)[:, None] * (line[1] - line[0])
    row = np.rint((poses[:, 1] - grid.y) / grid.resolution).astype(int)
    column = np.rint((poses[:, 0] - grid.x) / grid.resolution).astype(int)
    low, high = (rounded(poses[:, 2] / TURN).astype(int) % HEADINGS for rounded in (np.floor, np.ceil))
    there = free[np.clip(row, 0, grid.rows - 1), np.clip(column, 0, grid.columns - 1)]
    return bool((there >> low & there >> high & 1).all())
