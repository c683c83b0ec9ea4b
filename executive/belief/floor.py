"""Free floor: where the base has room to stand, exactly and on a grid around an object to reach."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from executive.motion import Boxes, clearance_at
from executive.motion.clearance import Band, clearances_at
from executive.motion.outlines import TOUCHING, Outline, cores, stands_in_none
from planlang.geometry import Array
from planlang.records import dataclass

CELL = 0.05
"""Side of a cell of the grid [m]."""
HAIR = 1e-6
"""Share of a cell by which positions on a border are shifted into one cell, above rounding errors."""
SLACK = 0.03
"""Clearance that may be missing in the grid, because cells are 5 cm wide and poses are validated exactly later [m]."""
DOUBTFUL = 0.15
"""Factor of a cell with doubtful room: free only near its border, or with some headings."""
ROOMY = 0.3
"""Clearance above which more is no better [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Factors for free floor on a grid over a square of the map, in a frame fixed to an object."""

    x: float
    y: float
    yaw: float
    half: int
    """Cells from the centre to each side."""
    factors: Array
    """Flat array of the cells' factors, rows along the frame's x, with a border of occupied cells (0)."""

    def looked_up(self, points: Array, headings: Array, v: Array) -> Array:
        """Look up the factors (w, n) at points (w, 2) - Rz(headings (w,)) v (n, 2); 0 is occupied.

        All positions must be within the reach that the field was made for. They are computed directly in cells of the
        field's frame, which saves intermediate arrays in map coordinates.
        """
        c, s = math.cos(self.yaw) / CELL, math.sin(self.yaw) / CELL
        x, y = points[:, 0] - self.x, points[:, 1] - self.y
        turns = headings - self.yaw
        cosine, sine = np.cos(turns) / CELL, np.sin(turns) / CELL
        # Shifted by HAIR, because reachability maps sample on borders of cells, where rounding would decide.
        corner = self.half + 1.5 + HAIR
        along = np.stack([-cosine, sine, c * x + s * y + corner], axis=1)
        across = np.stack([-sine, -cosine, c * y - s * x + corner], axis=1)
        offsets = np.vstack([v.T, np.ones(len(v))])
        cells = (along @ offsets).astype(np.int32)
        cells *= 2 * self.half + 3
        cells += (across @ offsets).astype(np.int32)
        return np.take(self.factors, cells)

    def has_room(self, points: Array, least: float, most: float) -> NDArray[np.bool_]:
        """Mark the points (w, 2) that may have free floor between two distances [m] from them, (w,)."""
        cells = np.stack(np.divmod(np.flatnonzero(self.factors), 2 * self.half + 3), axis=1) - (self.half + 1)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y = points[:, 0] - self.x, points[:, 1] - self.y
        local = np.stack([c * x + s * y, c * y - s * x], axis=1) / CELL
        distinct, which = np.unique(local.round(6), axis=0, return_inverse=True)
        distances = np.linalg.norm(cells[None] - distinct[:, None], axis=2) * CELL
        return np.asarray(((distances > least - CELL) & (distances < most + CELL)).any(axis=1)[which.ravel()])


SURELY = 0.003
"""Distance of the robot's outlines from all boxes at which exact checks find no contact [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """Free floor of a robot: boxes of the world, the robot's silhouette and outlines, bounds of the map."""

    boxes: Boxes
    silhouette: tuple[Band, ...]
    outlines: tuple[Outline, ...]
    bounds: tuple[float, float, float, float]

    def at(self, points: Array) -> Array:
        """Compute the clearance (m,) for turning in place at points (m, 2) [m]; -inf off the map."""
        return np.where(self._on_map(points), clearance_at(points, self.boxes, self.silhouette), -np.inf)

    def nearly(self, points: Array, within: float) -> NDArray[np.bool_]:
        """Mark the points (m, 2) near which, ``within`` [m], the robot may fit in some heading; elsewhere it cannot."""
        least = clearance_at(points, self.boxes, cores(self.outlines))
        return np.asarray(least > -TOUCHING - within)

    def fits(self, points: Array) -> NDArray[np.bool_]:
        """Mark the points (m, 2) of the map at which the robot may fit in some heading (m,)."""
        return np.asarray(self.nearly(points, 0.0) & self._on_map(points))

    def _on_map(self, points: Array) -> NDArray[np.bool_]:
        x_min, y_min, x_max, y_max = self.bounds
        x, y = points[:, 0], points[:, 1]
        return np.asarray((x > x_min) & (x < x_max) & (y > y_min) & (y < y_max))

    def holds(self, bases: Array) -> NDArray[np.bool_]:
        """Mark the base poses (m, 3) at which the robot collides with nothing (m,)."""
        # Exact outlines are checked only between a circle that holds the robot and one that it holds.
        room, least = clearances_at(bases[:, :2], self.boxes, (self.silhouette, cores(self.outlines)), most=0.0)
        free = room > 0.0
        tight = np.flatnonzero(~free & (least > -TOUCHING))
        free[tight] = stands_in_none(bases[tight], self.boxes, self.outlines)
        return np.asarray(free & self._on_map(bases[:, :2]))

    def surely_holds(self, bases: Array) -> NDArray[np.bool_]:
        """Mark the base poses (m, 3) at which no exact check is needed: the robot is :data:`SURELY` off everything."""
        if not len(bases):
            return np.zeros(0, dtype=bool)
        reach, (low, high) = max(r for _, _, r in self.silhouette) + SURELY, (bases[:, :2].min(0), bases[:, :2].max(0))
        near = self.boxes.only(np.flatnonzero(self.boxes.beyond(low, high, np.arange(len(self.boxes))) < reach))
        grown = Boxes(near.centres, near.half_extents + TOUCHING + SURELY, near.yaws)
        return replace(self, boxes=grown).holds(bases)

    def field(self, centre: tuple[float, float], yaw: float, reach: float) -> Field:
        """Build the grid around a map position that covers a circle of radius ``reach`` [m]."""
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
