"""Strokes of a closed hand that push a device's button along its normal, and why none of them reaches it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations import Rejections
from executive.locations.changes import Changes
from executive.modules.platform import Platform
from executive.modules.tools.motion_failures import too_far
from executive.modules.tools.motion_grounding import Grounding
from executive.modules.tools.strokes import Plane, StrokeWork
from executive.robots.arms import ArmModel
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array, Pose
from planlang.motion_constraints import MotionConstraint, a_constraint, a_feature
from planlang.protocols import Motion
from sim.joints import Control

BEFORE, BEYOND = 0.1, -0.02
"""Heights of the tip over a button at the start and end of a push [m]; the button stops it before the end."""
STEP = 0.025
"""Spacing of waypoints [m]."""
EXACT = 0.003
"""Tolerance of heights [m]."""
LEANS = -0.7
"""Cosine between the hand's approach and the button's normal at the largest lean, 45 degrees."""

UPRIGHT = 0.7
"""Vertical component of a button's normal above which it is on top of its device, so that turning would not help."""
Reaches = Callable[[PlanningScene], bool]
"""Predicate: can a hand reach the button in a scene that is supposed?"""


class ButtonStrokes(StrokeWork):
    """Pushes one button with one hand; the tip stays on the line through the button along its normal."""

    def __init__(self, platform: Platform, arm: ArmModel, button: Control) -> None:
        super().__init__(platform)
        self._arm, self._button = arm, button

    async def pushed(self) -> Motion:
        """Push, retreat, and return how the push ended. Raises a ManipulationFailure or NavigationFailure."""
        grounding = self._grounding()
        await self._look(grounding)
        plane = Plane(grounding.grounded().constraints[0])
        lap = await self.stroke(grounding, plane, self._points(), closed=False)
        motion = await self.platform.follow(self._arm.name, lap)
        await self.leave(self._arm, lap, self._button.body)
        return motion

    def reach(self) -> bool:
        """Check whether the hand reaches the button from any base pose."""
        grounding = self._grounding()
        plane = Plane(grounding.grounded().constraints[0])
        return next(self._reaching(grounding, plane, self._points()), None) is not None

    def _grounding(self) -> Grounding:
        return Grounding(self.platform, self._constraints(), touches={self._button.body, self._button.device})

    def _points(self) -> Array:
        """Sample the stroke (n, 4): the button's point in its body's frame, with heights over it."""
        heights = np.linspace(BEFORE, BEYOND, 1 + math.ceil((BEFORE - BEYOND) / STEP))
        return np.column_stack([np.repeat(np.array([self._button.point]), len(heights), axis=0), heights])

    def _constraints(self) -> tuple[MotionConstraint, ...]:
        """Build the constraints: the tip is over the button, and the hand leans little from its normal."""
        x, y, z = map(float, self._arm.frame.approach)
        hand = self._arm.part.hand
        tip = a_feature("LINE", of=hand, position=(0.0, 0.0, 0.0), direction=(x, y, z))
        of = self.platform.scene.bodies.designator(self._button.body)
        button = a_feature("PLANE", of=of, position=self._button.point, direction=self._button.normal)
        return (
            a_constraint("HEIGHT", tip, button, lower=-EXACT, upper=EXACT, name="tip at the button"),
            a_constraint("PERPENDICULARITY", tip, button, lower=-1.2, upper=LEANS, name="hand along the normal"),
        )


def button_failure(
    button: Control, arms: Sequence[ArmModel], platform: Platform, reaches: Reaches
) -> LocationUnresolvable:
    """Build the failure for a button that none of ``arms`` can push, with a change of the map that would help."""
    figures = "; ".join(filter(None, (_too_far(button, arms, platform), _otherwise(button, platform.scene, reaches))))
    return LocationUnresolvable(designator=f"the base with a hand at {button.body}", figures=figures)


def _too_far(button: Control, arms: Sequence[ArmModel], platform: Platform) -> str:
    """Describe how near a shoulder gets to a button, if that is beyond every arm's reach; otherwise ""."""
    pose = platform.scene.bodies.pose(button.body) @ Pose(button.point)
    poses, there = platform.standing(), np.array([pose.position[:2]])
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

    changes = Changes(device, scene, Rejections(), reaches, parts=(button.body,))
    return changes.nearer(normal[:2] / np.linalg.norm(normal[:2])) or changes.turned()
