"""Process module that turns devices on and off by pushing their button or turning their knob.

``executive/maps/scene.py`` finds which of the two a device has, and where. A device shows by a lamp or display whether
it is on: it is looked at before, because a push on its button would toggle one that is in the desired state already,
and afterwards.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from executive.modules.arm.hand_work import HandWork
from executive.modules.furniture.button_failures import button_failure
from executive.modules.furniture.button_strokes import ButtonStrokes
from executive.modules.furniture.containers import LeafWork, ways_tried
from executive.modules.furniture.witnessing import is_witnessed
from executive.modules.tries import Tries
from planlang.designators import Action, Object
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    DeviceUnresponsive,
    EnvironmentManipulationFailure,
    HandleNotReachable,
    ManipulationFailure,
    ManipulationPoseUnreachable,
    NavigationFailure,
    ObjectUnresolvable,
    StateUnknown,
)
from planlang.geometry import Pose
from planlang.kernel import compute_in_thread
from planlang.language.process_module import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied
from planlang.protocols import Touch
from sim.controls import AT_BUTTON, HALFWAY, Control

ABOUT = ("object_acted_on", "device_used")
"""Properties of an action that may name the device, in order of preference."""
TIMES = 2
"""Most pushes or turns: a device that did not respond to these is broken."""
THIN = 0.005
"""Distance along the normal within which a touch counts as one of the button's surface [m]."""


@process_module
class Devices(HandWork):
    """Turns devices on and off."""

    name = "device"
    actions = ("TurningOnPoweredDevice", "TurningOffPoweredDevice", "PreheatOven", "OperateOven")
    failures = (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure, DesignatorFailure)
    # beside those of looking, which LookingFirst declares for all modules

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the whole robot."""
        return self.whole_robot()

    async def execute(self, action: Action) -> str:
        """Turn the device on or off; return its name. Raises failures of the classes in ``failures``."""
        control, belief = self._control(action), self.platform.belief
        turns_on = "TurningOffPoweredDevice" not in self.platform.ancestors(action.type)
        for _ in range(TIMES):
            if await self._is_on(control) is turns_on:
                return control.device
            if control.turns:
                joint = belief.joints[control.body]
                is_turned = belief.joint(control.body) >= HALFWAY * joint.upper
                await LeafWork(self.platform).moved(joint, opens=not is_turned)
            else:
                await self._push(control)
            belief.doubted(control.device)
        if await self._is_on(control) is turns_on:
            return control.device
        does = "its knob was turned" if control.turns else "its button was pushed"
        message = f"{control.device} stays {'off' if turns_on else 'on'}, although {does} {TIMES} times"
        raise DeviceUnresponsive(message, what=control.device)

    async def _is_on(self, control: Control) -> bool:
        """Look whether a device is on. Raises StateUnknown if that cannot be seen."""
        device = control.device
        if not await is_witnessed(self, device):
            is_blind = self.platform.robot.camera is None
            unseen = "the robot has no camera to see it, and a push would toggle it: this takes a robot with a camera"
            reason = unseen if is_blind else "it was not seen from any base pose tried"
            raise StateUnknown(f"it is not known whether {device} is on: {reason}", what=device)
        return self.platform.scene.world.changes.matter.is_on(device)

    def _control(self, action: Action) -> Control:
        """Find the control of the device that an action names. Raises ActionUnresolvable if there is none."""
        controls = self.platform.scene.world.scene.controls
        for value in map(action.get, ABOUT):
            for what in value if isinstance(value, tuple) else (value,):
                try:
                    name = self.platform.scene.bodies.bind(what) if isinstance(what, Object) else None
                except ObjectUnresolvable:
                    continue
                control = next((one for one in controls if name in (one.device, one.body)), None)
                if control is not None:
                    return control
        raise ActionUnresolvable(
            "no device is named that has a button or a knob; name one as object_acted_on", designator=str(action)
        )

    async def _push(self, button: Control) -> None:
        """Push a button with one hand after another, until a finger touches it. Raises HandleNotReachable."""
        tries, tried = Tries(), 0
        for arm in self.hands_for(button.body, button.body):
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
        message = f"the button of {button.device} is out of reach: {ways_tried(tried)}"
        if not tried and isinstance(problem, ConstraintsUnsatisfied) and not self.platform.robot.base.fixed:
            strokes = [ButtonStrokes(self, arm, button) for arm in self.free_hands()]
            problem = await compute_in_thread(
                partial(
                    button_failure,
                    button,
                    self.free_hands(),
                    self.platform,
                    lambda scene: any(one.supposing(scene).reach() for one in strokes),
                )
            )
        raise HandleNotReachable(message, what=button.body) from problem

    def _is_at(self, button: Control, touch: Touch) -> bool:
        """Check by its position whether a touch is one of the button, rather than of a body before or behind it."""
        x, y, z = (self.platform.belief.pose(button.body) @ Pose(button.point)).inverse().matrix()[:3] @ (
            *touch.point,
            1.0,
        )
        depth = float(np.dot((x, y, z), button.normal))
        return abs(depth) <= THIN and math.hypot(x, y, z) <= AT_BUTTON
