"""Explain why a motion is out of reach: how near the arm gets to its object, and which change would help."""

from __future__ import annotations

import math
from collections.abc import Callable

from executive.belief.planning_scene import PlanningScene
from executive.locations import Rejections
from executive.locations.changes import Changes
from executive.modules.platform import Platform
from executive.modules.tools.motion_grounding import GroundedMotion
from executive.robots.arms import ArmModel, called


def too_far(arm: ArmModel, name: str, distance: float) -> str:
    """Describe how near the shoulder of an arm gets to a thing, ``distance`` [m]; "" if that is within its reach."""
    if not math.isfinite(distance):
        return f"the base has no room to stand near {name}"
    if distance < arm.reach:
        return ""
    where = f"the robot cannot get the shoulder of {called(arm.name)} closer than {distance:.2f} m to {name}"
    return f"{where}, and the arm reaches {arm.reach:.2f} m"


def out_of_reach(platform: Platform, motion: GroundedMotion, does: Callable[[PlanningScene], bool]) -> str:
    """Describe how near a shoulder gets to the first movable object of a motion, and where that would have to stand.

    ``does``: predicate whether the motion is possible from some base pose in a scene that is supposed. Returns "" for a
    motion without a movable object.
    """
    bodies, arm = platform.scene.bodies, motion.arms[0]
    objects = ((bodies.bind(one), pose[:2, 3]) for one, pose in motion.things.items())
    first = next((one for one in objects if bodies.is_movable(one[0]) and bodies.support(one[0]) is not None), None)
    if first is None:
        return ""
    name, position = first
    distance = platform.standing().distances([position[None]], motion.arms)[0]
    reason = too_far(arm, name, distance)
    nearer = Changes(name, platform.scene, Rejections(), does).nearer()
    return "; ".join(filter(None, (reason, nearer)))
