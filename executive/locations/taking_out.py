"""Paths on which things are taken out of what is open only at the top: drawers, boxes and vessels.

A hand lifts them over the rim. A thing at the back of a drawer is still below the furniture when the drawer is open:
the hand pulls it forward in the drawer first.
"""

from __future__ import annotations

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations.grasp_candidates import LIFT
from executive.locations.headroom import footprint
from executive.motion import clearance_at
from planlang.geometry import Array

ONWARDS: Array = np.zeros((0, 3))
"""Path of a thing that stands in the open: none is needed."""
NO_WAY_OUT = "no room to take it out of what it is in"
RAISED = 0.02
"""Height above the bottom of a drawer at which a thing is pulled [m]."""
STEP, FARTHEST = 0.02, 0.3
"""Distances to try for pulling: step and limit [m]."""
SPARE = 0.02
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
    good = next((where for spare in (SPARE, 0.0) if (where := np.flatnonzero(free & (rises >= spare))).size), None)
    return None if good is None else np.array([moves[good[0]], moves[good[0]] + [0.0, 0.0, below]])
