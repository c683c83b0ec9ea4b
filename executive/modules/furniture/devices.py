"""Process module that turns devices on and off by pushing their button or turning their knob.

``executive/maps/scene.py`` finds which of the two a device has, and where. A device shows by a lamp or display whether
it is on: it is looked at before, because a push on its button would toggle one that is in the desired state already,
and afterwards. A robot without camera that trusts the map counts the pushes and turns instead. A closed hand pushes a
button along its normal, in one stroke.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations import Rejections
from executive.locations.changes import Changes
from executive.modules.arm.hand_work import HandWork
from executive.modules.furniture.button_reach import Push, pushes
from executive.modules.furniture.containers import LeafWork, ways_tried
from executive.modules.furniture.leaf_grips import hand_with
from executive.modules.furniture.witnessing import is_witnessed
from executive.modules.platform import Platform
from executive.modules.runner import Skill
from executive.modules.tools.motion_grounding import Grounding
from executive.modules.tools.strokes import PLACES, Plane, Planned, StrokeWork
from executive.robots.arms import ArmModel, too_far
from planlang.changes import Switched
from planlang.designators import Action, Object
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    DeviceUnresponsive,
    EnvironmentManipulationFailure,
    HandleNotReachable,
    LocationUnresolvable,
    ManipulationFailure,
    ManipulationPoseUnreachable,
    NavigationFailure,
    ObjectUnresolvable,
    PlanFailure,
    StateUnknown,
)
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved
from planlang.kernel import compute_in_thread
from planlang.language.process_module import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied, MotionConstraint, a_constraint, a_feature
from planlang.protocols import Motion, Touch
from planlang.state.matter import OFF, ON
from sim.joints import AT_BUTTON, HALFWAY, Control

ABOUT = ("object_acted_on", "device_used")
"""Properties of an action that may name the device, in order of preference."""
TIMES = 2
"""Most pushes or turns: a device that did not respond to these is broken."""
THIN = 0.005
"""Distance along the normal within which a touch counts as one of the button's surface [m]."""
BEFORE, BEYOND = 0.1, 0.01
"""Height of the tip over a button at the start of a push, and depth to which the leaning fingers would get into it [m]:
the button stops them before. More would cost reach: devices stand at the back of counters.
"""
STEP = 0.025
"""Spacing of waypoints [m]."""
CLEAR = 0.01
"""Distance from the button down to which the hand touches nothing yet [m]."""
EXACT = 0.003
"""Tolerance of heights [m]."""
LEANS = -0.7
"""Cosine between the hand's approach and the button's normal at the largest lean, 45 degrees."""

UPRIGHT = 0.7
"""Vertical component of a button's normal above which it is on top of its device, at no edge."""
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

        async def approach(way: Push) -> None:
            if way.base != self.platform.base():
                await self.drive_with_room(way.base)
                await self._look(grounding)

        async def solved(way: Push) -> Planned:
            guess = self._arm.chain.near(way.joints, self._start(grounding.grounded()))
            return await self.planned_stroke(grounding, plane, self._points(), guess, closed=False)

        failures = (ConstraintsUnsatisfied, NavigationFailure)
        planned = await Skill(self._ways, solved, approach, failures=failures, otherwise=self._unsolved).run()
        lap = await self.begin_stroke(planned)
        motion = await self.platform.follow(self._arm.name, lap)
        await self.leave(self._arm, lap, self._button.body)
        return motion

    def reach(self) -> bool:
        """Check whether the hand reaches the button from any base pose."""
        return next(self._ways(), None) is not None

    def _ways(self) -> Iterator[Push]:
        """Yield the ways to push the button without collision, at most :data:`PLACES`."""
        scene, button, points = self.platform.scene, self._button, self._points()
        grounding = self._grounding()
        motion = grounding.grounded()
        normal = np.array(button.normal) / np.linalg.norm(button.normal)
        line = moved(scene.bodies.pose(button.body).matrix(), points[:, :3] + points[:, 3:] * normal)
        free = int((points[:, 3] > self._fingers() + CLEAR).sum())

        def is_free(way: Push) -> bool:
            rows = enumerate(way.joints)
            return not any(grounding.touching(motion, row, way.base, clear=number < free) for number, row in rows)

        ways = pushes(self.platform.standing(), self._arm, line, touches=button.body, free=free, is_free=is_free)
        yield from islice(ways, PLACES)

    async def _unsolved(self, problem: PlanFailure | None, tried: int) -> PlanFailure:
        return problem or ConstraintsUnsatisfied(arm=self._arm.name, what=self._button.body)

    def _fingers(self) -> float:
        """Compute how far the fingers end ahead of the tip [m]."""
        return max(float((hand_with(self.platform.scene, self._arm) @ np.array(self._arm.frame.approach)).max()), 0.0)

    def _grounding(self) -> Grounding:
        return Grounding(self.platform, self._constraints(), touches={self._button.body, self._button.device})

    def _points(self) -> Array:
        """Sample the stroke (n, 4): the button's point in its body's frame, with heights over it."""
        end = -LEANS * self._fingers() - BEYOND
        heights = np.linspace(BEFORE, end, 1 + math.ceil((BEFORE - end) / STEP))
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


def _button_failure(
    button: Control, arms: Sequence[ArmModel], platform: Platform, reaches: Reaches
) -> LocationUnresolvable:
    """Build the failure for a button that none of ``arms`` can push, with a change of the map that would help."""
    scene, standing = platform.scene, platform.standing()
    pose = scene.bodies.pose(button.body) @ Pose(button.point)
    away = {arm.name: standing.distances([np.array([pose.position[:2]])], [arm])[0] for arm in arms}
    arm = min(arms, key=lambda one: away[one.name] - one.reach)
    figures, advice = [too_far(arm, button.body, away[arm.name])], None
    normal = pose.rotation @ np.array(button.normal)
    if abs(float(normal[2])) <= UPRIGHT:
        changes = Changes(button.device, scene, Rejections(), reaches, parts=(button.body,))
        advice = changes.nearer(normal[:2] / np.linalg.norm(normal[:2]))
        figures.append(changes.none_found() if advice is None else advice.sentence)
    what = f"the base with a hand at {button.body}"
    changed = () if advice is None else advice.changes
    return LocationUnresolvable(designator=what, figures="; ".join(filter(None, figures)), changes=changed)


@process_module
class Devices(HandWork):
    """Turns devices on and off."""

    name = "device"
    actions = ("TurningOnPoweredDevice", "TurningOffPoweredDevice", "PreheatOven", "OperateOven")
    failures = (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure, DesignatorFailure)
    # beside those of looking, which RobotModule declares for all modules

    async def execute(self, action: Action) -> str:
        """Turn the device on or off; return its name. Raises failures of the classes in ``failures``."""
        control = self._control(action)
        turns_on = "TurningOffPoweredDevice" not in self.platform.ancestors(action.type)

        async def is_done() -> bool:
            return await self._is_on(control) is turns_on

        async def unresponsive(problem: PlanFailure | None, tried: int) -> PlanFailure:
            does = "its knob was turned" if control.turns else "its button was pushed"
            stays = f"{control.device} stays {'off' if turns_on else 'on'}, although {does} {tried} times"
            message = f"{stays}, as the hand has felt: it is dead, or has no power"
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
        if self._counts():
            matter = belief.state.matter
            state = OFF if matter.is_on(control.device) else ON
            switched = replace(belief.state, matter=matter.switched(control.device, state))
            belief.happened(switched, Switched(control.device, state))
        else:
            belief.doubted(control.device)

    def _counts(self) -> bool:
        """Check whether the robot counts what its hand has felt, from the state that the map tells: it sees nothing."""
        return self.platform.robot.camera is None and self.platform.belief.trusts_map

    async def _is_on(self, control: Control) -> bool:
        """Look whether a device is on, or count. Raises StateUnknown if the robot can do neither."""
        device = control.device
        if not self._counts() and not await is_witnessed(self, device):
            is_blind = self.platform.robot.camera is None
            unseen = (
                "the robot has no camera to see it, and a push would toggle it: this takes a robot with a camera, "
                "or a map that can be trusted"
            )
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
                met = await self.platform.sensing.bump(motion)
                raise ManipulationPoseUnreachable(arm=arm.name, what=button.body, blocked_by=met)

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

            failure.__cause__ = await compute_in_thread(partial(_button_failure, button, arms, self.platform, reaches))
        return failure

    def _is_at(self, button: Control, touch: Touch) -> bool:
        """Check by its position whether a touch is one of the button, rather than of a body before or behind it."""
        x, y, z = (self.platform.belief.pose(button.body) @ Pose(button.point)).inverse().matrix()[:3] @ (
            *touch.point,
            1.0,
        )
        depth = float(np.dot((x, y, z), button.normal))
        return abs(depth) <= THIN and math.hypot(x, y, z) <= AT_BUTTON
