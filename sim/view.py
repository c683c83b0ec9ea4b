"""From where to look at a scene so that all of it is in the picture."""

from __future__ import annotations

import math

import numpy as np

from sim.bodies import FLOOR, Bodies

_FIELD = math.radians(45)
_DIRECTION = np.array([-0.62, -0.62, 0.9])
_CLOSER = 0.62

Point = tuple[float, float, float]


def viewpoint(bodies: Bodies, aspect: float) -> tuple[Point, Point]:
    """Eye and target: above the corner of least x and y, at a distance that fits the scene into 45 degrees."""
    boxes = [bodies.box_of(name) for name in bodies.of if name != FLOOR and name not in bodies.removed]
    boxes = [box for box in boxes if np.isfinite(box[0]).all()] or [(np.full(3, -1.5), np.full(3, 1.5))]
    lower = np.min([box[0] for box in boxes], axis=0)
    upper = np.max([box[1] for box in boxes], axis=0)
    lower[2], upper[2] = max(lower[2], 0.0), min(upper[2], 1.6)
    target = (lower + upper) / 2
    radius = float(np.linalg.norm(upper - lower)) / 2
    field = min(_FIELD, 2 * math.atan(math.tan(_FIELD / 2) * aspect))
    distance = _CLOSER * radius / math.sin(field / 2)
    eye = target + _DIRECTION / np.linalg.norm(_DIRECTION) * distance
    x, y, z = eye.tolist()
    a, b, c = target.tolist()
    return (x, y, z), (a, b, c)
