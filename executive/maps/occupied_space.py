"""Occupied space from sensor data: points or cells, and a limited number of boxes that cover them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.cover import at_most, cells
from planlang.geometry.matrices import moved, rotated
from planlang.geometry.shapes import corners, footprint
from planlang.records import dataclass
from sim import Body
from sim.scene import BodyShape

EXPLAINED = 0.1
"""Points within this distance, plus a cell's length, of a body of the map belong to that body [m]."""
FLOOR = 0.05
"""Points up to this height are the floor: wheels roll over it [m]."""
HIGHEST = 2.2
"""No robot, and nothing that it carries, reaches above this height [m]."""
FARTHEST = 200.0
"""Points farther than this from the median along an axis are sensor errors [m]."""
TILTED = 1e-6
"""Greatest difference of a frame's vertical from that of the map, as 1 minus a cosine."""
MOST_CELLS = 1_000_000
"""Greatest number of cells to compare with the map; cells are made coarser until they are that few."""
MOST_BOXES = 500
"""Greatest number of boxes; close ones are joined until there are that few."""

Box = tuple[Pose, tuple[float, float, float]]
"""Pose of the centre in the map, and size [m]."""


_MAP = Pose((0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True, eq=False)
class OccupiedSpace:
    """Occupied points of a frame."""

    points: Array
    """Shape (n, 3), in ``frame`` [m]."""
    cell: float
    """Edge of the cells into which the space is divided [m]."""
    half: float = 0.0
    """Half the height that a point represents: 0, or half a cell [m]."""
    height: float | None = None
    """Common height of the obstacles if the data are two-dimensional: then z of all points is 0 [m]."""
    frame: Pose = _MAP
    """Pose of the frame in the map; both z axes are parallel."""

    def within(self, frame: Pose) -> OccupiedSpace:
        """Interpret the frame as relative to another one, which has a pose in the map.

        Points are moved into the map if a frame is tilted, as boxes are upright; two-dimensional data must not be.
        """
        whole = frame @ self.frame
        if self.height is not None or abs(whole.rotation[2, 2] - 1.0) < TILTED:
            return replace(self, frame=whole)
        return replace(self, points=moved(whole.matrix(), self.points), frame=_MAP)

    def boxes(self, bodies: Sequence[Body]) -> tuple[list[Box], float]:
        """Cover the points that no body explains with boxes; if there are rooms, only the points inside.

        Returns also the greatest length of gaps that a box may bridge [m].
        """
        points, length = self._downsampled()
        points = points[self._unexplained(points, bodies, EXPLAINED + length)]
        covering, across = at_most(cells(points, length), MOST_BOXES)
        boxes = [self._box(low, high, length) for low, high in covering.reshape(-1, 3, 2).transpose(0, 2, 1)]
        return boxes, across * length or length - self.cell

    def why_empty(self) -> str:
        """Say why none of the points can be in a robot's way; "" if some are, or are explained by the map."""
        points = self.points[np.isfinite(self.points).all(axis=1)]
        if not len(points):
            return "no cell is occupied" if self.height is not None else "it has no finite points"
        if len(self._downsampled()[0]):
            return ""
        lowest, highest = (float(z) + self.frame.position[2] for z in (points[:, 2].min(), points[:, 2].max()))
        return (
            f"its points are {lowest:.3g} to {highest:.3g} high, and obstacles {FLOOR} to {HIGHEST} m; "
            "write coordinates in metres, with z upwards and 0 on the floor"
        )

    def _box(self, low: NDArray[np.int64], high: NDArray[np.int64], length: float) -> Box:
        x, y, z = ((low + high) * length / 2).tolist()
        depth, width, height = ((high - low) * length).tolist()
        if self.height is not None:
            z, height = self.height / 2, self.height
        return self.frame @ Pose((x, y, z)), (depth, width, height)

    def _downsampled(self) -> tuple[Array, float]:
        """Keep the points that can be in a robot's way, one per cell if there are too many; and the cell's edge [m]."""
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
            points = np.asarray((cells(points, length)[:, ::2] + 0.5) * length)
            times *= 2
        return (points if self.height is None else points * (1.0, 1.0, 0.0)), length

    def _unexplained(self, points: Array, bodies: Sequence[Body], near: float) -> NDArray[np.bool_]:
        """Mask of the points that are inside rooms, if there are any, and not within ``near`` [m] of a body."""
        in_map = moved(self.frame.matrix(), points)
        rooms = [body for body in bodies if body.shape is BodyShape.ROOM]
        mask = np.ones(len(in_map), dtype=bool)
        if rooms:
            tops = [corners(room.pose, room.size)[:, 2].max() - near for room in rooms]
            inside = [
                _in_outline(in_map, room, -near) & (in_map[:, 2] <= top) for room, top in zip(rooms, tops, strict=True)
            ]
            openings = [_in_outline(in_map, one, 0.0) for room in rooms for one in _openings(room)]
            mask = np.any([*inside, *openings], axis=0)
        for body in bodies:
            if body.shape not in (BodyShape.ROOM, BodyShape.MARKER):
                mask &= ~(_in_outline if self.height is not None else _in_box)(in_map, body, near)
        return mask


def _openings(room: Body) -> Iterator[Body]:
    """Yield the openings in the walls of a room, as bodies: obstacles there block a doorway."""
    for one in room.cavities:
        yield Body(room.name, room.pose @ Pose(one.centre), one.size)


def _in_box(points: Array, body: Body, more: float) -> NDArray[np.bool_]:
    """Mask of the points (n, 3), in the map frame, inside a body's box that is enlarged on every side by ``more``."""
    local = rotated(body.pose.rotation.T, points - body.pose.position) - body.centre
    return np.asarray((np.abs(local) <= np.array(body.size) / 2 + more).all(axis=1))


def _in_outline(points: Array, body: Body, more: float) -> NDArray[np.bool_]:
    """Mask of the points (n, 3) inside the footprint of a body that is enlarged on every side by ``more`` [m]."""
    outline = footprint(body.pose, body.size)
    inside = np.ones(len(points), dtype=bool)
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        along = (end - start) / max(math.dist(start, end), 1e-9)
        inside &= (points[:, 0] - start[0]) * along[1] - (points[:, 1] - start[1]) * along[0] <= more
    return inside
