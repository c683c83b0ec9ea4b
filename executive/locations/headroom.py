"""Headroom: by how much a thing can be raised where it stands, or lowered where it is put, and how it is taken out.

Things are taken out of what is open only at the top, drawers, boxes and vessels, by lifting them over the rim. A thing
at the back of a drawer is still below the furniture when the drawer is open: the hand pulls it forward in the drawer
first.
"""

from __future__ import annotations

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations.grasp_candidates import LIFT
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


ONWARDS: Array = np.zeros((0, 3))
"""Path of a thing that stands in the open: none is needed."""
NO_WAY_OUT = "no room to take it out of what it is in"
RAISED = 0.02
"""Height above the bottom of a drawer at which a thing is pulled [m]."""
STEP, FARTHEST = 0.02, 0.3
"""Distances to try for pulling: step and limit [m]."""
PREFERRED = 0.02
"""Preferred clearance between a pulled thing and the furniture above [m]."""
TOUCHING = 0.003
"""Penetration up to which a thing at a wall counts as beside it [m]."""


def way_out(name: str, scene: PlanningScene) -> Array | None:
    """Find the path of a thing out of what contains it (k, 3): offsets from its present position [m].

    Up over the rim, or forward in an open drawer and then up. No rows if it stands in the open, None if something above
    or in front blocks it.
    """
    below = scene.bodies.below_rim(name)
    if not below:
        return ONWARDS
    block, joint = scene.bodies.block(name), scene.bodies.drawer_of(name)
    boxes, _ = scene.collisions.boxes_but((name,))
    rising = ((block.low + RAISED, block.high + below + LIFT, 0.0),)
    drawn = ((block.low + RAISED, block.high + RAISED, 0.0),)
    points = block.to_map(footprint(block))
    if clearance_at(points, boxes, rising).min() > -TOUCHING:
        return np.array([[0.0, 0.0, below]])
    if joint is None:
        return None
    moves = np.arange(STEP, FARTHEST, STEP)[:, None] * np.array(joint.axis) + [0.0, 0.0, RAISED]
    places = (points[None] + moves[:, None, :2]).reshape(-1, 2)
    passes, rises = (clearance_at(places, boxes, band).reshape(len(moves), -1).min(axis=1) for band in (drawn, rising))
    free = np.logical_and.accumulate(passes > -TOUCHING)
    good = next((where for spare in (PREFERRED, 0.0) if (where := np.flatnonzero(free & (rises >= spare))).size), None)
    return None if good is None else np.array([moves[good[0]], moves[good[0]] + [0.0, 0.0, below]])
