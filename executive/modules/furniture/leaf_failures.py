"""Says why no way was found to move a leaf by its handle, and what in the map would have to be otherwise."""

from __future__ import annotations

from itertools import islice

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations.rejections import COLLISION, NO_ROOM, NO_WAY, OUT_OF_REACH
from executive.modules.furniture.leaf_paths import NO_GRIP, SWEPT, LeafPaths
from planlang.failures import LocationUnresolvable
from sim.joints import Articulation

MOST_NAMED = 3
"""Bodies in the way that a failure names."""
MOST_TRIED = 4
"""Bodies of which is worked out what would be without them."""
RISES = np.arange(0.05, 1.0, 0.05)
"""By how much a handle is supposed to be higher, or lower [m]."""


def leaf_failure(paths: LeafPaths, joint: Articulation, scene: PlanningScene) -> LocationUnresolvable:
    """Return why no way was found among ``paths``, with figures; for when none was."""
    rejected = paths.rejected
    paths.poses.name_crowding()
    counts, handle = rejected.ordered(), str(joint.handle)
    figures = ""
    if set(counts) == {NO_GRIP}:
        body = next(iter(rejected.ordered_blocking()))
        figures = f"in each of the {counts[NO_GRIP]} grips that were looked at the hand is in something, mostly {body}"
    elif counts.get(COLLISION):
        bodies = ", ".join(islice(rejected.ordered_blocking(), MOST_NAMED))
        figures = f"{counts[COLLISION]} postures with a hand at it are in collision, mostly with {bodies}"
    elif counts and set(counts) <= {OUT_OF_REACH.text, NO_ROOM, NO_WAY, SWEPT.text, NO_GRIP}:
        figures = _without(paths, joint, scene) or _higher(paths, handle, scene)
    reason = next(iter(counts), "")
    rejected.figures = {reason: figures} if figures else {}
    return rejected.failure(f"the base with a hand at {handle} as {joint.leaf} moves")


def _higher(paths: LeafPaths, handle: str, scene: PlanningScene) -> str:
    """Return at which height an arm would reach the handle from where the base can be; "" if at none."""
    height = scene.bodies.pose(handle).position[2]
    for rise in RISES.tolist():
        for word, there in (("low", rise), ("high", -rise)):
            if paths.reach(there):
                return (
                    f"{handle} is at {height:.2f} m, too {word} for a hand from where the base can be; "
                    f"at {height + there:.2f} m the arm would reach it"
                )
    return ""


def _without(paths: LeafPaths, joint: Articulation, scene: PlanningScene) -> str:
    """Return without which body an arm would reach the handle, as the base would have more room; "" if none."""
    bodies = scene.bodies
    fixed = {name for one in scene.belief.joints.values() for name in (*one.bodies, one.holder)}
    fixed.update(name for name in bodies.names() if bodies.is_room(name))
    fixed.update(scene.belief.carried())
    blocking = (name for name in paths.rejected.ordered_blocking() if name not in fixed and name in bodies.names())
    for name in islice(blocking, MOST_TRIED):
        with scene.supposing({name: None}):
            if paths.reach():
                return f"{name} leaves the base no room where a hand would reach {joint.handle}; without it one would"
    return ""
