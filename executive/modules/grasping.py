"""The process modules of grippers and of handovers, which wait until a person takes what an arm holds."""

from __future__ import annotations

from executive.modules.platform import Platform
from executive.robots.arms import ArmModel
from planlang import wait_for
from planlang.designators import Action, Device, Object, Person
from planlang.failures import (
    ActionUnresolvable,
    CommunicationFailure,
    DesignatorFailure,
    GraspMissed,
    GripperFailure,
    GripperGoalNotReached,
    HandoverNotTaken,
    MissingCapability,
)
from planlang.modules import process_module
from planlang.protocols import MotionState


@process_module
class Grasping:
    """Opens and closes grippers: one module for both, so that requests to one gripper queue up."""

    name = "gripper"
    actions = ("OpeningAGripper", "ClosingAGripper")
    failures = (GripperFailure, DesignatorFailure)

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the arm that carries the gripper: it must not move meanwhile."""
        return tuple(arm.name for arm in self._arms(action)[:1])

    async def execute(self, action: Action) -> str | None:
        """Open or close; return the name of what was grasped or let go."""
        arms = self._arms(action)
        if not arms:
            raise MissingCapability(designator=str(action), missing=("GripperMotionCapability",))
        if "ClosingAGripper" in self.platform.ancestors(action.type):
            return await self._close(arms[0], action)
        return await self._open(arms[0])

    def _arms(self, action: Action) -> list[ArmModel]:
        """Return the arms that the action may mean: of the device; else one that holds something; else the chosen one.

        For a thing that is in no hand, free arms come first.
        """
        scene, arms, hands = self.platform.scene, self.platform.arms, self.platform.hands
        device, what = action.get("device_used"), action.get("object_acted_on")
        candidates = scene.arms.of(device) if isinstance(device, Device) else scene.arms.all
        found = arms.holding(candidates) or arms.in_order(candidates)
        if isinstance(what, Object) and not hands.hold(what):
            found = arms.free(candidates) or found
        return [arm for arm in found if hands.gripper(arm) is not None]

    async def _close(self, arm: ArmModel, action: Action) -> str:
        hands = self.platform.hands
        motion = await hands.move(arm, closed=True)
        name = hands.between_fingers(arm)
        if name is None:
            what = action.get("object_acted_on")
            wanted = str(what) if isinstance(what, Object) else None
            raise GraspMissed(arm=arm.name, what=wanted, blocked_by=motion.blocked_by)
        hands.grasp(arm, name)
        return name

    async def _open(self, arm: ArmModel) -> str | None:
        hands, held = self.platform.hands, self.platform.scene.arms.held(arm.name)
        if held is not None:
            hands.let_go(held.name)
        motion = await hands.move(arm, closed=False)
        if motion.state is not MotionState.DONE:
            raise GripperGoalNotReached(arm=arm.name, blocked_by=motion.blocked_by)
        if held is None:
            return None
        await hands.settled(held.name)
        return held.name


PATIENCE = 15.0
"""How long an object is offered [s]: long enough to notice it and to reach out."""


@process_module
class Handover:
    """Offers what an arm holds until somebody takes it."""

    name = "handover"
    actions = ("HandingOverAnObject",)
    failures = (CommunicationFailure, GripperFailure, DesignatorFailure)

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the arm that holds the object."""
        return tuple(arm.name for arm in self._arm(action))

    async def execute(self, action: Action) -> str:
        """Hand over ``object_acted_on`` (default: what is held); return the name of the person who took it."""
        arms = self._arm(action)
        if not arms:
            raise ActionUnresolvable("no arm holds what is to be handed over", designator=str(action))
        platform, arm = self.platform, arms[0]
        held = platform.scene.arms.held(arm.name)
        assert held is not None
        recipient = action.get("recipient")
        wanted = str(recipient) if isinstance(recipient, Person) else None
        person = await wait_for(platform.hands.taken(held.name), timeout=PATIENCE)
        if person is None:
            raise HandoverNotTaken(what=held.name, recipient=wanted)
        if isinstance(recipient, Person) and platform.scene.bodies.bind(recipient) != person:
            raise HandoverNotTaken(f"{person} takes {held.name} instead of {wanted}", what=held.name, recipient=wanted)
        platform.hands.let_go(held.name, to=person)
        await platform.hands.move(arm, closed=False)
        return str(person)

    def _arm(self, action: Action) -> list[ArmModel]:
        platform = self.platform
        what = action.get("object_acted_on")
        name = platform.scene.bodies.bind(what) if isinstance(what, Object) else None
        found = []
        for arm in platform.scene.arms.all:
            held = platform.scene.arms.held(arm.name)
            if held is not None and name in (None, held.name):
                found.append(arm)
        return found[:1]
