"""The hands of a platform: fingers, what they hold, and letting it go."""

from __future__ import annotations

import numpy as np

from executive.modules.control import Control
from executive.robots import Gripper
from executive.robots.arms import ArmModel
from planlang import Fluent, wait_for
from planlang.designators import Object
from planlang.failures import ObjectUnresolvable
from planlang.geometry import Pose
from planlang.protocols import Motion


class Hands:
    """Moves fingers, and tells the belief what they hold."""

    def __init__(self, control: Control) -> None:
        self._control = control

    def gripper(self, arm: ArmModel) -> Gripper | None:
        """Return the gripper of an arm."""
        return self._control.robot.arm(arm.name).gripper

    def hold(self, what: Object) -> bool:
        """Return whether the robot holds a thing; False if it is not known which that is."""
        try:
            return self._control.scene.bodies.bind(what) in self._control.belief.held
        except ObjectUnresolvable:
            return False

    async def move(self, arm: ArmModel, *, closed: bool) -> Motion:
        """Open or close the fingers as far as they go."""
        gripper = self.gripper(arm)
        assert gripper is not None
        wanted = gripper.closed if closed else gripper.opened
        path = np.stack([self._control.joints(gripper.joints), [wanted[name] for name in gripper.joints]])
        return await self._control.follow(f"gripper of {arm.name}", self._control.timed(gripper.joints, path))

    def between_fingers(self, arm: ArmModel) -> str | None:
        """Return the body that the closed fingers feel."""
        gripper = self.gripper(arm)
        return self._control.world.between_fingers(gripper.finger_links) if gripper is not None else None

    def grasp(self, arm: ArmModel, name: str) -> None:
        """Attach a body on which the fingers have closed: it moves with the hand from now on."""
        control, link = self._control, self._control.robot.arm(arm.name).tip
        control.world.attach(link, name)
        offset = control.world.link_pose(link).inverse() @ control.belief.pose(name)
        control.belief.grasped(name, arm.name, link, offset)
        control.sync()

    def let_go(self, name: str, *, to: str | None = None) -> None:
        """Let a held body go: it comes down on what is below, or a person has it."""
        control = self._control
        control.sync()
        believed = control.scene.world.pose(name)
        x, y, z = believed.position
        sinks = control.scene.world.height_above_support(name)
        control.world.release(name)
        # A body above nothing, or above the void beside a map, is believed to lie on the floor.
        control.belief.released(name, Pose((x, y, z - sinks if sinks < z else 0.0), believed.orientation), to=to)
        control.sync()

    async def settled(self, name: str) -> None:
        """Wait until a body that was let go has come to rest."""
        await wait_for(Fluent(read=lambda: not self._control.world.falling(name), name=f"{name} at rest"))

    def taken(self, name: str) -> Fluent[str | None]:
        """Return a fluent of the person who pulls at a held body, None while nobody does: what the wrist feels."""
        return Fluent(read=lambda: self._control.world.taken(name), name=f"{name} taken")
