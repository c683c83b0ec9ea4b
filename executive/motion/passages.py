"""The narrowest doorway through which a robot drives, by the flood with which plans look for ways."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence

import numpy as np

from executive.motion.clearance import Band, Boxes, Grid
from executive.motion.floods import drivable, free_poses
from executive.motion.outlines import Outline
from planlang.geometry import Pose

WIDTHS = tuple(round(0.2 + 0.01 * step, 2) for step in range(281))
"""Widths of doorways that are tried [m]."""
HEIGHT, WALL = 2.0, 0.1
"""Height of these doorways, and thickness of their wall [m]."""
BEYOND, BESIDE = 0.2, 0.3
"""Distances that a robot drives from the wall, beyond its own radius, and at most from the middle of a doorway [m]."""
OFF_GRID = (0.0, 0.025)
"""Offsets of a doorway's middle from the border of two cells [m]: the farthest from the middle of one, and on it."""


def narrowest_doorway(silhouette: Sequence[Band], shapes: Sequence[Outline]) -> float | None:
    """Find the narrowest doorway, wherever it is on the grid of poses, through which a robot drives [m].

    ``silhouette``: its room to turn; ``shapes``: its outlines. None if it is not among :data:`WIDTHS`.
    """
    away = BEYOND + max((radius for _, _, radius in silhouette), default=0.0)
    grid = Grid.over((-away, -BESIDE), (away, BESIDE))
    start, goal = (grid.resolution - away, 0.0, 0.0), np.array([[away - grid.resolution, 0.0, 0.0]])

    def passes(width: float) -> bool:
        for off in OFF_GRID:
            middles = [(0.0, off + sign * (width / 2 + away), HEIGHT / 2) for sign in (1, -1)]
            lintel, above = (0.0, off, 1.5 * HEIGHT), (WALL, width, HEIGHT)
            walls = Boxes.around(map(Pose, (*middles, lintel)), [*[(WALL, 2 * away, HEIGHT)] * 2, above])
            if not drivable(start, grid, free_poses(grid, walls, silhouette, shapes))(goal)[0]:
                return False
        return True

    number = bisect_left(WIDTHS, True, key=passes)
    return WIDTHS[number] if number < len(WIDTHS) else None
