"""The process module that turns devices on and off: it pushes their button, or turns their knob.

Which of the two a device has, and where, is in ``executive/maps/scene.py``. A device that is believed to be in the
wanted state is left alone: a push on its button would change that.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from executive.modules.arm.hand_work import HandWork
from executive.modules.furniture.button_failures import button_failure
from executive.modules.furniture.button_strokes import ButtonStrokes
from executive.modules.furniture.containers import LeafWork, ways_tried
from executive.modules.tries import Tries
from planlang.designators import Action, Object
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    EnvironmentManipulationFailure,
    HandleNotReachable,
    ManipulationFailure,
    ManipulationPoseUnreachable,
    NavigationFailure,
    ObjectUnresolvable,
)
from planlang.geometry import Pose
from planlang.kernel import compute_in_thread
from planlang.language.process_module import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied
from planlang.protocols import Touch
from sim.controls import AT_BUTTON, Control

ABOUT = ("object_acted_on", "device_used")
"""Properties of an action with the device that it is about, the first of them that is one."""
THIN = 0.005
"""Distance from the surface of a button within which a touch is one of the button, along its normal [m]."""


@process_module
class Devices(HandWork):
    """Turns devices on and off."""

    name = "device"
    actions = ("TurningOnPoweredDevice", "TurningOffPoweredDevice", "PreheatOven", "OperateOven")
    failures = (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure, DesignatorFailure)
    by_hand = True
    """The simulator switches what the hand has really moved."""

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the whole robot."""
        return self.whole_robot()

    async def execute(self, action: Action) -> str:
        """Turn the device on or off; return its name, or raise a failure of the classes in ``failures``."""
        control, world = self._control(action), self.platform.scene.world
        turns_on = "TurningOffPoweredDevice" not in self.platform.ancestors(action.type)
        self.platform.sync()
        if world.changes.matter.is_on(control.device) == turns_on:
            return control.device
        if control.turns:
            joint = self.platform.belief.joints[control.body]
            was_on = world.scene.body(control.device).is_on
            await LeafWork(self.platform).moved(joint, opens=turns_on != was_on)
        else:
            await self._push(control)
        return control.device

    def _control(self, action: Action) -> Control:
        """Return the control of the device that an action is about."""
        controls = self.platform.scene.world.scene.controls
        for value in map(action.get, ABOUT):
            for what in value if isinstance(value, tuple) else (value,):
                try:
                    name = self.platform.scene.bodies.bind(what) if isinstance(what, Object) else None
                except ObjectUnresolvable:
                    continue
                found = next((one for one in controls if name in (one.device, one.body)), None)
                if found is not None:
                    return found
        raise ActionUnresolvable("no device is named that has a button or a knob", designator=str(action))

    async def _push(self, button: Control) -> None:
        """Push a button, with one hand after another, until one has met it."""
        tries, tried = Tries(), 0
        for arm in self.free_hands():
            await self.tuck(self.platform.arms.untucked())
            await self.platform.hands.move(arm, closed=True)
            self.platform.arms.choices.choose(arm.name)
            with tries:
                motion = await ButtonStrokes(self, arm, button).pushed()
                if motion.touch is not None and self._is_at(button, motion.touch):
                    return
                tried += 1
                await self.platform.sensing.bump(motion)
                raise ManipulationPoseUnreachable(arm=arm.name, what=button.body, blocked_by=motion.blocked_by)
        problem = tries.problem
        said = f"the button of {button.device} is out of reach: {ways_tried(tried)}"
        if not tried and isinstance(problem, ConstraintsUnsatisfied) and not self.platform.robot.base.fixed:
            strokes = [ButtonStrokes(self, arm, button) for arm in self.free_hands()]
            problem = await compute_in_thread(
                partial(
                    button_failure,
                    button,
                    self.free_hands(),
                    self.platform,
                    lambda: any(one.reach() for one in strokes),
                )
            )
        raise HandleNotReachable(said, what=button.body) from problem

    def _is_at(self, button: Control, touch: Touch) -> bool:
        """Return whether what a finger felt is the button: what is behind it, or before it, feels alike."""
        x, y, z = (self.platform.belief.pose(button.body) @ Pose(button.point)).inverse().matrix()[:3] @ (
            *touch.point,
            1.0,
        )
        depth = float(np.dot((x, y, z), button.normal))
        return abs(depth) <= THIN and math.hypot(x, y, z) <= AT_BUTTON
