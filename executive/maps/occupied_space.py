"""The space that sensors have mapped as occupied: points or cells with something in them, and boxes that cover it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, rotated
from planlang.geometry.shapes import corners, footprint
from planlang.records import dataclass
from sim import Body
from sim.scene import BodyShape

EXPLAINED = 0.1
"""Distance from a thing of the map, beside a cell's length, up to which something mapped is the thing [m]."""
FLOOR = 0.05
"""Height up to which something mapped is the floor: wheels go over it [m]."""
HIGHEST = 2.2
"""Height that no robot, and nothing that it carries, reaches [m]."""
FARTHEST = 200.0
"""Distance from the middle (median) along an axis beyond which a point is an error of the sensor [m]."""
MOST_CELLS = 1_000_000
"""Cells that are compared with the map; finer ones are made coarser until they are so few."""
MOST_BOXES = 500
"""Boxes that the obstacles of a map are made of; what is near each other is joined until they are enough."""

Box = tuple[Pose, tuple[float, float, float]]
"""Pose of the centre in the map, and size [m]."""


_MAP = Pose((0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class OccupiedSpace:
    """Points (n, 3) of a frame about each of which something is."""

    points: Array
    cell: float
    """Length of the cells by which the space is divided [m]."""
    half: float = 0.0
    """Half the height of what a point stands for: none, or a cell's [m]."""
    height: float | None = None
    """Height of obstacles if nothing is known of heights: then z of all points is 0 [m]."""
    frame: Pose = _MAP
    """The frame in the map; its z axis is the map's."""

    def within(self, frame: Pose) -> OccupiedSpace:
        """Return the same with its frame in another one, which has a pose in the map."""
        return replace(self, frame=frame @ self.frame)

    def boxes(self, bodies: Sequence[Body]) -> tuple[list[Box], float]:
        """Return boxes that cover what no body explains, inside of the rooms if there are any.

        The second: how far apart things may be that one box covers, with what is between them [m].
        """
        points, length = self._thinned()
        points = points[self._unexplained(points, bodies, EXPLAINED + length)]
        joined, across = _joined(_cells(points, length)), 1
        while len(joined) > MOST_BOXES:
            across *= 2
            joined = _joined(_fewer(joined, across, MOST_BOXES))
        boxes = [self._box(low, high, length) for low, high in joined.reshape(-1, 3, 2).transpose(0, 2, 1)]
        return boxes, across * length if across > 1 else length - self.cell

    def _box(self, low: NDArray[np.int64], high: NDArray[np.int64], length: float) -> Box:
        x, y, z = ((low + high) * length / 2).tolist()
        depth, width, height = ((high - low) * length).tolist()
        if self.height is not None:
            z, height = self.height / 2, self.height
        return self.frame @ Pose((x, y, z)), (depth, width, height)

    def _thinned(self) -> tuple[Array, float]:
        """Return the points that may be in a robot's way, one for each cell if there are too many, and its length."""
        points = self.points
        if self.height is None:
            points = points[np.isfinite(points).all(axis=1)]
            low = points[:, 2] + self.frame.position[2] - self.half
            points = points[(low >= FLOOR - 1e-9) & (low <= HIGHEST)]
            middle = np.median(points, axis=0) if len(points) else 0.0
            points = points[(np.abs(points - middle) <= FARTHEST).all(axis=1)]
        length, times = self.cell, 1
        while len(points) > MOST_CELLS:
            length = self.cell * times
            points = np.asarray((_cells(points, length)[:, ::2] + 0.5) * length)
            times *= 2
        return (points if self.height is None else points * (1.0, 1.0, 0.0)), length

    def _unexplained(self, points: Array, bodies: Sequence[Body], near: float) -> NDArray[np.bool_]:
        """Return which points are inside of the rooms, if there are any, and nearer to no thing than this [m]."""
        there = moved(self.frame.matrix(), points)
        rooms = [body for body in bodies if body.shape is BodyShape.ROOM]
        kept = np.ones(len(there), dtype=bool)
        if rooms:
            tops = [corners(room.pose, room.size)[:, 2].max() - near for room in rooms]
            inside = [
                _in_outline(there, room, -near) & (there[:, 2] <= top) for room, top in zip(rooms, tops, strict=True)
            ]
            openings = [_in_outline(there, one, 0.0) for room in rooms for one in _openings(room)]
            kept = np.any([*inside, *openings], axis=0)
        for thing in bodies:
            if thing.shape not in (BodyShape.ROOM, BodyShape.MARKER):
                kept &= ~(_in_outline if self.height is not None else _in_box)(there, thing, near)
        return kept


def _openings(room: Body) -> Iterator[Body]:
    """Yield the openings in the walls of a room, as bodies: what a sensor has there is in the way."""
    for one in room.cavities:
        yield Body(room.name, room.pose @ Pose(one.centre), one.size)


def _in_box(points: Array, body: Body, more: float) -> NDArray[np.bool_]:
    """Return which points (n, 3) of the map are in a body that is wider by so much on every side [m]."""
    own = rotated(body.pose.rotation.T, points - body.pose.position) - body.centre
    return np.asarray((np.abs(own) <= np.array(body.size) / 2 + more).all(axis=1))


def _in_outline(points: Array, body: Body, more: float) -> NDArray[np.bool_]:
    """Return which points (n, 3) are in the outline of a body, seen from above, that is wider by so much [m]."""
    outline = footprint(body.pose, body.size)
    inside = np.ones(len(points), dtype=bool)
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        along = (end - start) / max(math.dist(start, end), 1e-9)
        inside &= (points[:, 0] - start[0]) * along[1] - (points[:, 1] - start[1]) * along[0] <= more
    return inside


def _cells(points: Array, length: float) -> NDArray[np.int64]:
    """Return the cells that points (n, 3) are in, each once: from and to along x, y and z, (m, 6), in cells."""
    lows = np.floor(points / length + 1e-9).astype(np.int64)
    lows = lows[np.lexsort(lows.T)]
    if len(lows):
        lows = lows[np.concatenate([[True], (np.diff(lows, axis=0) != 0).any(axis=1)])]
    return np.asarray(np.repeat(lows, 2, axis=1) + np.tile([0, 1], 3))


def _joined(boxes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return boxes (m, 6) that cover the same cells: those that are equal but for x and adjoin are one, then y, z."""
    for axis in range(3):
        others = [2 * other + end for other in range(3) if other != axis for end in (0, 1)]
        boxes = boxes[np.lexsort((boxes[:, 2 * axis], *boxes[:, others].T))]
        apart = (np.diff(boxes[:, others], axis=0) != 0).any(axis=1)
        apart |= boxes[1:, 2 * axis] != boxes[:-1, 2 * axis + 1]
        starts = np.flatnonzero(np.concatenate([np.ones(min(len(boxes), 1), dtype=bool), apart]))
        ends = np.concatenate([starts[1:], [len(boxes)]])[: len(starts)] - 1
        high = boxes[ends, 2 * axis + 1]
        boxes = boxes[starts]
        boxes[:, 2 * axis + 1] = high
    return boxes


def _fewer(boxes: NDArray[np.int64], across: int, most: int) -> NDArray[np.int64]:
    """Return boxes (m, 6), not more than ``most`` if that can be, that cover the same cells and some between them.

    Boxes that are not larger than ``across`` [cells] and begin in one cube of that length are made one, where most
    are together first: what stands alone stays as it is, and so do walls.
    """
    is_small = ((boxes[:, 1::2] - boxes[:, ::2]) <= across).all(axis=1)
    small = boxes[is_small]
    _, cubes, counts = np.unique(small[:, ::2] // across, axis=0, return_inverse=True, return_counts=True)
    densest = np.argsort(-counts, kind="stable")
    saved = np.cumsum(counts[densest] - 1)
    is_joined = np.zeros(len(counts), dtype=bool)
    is_joined[densest[: np.searchsorted(saved, len(boxes) - most) + 1]] = True
    own = np.where(is_joined[cubes.ravel()], cubes.ravel(), len(counts) + np.arange(len(small)))
    order = np.argsort(own, kind="stable")
    starts = np.flatnonzero(np.diff(own[order], prepend=-1))
    found = np.empty((len(starts), 6), dtype=np.int64)
    found[:, ::2] = np.minimum.reduceat(small[order, ::2], starts) if len(starts) else 0
    found[:, 1::2] = np.maximum.reduceat(small[order, 1::2], starts) if len(starts) else 0
    return np.concatenate([boxes[~is_small], found])
