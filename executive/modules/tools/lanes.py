"""Lanes over a surface: rows of positions at which a tool lies flat and the hand has room."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from executive.modules.platform import Platform
from executive.motion.clearance import clearance_at
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved
from planlang.geometry.shapes import corners
from planlang.records import dataclass

Mask = NDArray[np.bool_]

OVERLAP = 0.8
"""Spacing of lanes, as a share of the tool's width."""
LEAST = 0.5
"""Least area that a lane adds to those before it, as a share of the tool's own square."""
STEP = 0.06
"""Spacing of waypoints along a lane [m]."""
MOST = 9
"""Most waypoints of a lane; longer ones are divided."""
LIFTED = 0.04
"""Height of the tool above the surface before and after a lane [m]."""
HAND = 0.05
"""Clearance that the hand needs beside the tool [m]."""
ABOVE = 0.3
"""Height above the surface up to which objects obstruct the hand [m]."""
BESIDE = 0.02
"""Height above the surface from which walls and furniture beside it obstruct the tool [m]."""
LEVEL = 0.99
"""Least cosine between a surface's normal and the vertical for checking walls and furniture beside it."""
FINE = 0.01
"""Cell size of the grid of tool positions [m]."""
HAIR = 1e-6
"""Tolerance of clearances for rounding [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Free positions of a tool's centre over a side of an object, on a fine grid, and the area wiped from them.

    The wiped area is a mask of the grid, padded by ``half`` cells on each side. From each position the tool wipes a
    square of its own width, reduced by the overlap of lanes.
    """

    places: Array
    """Positions (n, m, 3) in the object's frame, the shorter side first."""
    free: Mask
    """Mask of the free positions (n, m)."""
    half: int
    """Cells that the tool wipes on each side of its centre."""

    def lanes(self) -> Iterator[Array]:
        """Yield lanes (k, 4) of free positions with heights, lifted at both ends, in alternating directions.

        Greedy set cover: the next lane is the one that wipes most of the remaining area, which keeps their number
        small. Areas where the best lane would add less than LEAST of the tool's square are left out.
        """
        rows, begins, ends = _runs(self.free)
        rest, wide, direction = self._around(self.free), 2 * self.half + 1, 1
        while len(rows):
            of_rows = sliding_window_view(rest, wide, axis=0).sum(axis=2)
            sums = np.pad(np.cumsum(of_rows, axis=1), ((0, 0), (1, 0)))
            gains = sums[rows, ends + wide] - sums[rows, begins]
            best = int(np.argmax(gains))
            if gains[best] < LEAST * wide * wide:
                return
            row, begin, end = rows[best], begins[best], ends[best]
            new = begin + np.flatnonzero(of_rows[row, begin : end + wide])
            begin, end = min(new[0], end), max(new[-1] - 2 * self.half, min(new[0], end))
            rest[row : row + wide, begin : end + wide] = False
            low, high = self.places[row, [begin, end]]
            count = 1 + math.ceil(float(np.linalg.norm(high - low)) / STEP)
            lane = np.linspace(low, high, count)[::direction]
            yield from map(lifted, np.array_split(lane, -(-len(lane) // MOST)))
            direction = -direction

    def share(self, lanes: Sequence[Array], later: Room) -> float:
        """Compute the share of the wipeable area that lanes (k, 4) cover, ignoring area that is not free ``later``."""
        due = self._around(self.free) & self._around(later.free)
        return float(self._wiped(lanes)[due].mean()) if due.any() else 1.0

    def _wiped(self, lanes: Sequence[Array]) -> Mask:
        at = np.zeros_like(self.free)
        axes = self.places.reshape(-1, 3)
        for lane in lanes:
            low, high = (int(np.argmin(np.linalg.norm(axes - end, axis=1))) for end in lane[[1, -2], :3])
            (row, begin), (_, end) = (divmod(one, at.shape[1]) for one in sorted((low, high)))
            at[row, begin : end + 1] = True
        return self._around(at)

    def _around(self, places: Mask) -> Mask:
        """Compute the mask that the tool wipes from the positions of a mask (n, m)."""
        wide = 2 * self.half + 1
        return np.asarray(sliding_window_view(np.pad(places, 2 * self.half), (wide, wide)).any(axis=(2, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Side of an object over which a tool is moved; vectors are in the object's frame."""

    platform: Platform
    name: str
    """Object."""
    pose: Array
    """Pose (4, 4) of the object in the map."""
    middle: Array
    """Centre of the side (3,)."""
    normal: Array
    """Outward normal of the side (3,)."""
    axes: tuple[Array, Array]
    """Two orthogonal unit vectors (3,) in the side."""

    def room(self, width: float, length: float) -> Room:
        """Find the free positions of a tool whose flat side has this width and length [m]."""
        size = np.array(self.platform.scene.world.size(self.name))
        axes = sorted(self.axes, key=lambda axis: float(np.abs(axis) @ size))
        ends = [max(float(np.abs(axis) @ size) - width, 0.0) / 2 for axis in axes]
        first, second = (np.linspace(-end, end, math.ceil(2 * end / FINE) + 1) for end in ends)
        places = self.middle + first[:, None, None] * axes[0] + second[None, :, None] * axes[1]
        flat = places.reshape(-1, 3)
        free = self._free_of_objects(flat, length / 2 + HAND) & self._free_of_walls(flat, width / 2 + HAND)
        return Room(places, free.reshape(places.shape[:2]), int(OVERLAP * width / 2 / FINE))

    def _free_of_walls(self, places: Array, room: float) -> Mask:
        """Mark the positions (n, 3) at which walls and furniture are at least ``room`` [m] away (n,)."""
        if float((self.pose[:3, :3] @ self.normal)[2]) < LEVEL:
            return np.ones(len(places), bool)
        in_map = moved(self.pose, places)
        top = float(in_map[:, 2].max(initial=-math.inf))
        movable = [body.name for body in self.platform.scene.world.scene.bodies if body.movable]
        fixed, _ = self.platform.scene.collisions.boxes_but(movable)
        clearance = clearance_at(in_map[:, :2], fixed, [(top + BESIDE, top + ABOVE, room)])
        return np.asarray(clearance >= -HAIR)

    def _free_of_objects(self, places: Array, room: float) -> Mask:
        """Mark the positions (n, 3) at which objects on the surface are more than ``room`` [m] away (n,)."""
        world = self.platform.scene.world
        axes = np.stack(self.axes)
        free = np.ones(len(places), bool)
        for name in world.names():
            body = world.scene.body(name)
            if not body.movable and world.support(name) != self.name:
                continue
            if name in self.platform.belief.held:
                continue
            box = moved(inverse(self.pose), corners(world.pose(name), body.size)) - self.middle
            heights = box @ self.normal
            if heights.max() <= 0.0 or heights.min() >= ABOVE:
                continue
            low, high = (box @ axes.T).min(axis=0), (box @ axes.T).max(axis=0)
            local = (places - self.middle) @ axes.T
            free &= np.linalg.norm(np.maximum(np.maximum(low - local, local - high), 0.0), axis=1) > room
        return free


def _runs(free: Mask) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Find the runs of free positions in the rows of a mask (n, m): row, first and last column, (k,) each."""
    edges = np.diff(np.pad(free, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, begins = np.nonzero(edges == 1)
    return rows, begins, np.nonzero(edges == -1)[1] - 1


def lifted(places: Array) -> Array:
    """Extend positions (n, 3) to waypoints (n + 2, 4) with heights, adding one above the first and the last."""
    heights = np.zeros(len(places) + 2)
    heights[[0, -1]] = LIFTED
    return np.column_stack([np.vstack([places[:1], places, places[-1:]]), heights])
