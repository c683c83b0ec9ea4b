"""Walls of a room of the map, as boxes with its openings cut out of them."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from planlang.geometry import Pose
from sim import Body

WALL = 0.1
"""Thickness of a room's walls [m]."""


def walls_of(room: Body) -> Iterator[tuple[Pose, tuple[float, float, float]]]:
    """Yield poses in the map and sizes of the boxes that are a room's walls: what its openings leave of the four."""
    height = room.size[2]
    for sign, axis in itertools.product((-1.0, 1.0), (0, 1)):
        face, half = room.size[axis] / 2, room.size[1 - axis] / 2
        cuts = sorted(
            (cut.centre[1 - axis] - cut.size[1 - axis] / 2, cut.centre[1 - axis] + cut.size[1 - axis] / 2, cut)
            for cut in room.cavities
            if abs(cut.centre[axis] - sign * (face + WALL / 2)) < WALL
        )
        ends = [-half, *(end for low, high, _ in cuts for end in (low, high)), half]
        pieces = [(low, high, -height / 2) for low, high in zip(ends[::2], ends[1::2], strict=True)]
        pieces += [(low, high, cut.centre[2] + cut.size[2] / 2) for low, high, cut in cuts]
        for low, high, bottom in pieces:
            along, z = (low + high) / 2, (bottom + height / 2) / 2
            place = (sign * (face + WALL / 2), along) if axis == 0 else (along, sign * (face + WALL / 2))
            extents = (WALL, high - low) if axis == 0 else (high - low, WALL)
            if high > low and bottom < height / 2:
                yield room.pose @ Pose((*place, z)), (*extents, height / 2 - bottom)
