"""Motions of a hand to and from fixed parts: handles, buttons and knobs."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Sequence
from contextlib import suppress

from executive.belief.scene_collisions import BasePose
from executive.modules.platform import PlatformModule
from executive.modules.runner import Skill
from executive.motion import MotionError
from executive.robots.arms import ArmModel
from planlang.designators import Action
from planlang.failures import (
    BehindClosedDoor,
    DesignatorFailure,
    HandleNotReachable,
    HandsFull,
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationGoalNotReached,
    ManipulationPoseUnreachable,
    NavigationFailure,
    PerceptionFailure,
)
from planlang.geometry import Array
from planlang.geometry.matrices import rotated
from planlang.protocols import Trajectory

FEW = 200
"""Iterations of an arm's path search; few, because there are other grips, and base poses with more room, to try."""
VIEWS = 4
"""Most base poses from which to look at a thing."""
SHARES = (1.0, 0.5, 0.25)
"""Shares of the approach to try for the retreat: the full length may be beyond the arm's reach."""
BACK = 0.2
"""Least distance that the base backs off before the arm is tucked: close to furniture there is little room [m]."""


class HandWork(PlatformModule):
    """Base of the process modules that work with hands and drive. Hands may touch the body ``what``."""

    failures: Sequence[type[Exception]] = (
        ManipulationFailure,
        NavigationFailure,
        PerceptionFailure,
        LookingFailure,
        DesignatorFailure,
    )

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the whole robot, unless fewer parts are needed."""
        return self.needs or self.whole_robot()

    def free_hands(self) -> list[ArmModel]:
        """List the empty arms that have a gripper."""
        return self.platform.arms.free(self.platform.scene.arms.hands)

    def hands_for(
        self,
        part: str,
        what: str,
        failure: type[HandleNotReachable | ManipulationGoalNotReached] = HandleNotReachable,
    ) -> list[ArmModel]:
        """List the empty hands, one of which is to work on a ``part`` of ``what``.

        Raises HandsFull if all hold something, and ``failure`` if there is no hand.
        """
        free, scene = self.free_hands(), self.platform.scene
        if free:
            return free
        holding = {arm.name: held.name for arm in scene.arms.all if (held := scene.arms.held(arm.name)) is not None}
        if not holding:
            raise failure(f"no arm of the robot has a hand for {part}", what=what)
        full = {arm: scene.bodies.designator(name) for arm, name in holding.items()}
        raise HandsFull(designator=f"a hand at {part}", what=part, held=full)

    async def look(self, what: str) -> None:
        """Look at a body, if the neck can, and update the belief."""
        with suppress(LookingFailure):
            await self.platform.sensing.look_at(self.platform.scene.bodies.block(what).centre, what)
            self.platform.sensing.shows_here(lambda seen: what in seen)

    async def seen_from(
        self,
        bases: Callable[[], Iterable[BasePose]],
        drive: Callable[[BasePose], Awaitable[object]],
        look: Callable[[], Awaitable[bool]],
    ) -> bool:
        """Drive to base poses until a look succeeds; return whether one did.

        Raises BehindClosedDoor if a door between rooms keeps the base from all of them.
        """

        async def contact(_: BasePose) -> None:
            if not await look():
                raise LookingFailure

        failures = (NavigationFailure, LookingFailure)
        try:
            await Skill(bases, contact, drive, failures=failures, most=VIEWS).run()
        except BehindClosedDoor:
            raise  # once the door is open there are such poses
        except (DesignatorFailure, ManipulationPoseUnreachable, *failures):
            return False
        return True

    async def tuck(self) -> None:
        """Move the arms to their carrying postures, where a path is found."""
        for arm, posture in self.platform.arms.untucked():
            with suppress(MotionError):
                await self.platform.follow(arm.name, self.platform.arms.path(arm, posture, iterations=FEW))

    async def close_hand(self, arm: ArmModel) -> None:
        """Tuck the arms, and close a hand to push with it."""
        await self.tuck()
        await self.platform.hands.move(arm, closed=True)
        self.platform.arms.choices.choose(arm.name)

    def planned(self, arm: ArmModel, goal: Array, what: str | None) -> Trajectory:
        """Plan a path of an arm to joint positions (d,). Raises ManipulationPoseUnreachable."""
        try:
            return self.platform.arms.path(arm, goal, what, FEW)
        except MotionError as problem:
            raise ManipulationPoseUnreachable(arm=arm.name, what=what) from problem

    async def straight(self, arm: ArmModel, pose: Array, touches: str | None, label: str | None = None) -> None:
        """Move the tip along a straight line to a map pose (4, 4). Raises a ManipulationFailure.

        ``label`` says in the failure where the hand goes; by default it goes to the body that it ``touches``.
        """
        what = label or touches
        try:
            trajectory = self.platform.arms.straight_path(arm, pose, touches)
        except MotionError as problem:
            raise ManipulationPoseUnreachable(arm=arm.name, what=what) from problem
        await self.follow_to_end(arm.name, trajectory, what)

    async def back(self, arm: ArmModel, poses: Array, what: str | None) -> None:
        """Retreat against the approach ``poses`` (2, 4, 4), back off with the base, and tuck the arms if possible."""
        platform = self.platform
        tip = platform.scene.arms.tip(arm)
        # The part may have turned since the approach; the retreat turns with the hand.
        back = rotated(tip[:3, :3] @ poses[0][:3, :3].T, poses[0][:3, 3] - poses[1][:3, 3])
        path = platform.arms.drawn(arm, (share * back for share in SHARES), what)
        with suppress(ManipulationGoalInCollision, ManipulationGoalNotReached):
            if path is not None:
                await self.follow_to_end(arm.name, path, what)
        with suppress(NavigationFailure):
            await self.back_off(platform.arms.untucked(), BACK)
        await self.tuck()

    async def back_off(self, postures: Sequence[tuple[ArmModel, Array]], least: float) -> bool:
        """Back off with the base by at least ``least`` [m], to room for arms in postures (d,); False without room."""
        room = self.platform.standing().with_room_for(postures, least)
        if room is not None:
            await self.drive(room)
        return room is not None
