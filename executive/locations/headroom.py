"""Headroom: by how much a thing can be raised where it stands, or lowered where it is put."""

from __future__ import annotations

import numpy as np

from executive.motion import Boxes, clearance_at
from planlang.geometry import Array
from planlang.geometry.areas import Block

RISES = (0.08, 0.05, 0.03, 0.02, 0.01)
"""Heights by which a thing is raised or lowered, largest first [m]; the last one even if there is less room."""
SPARE = 0.01
"""Clearance that remains above it [m]."""
RESTING = 0.002
"""Height above its top from which on a body counts as above it [m]."""
SPACING = 0.02
"""Largest distance between the points of a thing whose headroom is tested [m]."""


def headroom(block: Block, places: Array, boxes: Boxes) -> Array:
    """Compute the headroom (n,) [m] of a thing at places and yaws (n, 4) of its centre: one of :data:`RISES`.

    ``boxes`` are those of all bodies that may be above it.
    """
    x, y = footprint(block).T
    c, s = np.cos(places[:, 3:]), np.sin(places[:, 3:])
    points = np.stack([c * x - s * y, s * x + c * y], axis=-1) + places[:, None, :2]
    rises = np.full(len(places), RISES[-1])
    tops = (places[:, 2] + (block.high - block.low) / 2).round(4)
    for top in np.unique(tops).tolist():
        left = np.flatnonzero(tops == top)
        around = ((top + RESTING, top + RISES[0] + SPARE, float(np.hypot(block.half_x, block.half_y))),)
        is_open = clearance_at(places[left, :2], boxes, around) > 0
        rises[left[is_open]], left = RISES[0], left[~is_open]
        for rise in RISES[-2::-1]:
            if not len(left):
                break
            above = ((top + RESTING, top + rise + SPARE, 0.0),)
            free = clearance_at(points[left].reshape(-1, 2), boxes, above).reshape(len(left), -1).min(axis=1) > 0
            left = left[free]
            rises[left] = rise
    return rises


def footprint(block: Block) -> Array:
    """Sample points (n, 2) of a prism's rectangle in its own frame, corners included."""
    x, y = (np.linspace(-half, half, 2 + int(2 * half / SPACING)) for half in (block.half_x, block.half_y))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
