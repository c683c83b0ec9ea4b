"""The free floor: where the base has room to stand, exactly and on a grid around what is reached for."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from executive.motion import Boxes, clearance_at
from executive.motion.clearance import TOUCHING, Band, Outline, clearances_at, cores, stands_in_none
from planlang.geometry import Array
from planlang.records import dataclass

CELL = 0.05
"""Side of a cell of the grid [m]."""
HAIR = 1e-6
"""Share of a cell by which places on the border of two count as in one: more than rounding, less than matters."""
SLACK = 0.03
"""Room that may be missing in the grid, whose cells are 5 cm wide: places are validated exactly later [m]."""
DOUBTFUL = 0.15
"""Factor of a place with doubtful room: only at the border of its cell, or with some headings."""
ROOMY = 0.3
"""More room than this is not better [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Factors for free room on a grid over a square of the map, in a frame that moves with its subject."""

    x: float
    y: float
    yaw: float
    half: int
    """Cells from the middle to each side."""
    factors: Array
    """Factor of each cell, rows along the frame's x, flat; with a border of cells without room (0)."""

    def looked_up(self, points: Array, headings: Array, v: Array) -> Array:
        """Return how good the room is at points (w, 2) - Rz(headings (w,)) v (n, 2), (w, n): 0 where there is none.

        All have to be within the reach that the field was made for. It is done in the field's own frame and cells, as
        what is only looked at needs neither places nor distances.
        """
        c, s = math.cos(self.yaw) / CELL, math.sin(self.yaw) / CELL
        x, y = points[:, 0] - self.x, points[:, 1] - self.y
        turns = headings - self.yaw
        cosine, sine = np.cos(turns) / CELL, np.sin(turns) / CELL
        # a hair towards the larger cell: places of the maps are on borders of cells, wherever the map has its origin
        corner = self.half + 1.5 + HAIR
        along = np.stack([-cosine, sine, c * x + s * y + corner], axis=1)
        across = np.stack([-sine, -cosine, c * y - s * x + corner], axis=1)
        places = np.vstack([v.T, np.ones(len(v))])
        cells = (along @ places).astype(np.int32)
        cells *= 2 * self.half + 3
        cells += (across @ places).astype(np.int32)
        return np.take(self.factors, cells)

    def has_room(self, points: Array, least: float, most: float) -> NDArray[np.bool_]:
        """Return whether there may be room between two distances [m] from points (w, 2), (w,)."""
        cells = np.stack(np.divmod(np.flatnonzero(self.factors), 2 * self.half + 3), axis=1) - (self.half + 1)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y = points[:, 0] - self.x, points[:, 1] - self.y
        local = np.stack([c * x + s * y, c * y - s * x], axis=1) / CELL
        each, which = np.unique(local.round(6), axis=0, return_inverse=True)
        away = np.linalg.norm(cells[None] - each[:, None], axis=2) * CELL
        return np.asarray(((away > least - CELL) & (away < most + CELL)).any(axis=1)[which.ravel()])


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """Occupied floor: boxes of the world, the robot's silhouette and outlines without its arms, bounds of the map."""

    boxes: Boxes
    silhouette: tuple[Band, ...]
    outlines: tuple[Outline, ...]
    bounds: tuple[float, float, float, float]

    def at(self, points: Array) -> Array:
        """Return room (m,) [m] to turn at points (m, 2): negative where there is too little, -inf off the map."""
        return np.where(self._on_map(points), clearance_at(points, self.boxes, self.silhouette), -np.inf)

    def nearly(self, points: Array, within: float) -> NDArray[np.bool_]:
        """Return whether the robot may fit, somehow turned, ``within`` [m] of points (m, 2); if not, it cannot (m,)."""
        least = clearance_at(points, self.boxes, cores(self.outlines))
        return np.asarray(least > -TOUCHING - within)

    def fits(self, points: Array) -> NDArray[np.bool_]:
        """Return whether the robot may fit, somehow turned, at points (m, 2) of the map (m,)."""
        return np.asarray(self.nearly(points, 0.0) & self._on_map(points))

    def _on_map(self, points: Array) -> NDArray[np.bool_]:
        x_min, y_min, x_max, y_max = self.bounds
        x, y = points[:, 0], points[:, 1]
        return np.asarray((x > x_min) & (x < x_max) & (y > y_min) & (y < y_max))

    def holds(self, bases: Array) -> NDArray[np.bool_]:
        """Return at which bases (m, 3) the robot, as it is turned there, stands in nothing (m,)."""
        room, least = clearances_at(bases[:, :2], self.boxes, (self.silhouette, cores(self.outlines)), most=0.0)
        free = room > 0.0
        tight = np.flatnonzero(~free & (least > -TOUCHING))
        free[tight] = stands_in_none(bases[tight], self.boxes, self.outlines)
        return np.asarray(free & self._on_map(bases[:, :2]))

    def field(self, centre: tuple[float, float], yaw: float, reach: float) -> Field:
        """Return the grid around a place that covers a circle of radius ``reach`` [m]."""
        half = math.ceil(reach / CELL)
        steps = np.arange(-half, half + 1) * CELL
        across, along = np.meshgrid(steps, steps)
        c, s = math.cos(yaw), math.sin(yaw)
        points = np.stack([centre[0] + c * along - s * across, centre[1] + s * along + c * across], axis=-1)
        flat = points.reshape(-1, 2)
        silhouettes = self.silhouette, cores(self.outlines)
        room, least = clearances_at(flat, self.boxes, silhouettes, most=ROOMY).round(9)
        factors = np.where(room > 0.0, 0.3 + np.clip(room, 0.0, ROOMY), np.where(least > -SLACK, DOUBTFUL, 0.0))
        factors = np.where(self._on_map(flat), factors, 0.0).reshape(along.shape)
        return Field(centre[0], centre[1], yaw, half, np.pad(factors, 1).ravel())
