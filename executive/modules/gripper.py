"""Opens and closes grippers; closing on nothing is a failure, opening lets go of what is held."""

from __future__ import annotations

from executive.modules.platform import Platform
from executive.robots.arms import ArmModel
from planlang.designators import Action, Device, Object
from planlang.failures import DesignatorFailure, GraspMissed, GripperFailure, GripperGoalNotReached, MissingCapability


class GripperModule:
    """One module for both directions, so that requests to one gripper queue up."""

    name = "gripper"
    actions = ("OpeningAGripper", "ClosingAGripper")
    failures = (GripperFailure, DesignatorFailure)

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """The arm that carries the gripper: it must not move meanwhile."""
        return tuple(arm.name for arm in self._arms(action)[:1])

    async def execute(self, action: Action) -> str | None:
        """Open or close; the name of what was grasped or let go."""
        arms = self._arms(action)
        if not arms:
            raise MissingCapability(designator=str(action), missing=("GripperMotionCapability",))
        if "ClosingAGripper" in self.platform.ancestors(action.type):
            return await self._close(arms[0], action)
        return await self._open(arms[0])

    def _arms(self, action: Action) -> list[ArmModel]:
        """Its device's arm; else the arm that holds something; else the one chosen in this branch of the plan.

        Of several that may be meant one that is free opens for, and closes on, a thing that is not in a hand.
        """
        platform = self.platform
        device, what = action.get("device_used"), action.get("object_acted_on")
        candidates = platform.scene.arms.of(device) if isinstance(device, Device) else platform.scene.arms.all
        arms = platform.holding(candidates) or platform.in_order(candidates)
        if isinstance(what, Object) and not platform.in_hand(what):
            arms = platform.free(candidates) or arms
        return [arm for arm in arms if platform.gripper(arm) is not None]

    async def _close(self, arm: ArmModel, action: Action) -> str:
        platform = self.platform
        motion = await platform.move_gripper(arm, closed=True)
        name = platform.between_fingers(arm)
        if name is None:
            what = action.get("object_acted_on")
            wanted = str(what) if isinstance(what, Object) else None
            raise GraspMissed(arm=arm.name, what=wanted, blocked_by=motion.blocked_by)
        platform.grasp(arm, name)
        return name

    async def _open(self, arm: ArmModel) -> str | None:
        platform = self.platform
        held = platform.scene.arms.held(arm.name)
        if held is not None:
            platform.let_go(held.name)
        motion = await platform.move_gripper(arm, closed=False)
        if motion.state != "done":
            raise GripperGoalNotReached(arm=arm.name, blocked_by=motion.blocked_by)
        if held is None:
            return None
        await platform.settled(held.name)
        return held.name
