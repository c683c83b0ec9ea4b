"""Lanes over a surface: rows of places where a tool lies flat and nothing is in the way of the hand."""

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
"""Distance of lanes, as a share of the width of the tool."""
LEAST = 0.5
"""What a lane wipes that no other wipes, as a share of the square that the tool wipes without being moved."""
STEP = 0.06
"""Distance of places along a lane [m]."""
MOST = 9
"""Places of a lane that are wiped without a stop."""
LIFTED = 0.04
"""Height from which the tool is lowered to a lane, and to which it is lifted behind it [m]."""
HAND = 0.05
"""Room beside the tool that the hand needs [m]."""
ABOVE = 0.3
"""Height over the surface up to which things are in the way of the hand [m]."""
BESIDE = 0.02
"""Height over the surface from which what stands beside it is in the way of the tool [m]."""
LEVEL = 0.99
"""Least cosine between the vertical and the normal of a surface of which it is known what stands beside it."""
FINE = 0.01
"""Distance of places of which it is looked whether the tool has room there [m]."""
HAIR = 1e-6
"""What rounding takes from this room [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Room:
    """Where the middle of a tool has room over a side of a thing, on a fine grid, and what the tool wipes from there.

    What is wiped is a mask of the grid with ``half`` more cells on each side: around each place a square as wide as the
    tool, less what lanes overlap.
    """

    places: Array
    """(n, m, 3), in the frame of the thing, with the shorter side first."""
    free: Mask
    """(n, m)."""
    half: int
    """Cells that the tool wipes on each side of a place."""

    def lanes(self) -> Iterator[Array]:
        """Yield lanes (k, 4) of free places, with one over each end, back and forth.

        The next lane is the one that wipes most of what the lanes before it leave, so that there are no more of them
        than what stands on the side makes necessary. Corners into which less than half the tool goes are left.
        """
        rows, begins, ends = _runs(self.free)
        rest, wide, forth = self._around(self.free), 2 * self.half + 1, 1
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
            lane = np.linspace(low, high, count)[::forth]
            yield from map(lifted, np.array_split(lane, -(-len(lane) // MOST)))
            forth = -forth

    def share(self, lanes: Sequence[Array], later: Room) -> float:
        """Return how much of what can be wiped lanes (k, 4) wipe, of a side on which there is less room later."""
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
        """Return what the tool wipes from places (n, m)."""
        wide = 2 * self.half + 1
        return np.asarray(sliding_window_view(np.pad(places, 2 * self.half), (wide, wide)).any(axis=(2, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """A side of a thing over which a tool is moved."""

    platform: Platform
    name: str
    """The thing."""
    pose: Array
    """Its pose (4, 4) in the map."""
    middle: Array
    """The middle of the side (3,), in the frame of the thing."""
    normal: Array
    """(3,)."""
    axes: tuple[Array, Array]
    """Two unit vectors (3,) in the side."""

    def room(self, width: float, length: float) -> Room:
        """Return where a tool has room whose flat side has this width and length [m]."""
        size = np.array(self.platform.scene.world.size(self.name))
        axes = sorted(self.axes, key=lambda axis: float(np.abs(axis) @ size))
        ends = [max(float(np.abs(axis) @ size) - width, 0.0) / 2 for axis in axes]
        first, second = (_spread(-end, end, FINE) for end in ends)
        places = self.middle + first[:, None, None] * axes[0] + second[None, :, None] * axes[1]
        flat = places.reshape(-1, 3)
        free = self._free(flat, length / 2 + HAND) & self._beside(flat, width / 2 + HAND)
        return Room(places, free.reshape(places.shape[:2]), int(OVERLAP * width / 2 / FINE))

    def _beside(self, places: Array, room: float) -> Mask:
        """Return at which places (n, 3) walls and furniture are no nearer than so much [m] (n,)."""
        if float((self.pose[:3, :3] @ self.normal)[2]) < LEVEL:
            return np.ones(len(places), bool)
        there = moved(self.pose, places)
        top = float(there[:, 2].max(initial=-math.inf))
        movable = [body.name for body in self.platform.scene.world.scene.bodies if body.movable]
        fixed, _ = self.platform.scene.collisions.boxes_but(movable)
        clearance = clearance_at(there[:, :2], fixed, [(top + BESIDE, top + ABOVE, room)])
        return np.asarray(clearance >= -HAIR)

    def _free(self, places: Array, room: float) -> Mask:
        """Return at which places (n, 3) nothing stands on the surface within so much room [m] (n,)."""
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
            over = box @ self.normal
            if over.max() <= 0.0 or over.min() >= ABOVE:
                continue
            low, high = (box @ axes.T).min(axis=0), (box @ axes.T).max(axis=0)
            at = (places - self.middle) @ axes.T
            free &= np.linalg.norm(np.maximum(np.maximum(low - at, at - high), 0.0), axis=1) > room
        return free


def _runs(free: Mask) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return row, first and last column (k,) of each run of free places (n, m)."""
    turns = np.diff(np.pad(free, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, begins = np.nonzero(turns == 1)
    return rows, begins, np.nonzero(turns == -1)[1] - 1


def lifted(places: Array) -> Array:
    """Return places (n + 2, 4) with one over the first and one over the last of places (n, 3)."""
    over = np.zeros(len(places) + 2)
    over[[0, -1]] = LIFTED
    return np.column_stack([np.vstack([places[:1], places, places[-1:]]), over])


def _spread(low: float, high: float, step: float) -> Array:
    """Return places (n,) from one end to the other, at most a step from each other."""
    count = max(1, int(np.ceil((high - low) / step)))
    return np.linspace(low, high, count + 1) if high > low else np.array([low])
