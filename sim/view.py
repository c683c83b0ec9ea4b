"""From where to look at a scene so that all of it is in the picture."""

from __future__ import annotations

import math

import numpy as np

from planlang.geometry import Pose
from planlang.geometry.box import corners
from sim.bodies import FLOOR, Bodies

FIELD = math.radians(45)
"""Vertical opening angle of pictures [rad]."""

_FORWARD = np.array([0.62, 0.62, -0.9]) / math.hypot(0.62, 0.62, 0.9)
_HEIGHT = 1.0  # what is higher may be cut off: the tops of walls
_BORDER = 0.96

Point = tuple[float, float, float]


def viewpoint(bodies: Bodies, aspect: float) -> tuple[Point, Point]:
    """Eye and target: above the corner of least x and y, as near as shows everything up to table height."""
    boxes = [bodies.box_of(name) for name in bodies.of if name != FLOOR and name not in bodies.removed]
    boxes = [box for box in boxes if np.isfinite(box[0]).all()] or [(np.full(3, -1.0), np.full(3, 1.0))]
    lower = np.min([box[0] for box in boxes], axis=0)
    upper = np.max([box[1] for box in boxes], axis=0)
    lower[2], upper[2] = max(lower[2], 0.0), min(upper[2], _HEIGHT)
    a, b, c = ((lower + upper) / 2).tolist()
    offsets = corners(Pose((0.0, 0.0, 0.0)), upper - lower)
    right = np.cross(_FORWARD, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    tall = math.tan(FIELD / 2) * _BORDER
    across = np.maximum(np.abs(offsets @ right) / (tall * aspect), np.abs(offsets @ np.cross(right, _FORWARD)) / tall)
    x, y, z = (np.array([a, b, c]) - _FORWARD * float(np.max(across - offsets @ _FORWARD))).tolist()
    return (x, y, z), (a, b, c)
