"""Strokes of a closed hand that push a device's button along its normal, until a finger touches it."""

from __future__ import annotations

import math

import numpy as np

from executive.modules.arm.hand_work import HandWork
from executive.modules.phases import Phase
from executive.modules.tools.motion_grounding import Grounding
from executive.modules.tools.strokes import Plane, StrokeWork
from executive.robots.arms import ArmModel
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product
from planlang.motion_constraints import MotionConstraint, a_constraint, a_feature
from planlang.protocols import Motion, Trajectory
from sim.joints import Control

BEFORE, BEYOND = 0.1, -0.02
"""Heights of the tip over a button at the start and end of a push [m]; the button stops it before the end."""
STEP = 0.025
"""Spacing of waypoints [m]."""
EXACT = 0.003
"""Tolerance of heights [m]."""
LEANS = -0.7
"""Cosine between the hand's approach and the button's normal at the largest lean, 45 degrees."""


class ButtonStrokes(StrokeWork):
    """Pushes one button with one hand; the tip stays on the line through the button along its normal."""

    def __init__(self, work: HandWork, arm: ArmModel, button: Control) -> None:
        super().__init__(work.platform)
        self._work, self._arm, self._button = work, arm, button

    async def pushed(self) -> Motion:
        """Push, retreat, and return how the push ended. Raises a ManipulationFailure or NavigationFailure."""
        grounding, phase, constraints = self._grounding(), Phase(), self._constraints()
        await self._look(grounding, constraints, phase)
        plane = Plane(grounding.grounded(constraints, phase).constraints[0])
        lap = await self.stroke(grounding, phase, constraints, plane, self._points(), closed=False)
        motion = await self.platform.follow(self._arm.name, lap)
        await self._back(lap)
        return motion

    def reach(self) -> bool:
        """Check whether the hand reaches the button from any base pose."""
        grounding, phase, constraints = self._grounding(), Phase(), self._constraints()
        plane = Plane(grounding.grounded(constraints, phase).constraints[0])
        return next(self._reaching(grounding, phase, constraints, plane, self._points()), None) is not None

    def _grounding(self) -> Grounding:
        return Grounding(self.platform, {self._button.body, self._button.device})

    def _points(self) -> Array:
        """Sample the stroke (n, 4): the button's point in its body's frame, with heights over it."""
        heights = np.linspace(BEFORE, BEYOND, 1 + math.ceil((BEFORE - BEYOND) / STEP))
        return np.column_stack([np.repeat(np.array([self._button.point]), len(heights), axis=0), heights])

    def _constraints(self) -> tuple[MotionConstraint, ...]:
        """Build the constraints: the tip is over the button, and the hand leans little from its normal."""
        x, y, z = map(float, self._arm.frame.approach)
        hand = self.platform.robot.arm(self._arm.name).hand
        tip = a_feature("LINE", of=hand, position=(0.0, 0.0, 0.0), direction=(x, y, z))
        of = self.platform.scene.bodies.designator(self._button.body)
        button = a_feature("PLANE", of=of, position=self._button.point, direction=self._button.normal)
        return (
            a_constraint("HEIGHT", tip, button, lower=-EXACT, upper=EXACT, name="tip at the button"),
            a_constraint("PERPENDICULARITY", tip, button, lower=-1.2, upper=LEANS, name="hand along the normal"),
        )

    async def _back(self, lap: Trajectory) -> None:
        """Retreat along the stroke and tuck the arm."""
        base = Pose.planar(*self.platform.base()).matrix()
        poses = product(base, self._arm.solver.chain.fk(lap.positions[[0, -1]]))
        await self._work.back(self._arm, poses, self._button.body)
