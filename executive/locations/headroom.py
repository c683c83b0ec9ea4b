"""Room above a thing: by how much it can be raised where it stands, or comes down where it is put."""

from __future__ import annotations

import numpy as np

from executive.belief.believed_bodies import Block
from executive.motion import Boxes, clearance_at
from planlang.geometry import Array

RISES = (0.08, 0.05, 0.03, 0.02, 0.01)
"""Heights by which a thing is raised or comes down, the largest first [m]; the last one even where there is less."""
SPARE = 0.01
"""Room that stays above it [m]."""
RESTING = 0.002
"""Height over its top from which on there is something above it [m]."""
SPACING = 0.02
"""Largest distance of the points of a thing above which it is looked for room [m]."""


def headroom(block: Block, places: Array, boxes: Boxes) -> Array:
    """Return by how much a thing can be raised (n,) [m] at places and yaws (n, 4) of its middle: one of :data:`RISES`.

    ``boxes`` are those of all that may be above it.
    """
    x, y = footprint(block).T
    c, s = np.cos(places[:, 3:]), np.sin(places[:, 3:])
    points = np.stack([c * x - s * y, s * x + c * y], axis=-1) + places[:, None, :2]
    found = np.full(len(places), RISES[-1])
    tops = (places[:, 2] + (block.high - block.low) / 2).round(4)
    for top in np.unique(tops).tolist():
        mine = np.flatnonzero(tops == top)
        around = ((top + RESTING, top + RISES[0] + SPARE, float(np.hypot(block.half_x, block.half_y))),)
        is_open = clearance_at(places[mine, :2], boxes, around) > 0
        found[mine[is_open]], mine = RISES[0], mine[~is_open]
        for rise in RISES[-2::-1]:
            if not len(mine):
                break
            above = ((top + RESTING, top + rise + SPARE, 0.0),)
            free = clearance_at(points[mine].reshape(-1, 2), boxes, above).reshape(len(mine), -1).min(axis=1) > 0
            mine = mine[free]
            found[mine] = rise
    return found


def footprint(block: Block) -> Array:
    """Return points (n, 2) over the rectangle of a prism in its own frame, its corners among them."""
    x, y = (np.linspace(-half, half, 2 + int(2 * half / SPACING)) for half in (block.half_x, block.half_y))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
