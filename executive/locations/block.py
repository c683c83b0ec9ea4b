"""A body as an upright prism: what relations need to know of its shape."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from planlang.geometry import Array, Pose


@dataclass(frozen=True, slots=True)
class Block:
    """Vertical prism over an oriented rectangle; lengths in metres, ``yaw`` of its local x in the map."""

    x: float
    y: float
    yaw: float
    half_x: float
    half_y: float
    low: float
    high: float
    round: bool = False
    """Whether it is a cylinder about the vertical, as wide from everywhere."""

    @staticmethod
    def of(pose: Pose, size: tuple[float, float, float], *, cylinder: bool = False) -> Block:
        """The smallest prism around a box, turned with the most horizontal of the box's axes."""
        rotation = pose.matrix()[:3, :3]
        half = np.asarray(size) / 2
        vertical = int(np.argmax(np.abs(rotation[2])))
        first = (vertical + 1) % 3 if vertical else 1
        if vertical == 2:
            first = 0
        yaw = math.atan2(rotation[1, first], rotation[0, first])
        along = np.array([math.cos(yaw), math.sin(yaw), 0.0])
        across = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
        half_x, half_y = (float(np.abs(axis @ rotation) @ half) for axis in (along, across))
        half_z = float(np.abs(rotation[2]) @ half)
        x, y, z = pose.position
        return Block(x, y, yaw, half_x, half_y, z - half_z, z + half_z, cylinder and vertical == 2)

    @property
    def centre(self) -> Array:
        """Centre of the prism, (3,)."""
        return np.array([self.x, self.y, (self.low + self.high) / 2])

    def to_map(self, local: Array) -> Array:
        """Points of the rectangle's own frame (n, 2) in the map (n, 2)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.asarray(local @ np.array([[c, s], [-s, c]]) + np.array([self.x, self.y]))

    def to_local(self, points: Array) -> Array:
        """Points of the map (n, 2) in the rectangle's own frame (n, 2)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return np.asarray((points - np.array([self.x, self.y])) @ np.array([[c, -s], [s, c]]))

    def distance(self, points: Array) -> Array:
        """Horizontal distance of map points (n, 2) to the outline, 0 inside, (n,)."""
        if self.round:
            away = np.hypot(points[:, 0] - self.x, points[:, 1] - self.y) - max(self.half_x, self.half_y)
            return np.asarray(np.maximum(away, 0.0))
        outside = np.maximum(np.abs(self.to_local(points)) - np.array([self.half_x, self.half_y]), 0.0)
        return np.asarray(np.hypot(outside[:, 0], outside[:, 1]))

    def support(self, direction: float) -> float:
        """How far the prism extends from its middle towards a heading of the map [m]."""
        if self.round:
            return max(self.half_x, self.half_y)
        turn = direction - self.yaw
        return abs(math.cos(turn)) * self.half_x + abs(math.sin(turn)) * self.half_y

    def grid(self, spacing: float, inset: float) -> Array:
        """Points over the rectangle shrunk by ``inset``, about ``spacing`` apart, (n, 2); at least its centre."""
        axes = []
        for half in (self.half_x, self.half_y):
            reach = max(half - inset, 0.0)
            axes.append(np.linspace(-reach, reach, 2 * round(reach / spacing) + 1))
        mesh = np.stack(np.meshgrid(axes[0], axes[1], indexing="ij"), -1).reshape(-1, 2)
        return self.to_map(mesh)
