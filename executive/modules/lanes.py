"""Lanes over a surface: rows of places where a tool lies flat and nothing is in the way of the hand."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from executive.modules.platform import Platform
from executive.motion.clearance import clearance_at
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved
from planlang.geometry.shapes import corners
from planlang.records import dataclass

OVERLAP = 0.8
"""Distance of lanes, as a share of the width of the tool."""
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
"""Distance of places of which it is looked whether there is room beside the surface [m]."""
HAIR = 1e-6
"""What rounding takes from this room [m]."""


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

    def lanes(self, width: float, length: float) -> Iterator[Array]:
        """Yield lanes (n, 4) of free places, with one over each end, in the frame of the thing, back and forth.

        ``width`` and ``length`` are those of the flat side of the tool [m].
        """
        size = np.array(self.platform.scene.world.size(self.name))
        axes = sorted(self.axes, key=lambda axis: float(np.abs(axis) @ size))
        ends = [max(float(np.abs(axis) @ size) - width, 0.0) / 2 for axis in axes]
        across, along = self._spread(axes, ends, width)
        for number, shift in enumerate(across):
            lane = self.middle + shift * axes[0] + along[:, None] * axes[1]
            lane = lane[:: -1 if number % 2 else 1]
            free = self._free(lane, length / 2 + HAND) & self._beside(lane, width / 2 + HAND)
            for run in np.split(lane, np.flatnonzero(np.diff(free.astype(int))) + 1):
                begun = int(np.flatnonzero((lane == run[0]).all(axis=1))[0])
                if free[begun]:
                    yield from (lifted(part) for part in np.array_split(run, -(-len(run) // MOST)))

    def _spread(self, axes: list[Array], ends: list[float], width: float) -> tuple[Array, Array]:
        """Return where lanes are along the first of two axes (n,), and places of a lane along the second (m,).

        They begin where the tool is flush with the edge, or as near as the hand gets to a wall that stands there.
        """
        first, second = (_spread(-end, end, FINE) for end in ends)
        places = self.middle + first[:, None, None] * axes[0] + second[None, :, None] * axes[1]
        free = self._beside(places.reshape(-1, 3), width / 2 + HAND).reshape(len(first), len(second))
        if not free.any():
            return np.zeros(0), np.zeros(0)
        across, along = first[free.any(axis=1)], second[free.any(axis=0)]
        return _spread(across[0], across[-1], OVERLAP * width), _spread(along[0], along[-1], STEP)

    def _beside(self, places: Array, room: float) -> NDArray[np.bool_]:
        """Return at which places (n, 3) walls and furniture are no nearer than so much [m] (n,)."""
        if float((self.pose[:3, :3] @ self.normal)[2]) < LEVEL:
            return np.ones(len(places), bool)
        there = moved(self.pose, places)
        top = float(there[:, 2].max(initial=-math.inf))
        movable = [body.name for body in self.platform.scene.world.scene.bodies if body.movable]
        fixed, _ = self.platform.scene.collisions.boxes_but(movable)
        clearance = clearance_at(there[:, :2], fixed, [(top + BESIDE, top + ABOVE, room)])
        return np.asarray(clearance >= -HAIR)

    def _free(self, places: Array, room: float) -> NDArray[np.bool_]:
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


def lifted(places: Array) -> Array:
    """Return places (n + 2, 4) with one over the first and one over the last of places (n, 3)."""
    over = np.zeros(len(places) + 2)
    over[[0, -1]] = LIFTED
    return np.column_stack([np.vstack([places[:1], places, places[-1:]]), over])


def _spread(low: float, high: float, step: float) -> Array:
    """Return places (n,) from one end to the other, at most a step from each other."""
    count = max(1, int(np.ceil((high - low) / step)))
    return np.linspace(low, high, count + 1) if high > low else np.array([low])
