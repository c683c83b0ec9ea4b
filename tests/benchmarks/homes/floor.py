"""The floor that a base may stand on: more than it really can, so that what is out of reach from it is out of reach.

Of the base there is only its core, a disc about its middle that is in it however it is turned; leaves, people and what
a hand can take away are not in its way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property

import numpy as np
import pybullet
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from sim import Body, Scene
from sim.bodies import plain
from tests.benchmarks.homes.furnishing import Rectangle
from tests.support.locations.oracle import Oracle
from tests.support.locations.plates import held_against
from tests.support.locations.room_walls import walls_of

CELL = 0.025
"""Resolution [m]."""
SLACK = CELL / math.sqrt(2.0) + 0.002
"""By how much the core may be in something at the middle of a cell: elsewhere in the cell it is free of it [m]."""
LOW = 0.2
"""Bodies that begin higher than this are not in the way of the base's lowest part [m]."""
DIRECTIONS = 72
"""In which the base is measured."""
AROUND = 1.6
"""Half the extent of the floor that is looked at around a place [m]: more than an arm's length."""


class Floor:
    """Where the core of a base gets to from its start, in cells."""

    def __init__(self, oracle: Oracle, scene: Scene) -> None:
        self._oracle, self._scene = oracle, scene
        self.start = np.array(oracle.room.start[:2])
        rooms = [body for body in scene.bodies if body.shape == "room"]
        corners = np.concatenate([outline(room).corners() for room in rooms])
        self._low = corners.min(axis=0)
        numbers = np.ceil((corners.max(axis=0) - self._low) / CELL).astype(int) + 1
        self._grid = self._low + CELL * np.stack(np.meshgrid(*map(np.arange, numbers), indexing="ij"), -1)

    @cached_property
    def cells(self) -> Array:
        """Middles (n, 2) of all cells."""
        return np.asarray(self._grid[self._joined])

    def around(self, place: Array) -> Array:
        """Middles (n, 2) of the cells around a place (2,)."""
        return self.cells[np.abs(self.cells - place).max(axis=1, initial=0.0) < AROUND]

    def shifts(self, places: Array) -> Array:
        """Return the ways (n, 2) from places (n, 2) to the nearest cells, zero for those in one."""
        first, nearest = self._nearest
        at = np.clip(np.round((places - first) / CELL).astype(int), 0, np.array(nearest.shape[:2]) - 1)
        found = nearest[at[:, 0], at[:, 1]] - places
        return np.where(np.abs(found).max(axis=1, keepdims=True) <= CELL / 2 + 1e-9, 0.0, found)

    @cached_property
    def _nearest(self) -> tuple[Array, Array]:
        """The first cell of the grid, and for each one the nearest that is free: in its row, then across rows."""
        free, (rows, columns) = self._joined, self._joined.shape
        at = np.arange(rows)[:, None]
        before = np.maximum.accumulate(np.where(free, at, -(10**6)), axis=0)
        behind = np.minimum.accumulate(np.where(free, at, 10**6)[::-1], axis=0)[::-1]
        row = np.where(at - before <= behind - at, before, behind)
        across = (np.arange(columns)[:, None] - np.arange(columns)) ** 2
        column = np.array([(((near - k) ** 2)[None] + across).argmin(axis=1) for k, near in enumerate(row)])
        return self._low, self._low + CELL * np.stack([row[at, column], column], -1)

    @cached_property
    def _joined(self) -> NDArray[np.bool_]:
        """The cells that are joined to the one that is nearest to the start."""
        seen = np.zeros(self._grid.shape[:2], bool)
        away = np.linalg.norm(self._grid - self.start, axis=2)
        if self._oracle.robot.base.fixed:
            seen[np.unravel_index(away.argmin(), seen.shape)] = True
            return seen
        free, reached = self._free(), -1
        if free.any():
            seen[np.unravel_index(np.where(free, away, np.inf).argmin(), seen.shape)] = True
        while seen.sum() != reached:
            reached = int(seen.sum())
            for _ in range(8):
                seen[1:] |= seen[:-1]
                seen[:-1] |= seen[1:]
                seen[:, 1:] |= seen[:, :-1]
                seen[:, :-1] |= seen[:, 1:]
                seen &= free
        return seen

    def _free(self) -> NDArray[np.bool_]:
        """The cells in which nothing is in the way of the core."""
        radius, low = core(self._oracle)
        keep, points = radius - SLACK, self._grid.reshape(-1, 2)
        rooms = [body for body in self._scene.bodies if body.shape == "room"]
        inside = [area for room in rooms for area in (outline(room), *_openings(room))]
        free = np.any([area.distances(points) == 0 for area in inside], axis=0)
        for kind, at, size in self._solids():
            upright = abs(at.rotation[2, 2]) > 0.999
            if not upright or at.position[2] - size[2] / 2 >= low:
                continue
            if kind == "cylinder":
                free &= np.linalg.norm(points - at.position[:2], axis=1) - max(size[:2]) / 2 > keep
            elif kind == "box":
                free &= Rectangle(*at.position[:2], at.yaw, (size[0] / 2, size[1] / 2)).distances(points) > keep
        return np.asarray(free.reshape(self._grid.shape[:2]))

    def _solids(self) -> Iterator[tuple[str, Pose, tuple[float, ...]]]:
        """Yield kind, pose and size of what stays where it is."""
        for body in self._scene.bodies:
            if body.shape == "room":
                yield from (("box", at, size) for at, size in walls_of(body))
            elif stays(self._scene, body):
                yield from ((str(part.kind), body.pose @ part.offset, tuple(part.size)) for part in plain(body))


def stays(scene: Scene, body: Body) -> bool:
    """Return True for what nobody takes away, opens or asks to go."""
    hung = {name for joint in scene.joints for name in joint.bodies}
    return body.shape not in ("marker", "person") and body.name not in hung and not body.graspable


def core(oracle: Oracle) -> tuple[float, float]:
    """Return the radius of the disc about a base's middle that is in it, and its height or what counts of it [m]."""
    moving, angles = {*oracle.joints.values()}, np.arange(DIRECTIONS) * 2 * math.pi / DIRECTIONS
    oracle.place((0.0, 0.0, 0.0), oracle.posture)
    found = [(0.0, 0.0)]
    with held_against(oracle) as plate:
        for link in oracle.names:
            if not moving.isdisjoint(oracle.upwards(link)):
                continue
            if not pybullet.getCollisionShapeData(oracle.uid, link, physicsClientId=oracle.client):
                continue
            low, high = pybullet.getAABB(oracle.uid, link, physicsClientId=oracle.client)
            ways = ((math.cos(one), math.sin(one), 0.0) for one in angles.tolist())
            if low[2] < LOW:
                found.append((min(plate.extent([link], (0.0, 0.0, 0.0), way) for way in ways), min(high[2], LOW)))
    return max(found)


def _openings(room: Body) -> Iterator[Rectangle]:
    """Yield the floor in the openings of a room's walls."""
    return (outline(room, room.pose @ Pose(cut.centre), cut.size) for cut in room.cavities)


def outline(body: Body, at: Pose | None = None, size: tuple[float, ...] | None = None) -> Rectangle:
    """Return the rectangle over which a body stands, there or at a pose; that of a part with a ``size``."""
    pose, (x, y, *_) = at or body.pose, size or body.size
    return Rectangle(pose.position[0], pose.position[1], pose.yaw, (x / 2, y / 2))
