"""Room for the base around a place: exact at points, and a fine grid that is looked up for thousands of candidates."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from executive.motion import Boxes, clearance_at
from executive.motion.clearance import Band
from planlang.protocols import Array

CELL = 0.05
"""Side of a cell of the grid [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """Room [m] over a square of the map, in a frame of its own, so that it moves with what it is about."""

    x: float
    y: float
    yaw: float
    half: int
    """Cells from the middle to each side."""
    room: Array
    """(2 half + 1, 2 half + 1), rows along the frame's x."""

    def at(self, points: Array) -> Array:
        """Room (...,) at the cells of points (..., 2), -inf outside the square."""
        c, s = math.cos(self.yaw) / CELL, math.sin(self.yaw) / CELL
        dx, dy = points[..., 0] - self.x, points[..., 1] - self.y
        row = np.rint(c * dx + s * dy).astype(np.intp) + self.half
        column = np.rint(c * dy - s * dx).astype(np.intp) + self.half
        most = 2 * self.half
        inside = (row >= 0) & (row <= most) & (column >= 0) & (column <= most)
        found = self.room[np.clip(row, 0, most), np.clip(column, 0, most)]
        return np.asarray(np.where(inside, found, -np.inf))


@dataclass(frozen=True, slots=True, eq=False)
class Floor:
    """What takes room: boxes of the world, the robot's silhouette without its arms, bounds of the map."""

    boxes: Boxes
    silhouette: tuple[Band, ...]
    bounds: tuple[float, float, float, float]

    def at(self, points: Array) -> Array:
        """Room (m,) [m] at points (m, 2): negative where the robot would stand in something, -inf off the map."""
        x_min, y_min, x_max, y_max = self.bounds
        inside = (points[:, 0] > x_min) & (points[:, 0] < x_max) & (points[:, 1] > y_min) & (points[:, 1] < y_max)
        return np.where(inside, clearance_at(points, self.boxes, self.silhouette), -np.inf)

    def field(self, centre: tuple[float, float], yaw: float, reach: float) -> Field:
        """The grid around a place that covers a circle of radius ``reach`` [m]."""
        half = math.ceil(reach / CELL)
        steps = np.arange(-half, half + 1) * CELL
        across, along = np.meshgrid(steps, steps)
        c, s = math.cos(yaw), math.sin(yaw)
        points = np.stack([centre[0] + c * along - s * across, centre[1] + s * along + c * across], axis=-1)
        return Field(centre[0], centre[1], yaw, half, self.at(points.reshape(-1, 2)).reshape(along.shape))
