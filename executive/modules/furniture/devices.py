"""Process module that turns devices on and off by pushing their button or turning their knob.

``executive/maps/scene.py`` finds which of the two a device has, and where. A device shows by a lamp or display whether
it is on: it is looked at before, because a push on its button would toggle one that is in the desired state already,
and afterwards.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.modules.arm.hand_work import HandWork
from executive.modules.furniture.buttons import ButtonStrokes, button_failure
from executive.modules.furniture.containers import LeafWork, ways_tried
from executive.modules.furniture.witnessing import is_witnessed
from executive.modules.runner import Skill
from executive.robots.arms import ArmModel
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
    PlanFailure,
    StateUnknown,
)
from planlang.geometry import Pose
from planlang.kernel import compute_in_thread
from planlang.language.process_module import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied
from planlang.protocols import Touch
from sim.joints import AT_BUTTON, HALFWAY, Control

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

    async def execute(self, action: Action) -> str:
        """Turn the device on or off; return its name. Raises failures of the classes in ``failures``."""
        control = self._control(action)
        turns_on = "TurningOffPoweredDevice" not in self.platform.ancestors(action.type)

        async def is_done() -> bool:
            return await self._is_on(control) is turns_on

        async def unresponsive(problem: PlanFailure | None, tried: int) -> PlanFailure:
            does = "its knob was turned" if control.turns else "its button was pushed"
            message = f"{control.device} stays {'off' if turns_on else 'on'}, although {does} {tried} times"
            return DeviceUnresponsive(message, what=control.device)

        await Skill(lambda: (control,), self._switch, failures=(), most=TIMES, otherwise=unresponsive).until(is_done)
        return control.device

    async def _switch(self, control: Control) -> None:
        """Turn the knob of a device, or push its button."""
        belief = self.platform.belief
        if control.turns:
            joint = belief.joints[control.body]
            is_turned = belief.joint(control.body) >= HALFWAY * joint.upper
            work = LeafWork(self.platform, joint)
            await (work.close() if is_turned else work.open())
        else:
            await self._push(control)
        belief.doubted(control.device)

    async def _is_on(self, control: Control) -> bool:
        """Look whether a device is on. Raises StateUnknown if that cannot be seen."""
        device = control.device
        if not await is_witnessed(self, device):
            is_blind = self.platform.robot.camera is None
            unseen = "the robot has no camera to see it, and a push would toggle it: this takes a robot with a camera"
            reason = unseen if is_blind else "it was not seen from any base pose tried"
            raise StateUnknown(f"it is not known whether {device} is on: {reason}", what=device)
        return self.platform.belief.state.matter.is_on(device)

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

        async def contact(arm: ArmModel) -> None:
            motion = await ButtonStrokes(self.platform, arm, button).pushed()
            if motion.touch is None or not self._is_at(button, motion.touch):
                await self.platform.sensing.bump(motion)
                raise ManipulationPoseUnreachable(arm=arm.name, what=button.body, blocked_by=motion.blocked_by)

        await Skill(
            lambda: self.hands_for(button.body, button.body),
            contact,
            self.close_hand,
            otherwise=partial(self._out_of_reach, button),
        ).run()

    async def _out_of_reach(self, button: Control, problem: PlanFailure | None, tried: int) -> PlanFailure:
        """Make the failure of a button that no hand has pushed, with a change of the map that would help."""
        is_unsolved = isinstance(problem, ConstraintsUnsatisfied)
        message = f"the button of {button.device} is out of reach: {ways_tried(0 if is_unsolved else tried)}"
        failure = HandleNotReachable(message, what=button.body)
        failure.__cause__ = problem
        if is_unsolved and not self.platform.robot.base.fixed:
            arms = self.free_hands()
            strokes = [ButtonStrokes(self.platform, arm, button) for arm in arms]

            def reaches(scene: PlanningScene) -> bool:
                return any(one.supposing(scene).reach() for one in strokes)

            failure.__cause__ = await compute_in_thread(partial(button_failure, button, arms, self.platform, reaches))
        return failure

    def _is_at(self, button: Control, touch: Touch) -> bool:
        """Check by its position whether a touch is one of the button, rather than of a body before or behind it."""
        x, y, z = (self.platform.belief.pose(button.body) @ Pose(button.point)).inverse().matrix()[:3] @ (
            *touch.point,
            1.0,
        )
        depth = float(np.dot((x, y, z), button.normal))
        return abs(depth) <= THIN and math.hypot(x, y, z) <= AT_BUTTON
