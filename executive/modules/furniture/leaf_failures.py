"""Explain why no path was found that moves a leaf by its handle, and which change of the map would allow one."""

from __future__ import annotations

from itertools import islice

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations.rejections import COLLISION, NO_ROOM, NO_WAY, OUT_OF_REACH
from executive.modules.furniture.leaf_paths import NO_GRIP, SWEPT, LeafPaths
from planlang.failures import LocationUnresolvable
from sim.joints import Articulation

MOST_NAMED = 3
"""Most obstacles to name in a failure."""
MOST_TRIED = 4
"""Most obstacles to remove hypothetically."""
RISES = np.arange(0.05, 1.0, 0.05)
"""Heights by which to raise or lower a handle hypothetically [m]."""


def leaf_failure(paths: LeafPaths, joint: Articulation, scene: PlanningScene) -> LocationUnresolvable:
    """Build the failure for a search ``paths`` that found nothing, with the likeliest reason and its figures."""
    rejected = paths.rejected
    paths.poses.name_crowding()
    counts, handle = rejected.ordered(), str(joint.handle)
    figures = ""
    if set(counts) == {NO_GRIP}:
        body = next(iter(rejected.ordered_blocking()))
        figures = f"in each of the {counts[NO_GRIP]} grips checked, the hand is in collision, mostly with {body}"
    elif counts.get(COLLISION):
        bodies = ", ".join(islice(rejected.ordered_blocking(), MOST_NAMED))
        figures = f"{counts[COLLISION]} postures with a hand at it are in collision, mostly with {bodies}"
    elif counts and set(counts) <= {OUT_OF_REACH.text, NO_ROOM, NO_WAY, SWEPT.text, NO_GRIP}:
        figures = _without(paths, joint, scene) or _higher(paths, handle, scene)
    reason = next(iter(counts), "")
    rejected.figures = {reason: figures} if figures else {}
    return rejected.failure(f"the base with a hand at {handle} as {joint.leaf} moves")


def _higher(paths: LeafPaths, handle: str, scene: PlanningScene) -> str:
    """Describe the height at which an arm would reach the handle from free base poses; "" if there is none."""
    height = scene.bodies.pose(handle).position[2]
    for rise in RISES.tolist():
        for word, shift in (("low", rise), ("high", -rise)):
            if paths.reach(shift):
                return (
                    f"{handle} is at {height:.2f} m, too {word} for a hand from where the base can be; "
                    f"at {height + shift:.2f} m the arm would reach it"
                )
    return ""


def _without(paths: LeafPaths, joint: Articulation, scene: PlanningScene) -> str:
    """Describe the obstacle without which the base would have room to reach the handle; "" if there is none."""
    bodies = scene.bodies
    fixed = {name for one in scene.belief.joints.values() for name in (*one.bodies, one.holder)}
    fixed.update(name for name in bodies.names() if bodies.is_room(name))
    fixed.update(scene.belief.carried())
    blocking = (name for name in paths.rejected.ordered_blocking() if name not in fixed and name in bodies.names())
    for name in islice(blocking, MOST_TRIED):
        if paths.reach(scene=scene.supposing(scene.belief.state.placed({name: None}))):
            return f"{name} leaves the base no room where a hand would reach {joint.handle}; without it one would"
    return ""
