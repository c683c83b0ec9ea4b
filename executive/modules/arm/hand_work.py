"""Motions of a hand at things that stay where they are: handles, buttons and knobs, and away from them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from executive.modules.platform import PlatformModule
from executive.motion import MotionError
from executive.robots import CARRYING
from executive.robots.arms import ArmModel
from planlang.failures import (
    LookingGoalUnreachable,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    NavigationFailure,
)
from planlang.geometry import Array
from planlang.geometry.matrices import rotated
from planlang.protocols import Trajectory

FEW = 200
"""Branches that the search of a path of the arm grows: there are other ways to try, and places with more room."""
SHARES = (1.0, 0.5, 0.25)
"""Shares of the way on which a hand came that it is taken back: the arm may reach no farther."""
BACK = 0.2
"""Least distance that the base drives back from a leaf before the arm is tucked: beside it there is little room [m]."""


class HandWork(PlatformModule):
    """Motions that process modules for handles and controls have in common; hands may touch the body ``what``."""

    def free_hands(self) -> list[ArmModel]:
        """Return the arms that hold nothing and have a gripper."""
        arms = self.platform.arms.free(self.platform.scene.arms.all)
        return [arm for arm in arms if self.platform.hands.gripper(arm) is not None]

    async def look(self, what: str) -> None:
        """Look at a thing, if the neck can; what is seen is where it is."""
        with suppress(LookingGoalUnreachable):
            await self.platform.sensing.look_at(self.platform.scene.bodies.block(what).centre, what)
            self.platform.sensing.see()

    async def tuck(self, untucked: Sequence[tuple[ArmModel, Array]]) -> None:
        """Bring free arms to the carrying posture, where there is a way."""
        for arm, posture in untucked if CARRYING in self.platform.robot.postures else ():
            with suppress(MotionError):
                await self.platform.follow(arm.name, self.platform.arms.path(arm, posture, iterations=FEW))

    def planned(self, arm: ArmModel, goal: Array, what: str | None) -> Trajectory:
        """Return a path of an arm to joint values (d,); raises ManipulationPoseUnreachable."""
        try:
            return self.platform.arms.path(arm, goal, what, FEW)
        except MotionError as problem:
            raise ManipulationPoseUnreachable(arm=arm.name, what=what) from problem

    async def straight(self, arm: ArmModel, pose: Array, q: Array, what: str | None) -> None:
        """Move the tip along a line to a map pose (4, 4) at joint values (d,); raises a ManipulationFailure."""
        try:
            trajectory = self.platform.arms.straight_path(arm, pose, q, what)
        except MotionError as problem:
            raise ManipulationPoseUnreachable(arm=arm.name, what=what) from problem
        await self.follow_to_end(arm.name, trajectory, what)

    async def back(self, arm: ArmModel, poses: Array, what: str | None) -> None:
        """Take the hand back as it came by ``poses`` (2, 4, 4), then to the carrying posture, where there is room."""
        platform = self.platform
        tip = platform.scene.arms.tip(arm)
        back = rotated(tip[:3, :3] @ poses[0][:3, :3].T, poses[0][:3, 3] - poses[1][:3, 3])
        path = platform.arms.drawn(arm, (share * back for share in SHARES), what)
        with suppress(ManipulationGoalInCollision):
            if path is not None:
                await self.follow_to_end(arm.name, path, what)
        room = platform.drive.room_for(platform.arms.untucked(), least=BACK)
        if room is not None:
            with suppress(NavigationFailure):
                await self.drive(room)
        await self.tuck(platform.arms.untucked())
