"""Explain why no hand reaches a button, and how its device would have to stand in the map."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations import Rejections
from executive.locations.changes import Changes
from executive.modules.platform import Platform
from executive.modules.tools.motion_failures import too_far
from executive.robots.arms import ArmModel
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from sim.joints import Control

UPRIGHT = 0.7
"""Vertical component of a button's normal above which it is on top of its device, so that turning would not help."""
Reaches = Callable[[PlanningScene], bool]
"""Predicate: can a hand reach the button in a scene that is supposed?"""


def button_failure(
    button: Control, arms: Sequence[ArmModel], platform: Platform, reaches: Reaches
) -> LocationUnresolvable:
    """Build the failure for a button that none of ``arms`` can push, with a change of the map that would help."""
    figures = "; ".join(filter(None, (_too_far(button, arms, platform), _otherwise(button, platform.scene, reaches))))
    return LocationUnresolvable(designator=f"the base with a hand at {button.body}", figures=figures)


def _too_far(button: Control, arms: Sequence[ArmModel], platform: Platform) -> str:
    """Describe how near a shoulder gets to a button, if that is beyond every arm's reach; otherwise ""."""
    pose = platform.scene.bodies.pose(button.body) @ Pose(button.point)
    poses, there = platform.base_poses(), np.array([pose.position[:2]])
    away = {arm.name: poses.distances([there], [arm])[0] for arm in arms}
    arm = min(arms, key=lambda one: away[one.name] - one.reach, default=None)
    return "" if arm is None else too_far(arm, button.body, away[arm.name])


def _otherwise(button: Control, scene: PlanningScene, reaches: Reaches) -> str:
    """Describe a change that would help: the device nearer to the edge that its button faces, or turned; else ""."""
    bodies, device = scene.bodies, button.device
    normal = bodies.pose(button.body).rotation @ np.array(button.normal)
    support = bodies.support(device)
    if abs(float(normal[2])) > UPRIGHT or support is None or bodies.is_room(support):
        return ""

    changes = Changes(device, scene, Rejections(), lambda supposed, _: reaches(supposed), parts=(button.body,))
    return changes.nearer(normal[:2] / np.linalg.norm(normal[:2])) or changes.turned() or changes.in_vain()
