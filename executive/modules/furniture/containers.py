"""The process module that opens and closes doors, drawers and lids with a hand on their handle.

It drives to where the arm can move the leaf along its way, takes the handle, goes with the leaf, and lets it go; what
one place does not do is gone on with from another.
"""

from __future__ import annotations

from contextlib import suppress
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from executive.locations.taking_out import way_out
from executive.modules.arm.hand_work import HandWork
from executive.modules.furniture import leaf_failures, leaf_paths
from executive.modules.tries import Tries
from executive.motion import time_curve, time_path
from executive.robots.arms import ArmModel
from planlang import checkpoint
from planlang.designators import Action, Object
from planlang.failures import (
    ActionUnresolvable,
    ContainerStuck,
    DesignatorFailure,
    EnvironmentManipulationFailure,
    GraspMissed,
    GraspSlipped,
    HandleNotReachable,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    NavigationFailure,
)
from planlang.geometry import Pose
from planlang.geometry.matrices import moved
from planlang.language.process_module import process_module
from planlang.protocols import Configuration, MotionState, Trajectory
from sim.joints import Articulation, JointKind

if TYPE_CHECKING:
    from executive.modules.furniture.leaf_paths import LeafPath

PLACES = 6
"""Places of the base from which a leaf is moved, one after another."""
ELSEWHERE = (ManipulationPoseUnreachable, ManipulationGoalInCollision, GraspMissed, NavigationFailure)
"""Failures after which another way is tried."""
WAYS = 4
"""Ways that are tried when the first cannot be gone: others differ little."""
STRAY = 0.01
"""Largest distance of the hand from the way of the handle [m]."""
SHORTER = (0, 1, 2, 4)
"""Steps at its end that are left out of a way that cannot be gone to there."""
AT_ITS_END = 0.9
"""Share of its range from which on a drawer is open as far as it is worth to drive for."""
NO_FURTHER = 0.02
"""Share of its range by which a leaf has to move that is not stuck."""


def ways_tried(count: int) -> str:
    """Return how many ways of a hand were found and tried in vain, in words."""
    if count == 0:
        return "no way was found from any base pose that the base can drive to"
    return "the one way that was found failed" if count == 1 else f"{count} ways were tried and failed"


class LeafWork(HandWork):
    """Moves doors, drawers, lids and knobs by their handles."""

    async def moved(self, joint: Articulation, opens: bool) -> str:
        """Open or close a leaf; return its name, or raise ContainerStuck or HandleNotReachable."""
        for _ in range(PLACES):
            if self._is_done(joint, opens):
                if opens and self._covers_something(joint):
                    await self._farther(joint)
                return joint.leaf
            await self._from_one_place(joint, opens)
        if self._is_done(joint, opens):
            return joint.leaf
        raise ContainerStuck(f"{joint.leaf} is at {self._value(joint):.2f} after {PLACES} places", what=joint.leaf)

    def _value(self, joint: Articulation) -> float:
        return self.platform.belief.joint(joint.leaf)

    def _is_done(self, joint: Articulation, opens: bool) -> bool:
        value = self._value(joint)
        return joint.is_open(value) if opens else joint.is_shut(value)

    def _covers_something(self, joint: Articulation) -> bool:
        """Return whether an open drawer goes farther, and something in it cannot be lifted straight out as it is."""
        scene = self.platform.scene
        if joint.kind is not JointKind.PRISMATIC or self._value(joint) > AT_ITS_END * joint.upper:
            return False
        things = [name for name in scene.bodies.names() if scene.bodies.is_graspable(name)]
        inside = (name for name in things if scene.bodies.drawer_of(name) == joint)
        ways = (way_out(name, scene) for name in inside)
        return any(way is None or len(way) > 1 for way in ways)

    async def _farther(self, joint: Articulation) -> None:
        """Open a drawer on from another place of the base, if there is one: what lies at its back is covered."""
        with suppress(ManipulationFailure, NavigationFailure, EnvironmentManipulationFailure):
            await self._from_one_place(joint, opens=True, wanted=joint.upper)

    async def _from_one_place(self, joint: Articulation, opens: bool, wanted: float | None = None) -> None:
        """Move the leaf as far as one place of the base allows; raises a failure if no way can be gone.

        ``wanted``: the value up to which it is to go, if not until it counts as open or closed.
        """
        arms = self.free_hands()
        if joint.handle is None or not arms:
            missing = f"{joint.leaf} has no handle, which is a part of it (properPhysicalParts) of the class Handle"
            lacks = "no hand is free" if joint.handle else missing
            raise HandleNotReachable(f"{HandleNotReachable.text}: {lacks}", what=joint.leaf)
        await self.tuck(self.platform.arms.untucked())
        goal, least = (joint.upper, joint.first_open) if opens else (0.0, joint.last_shut)
        tries, tried = Tries(*ELSEWHERE), 0
        paths = leaf_paths.LeafPaths(self.platform, joint)
        for path in paths.towards(goal, arms, least if wanted is None else wanted):
            if path is None:
                await checkpoint()
                continue
            with tries:
                return await self._along(path, joint)
            await self.tuck(self.platform.arms.untucked())
            if (tried := tried + 1) == WAYS:
                break
        said = f"the handle of {joint.leaf} is out of reach: {ways_tried(tried)}"
        reason = tries.problem or leaf_failures.leaf_failure(paths, joint, self.platform.scene)
        raise HandleNotReachable(said, what=joint.leaf) from reason

    async def _along(self, path: LeafPath, joint: Articulation) -> None:
        """Drive there, take the handle, go with the leaf, let it go."""
        platform, arm, before = self.platform, path.arm, self._value(joint)
        await self.drive(path.base)
        await self.look(joint.handle or joint.leaf)
        if abs(self._value(joint) - path.values[0]) > 1e-9:
            return  # it is not where it was believed to be: its way has to be looked for again
        platform.arms.choices.choose(arm.name)
        await platform.hands.move(arm, closed=False, fingers=path.fingers)
        await self.follow_to_end(arm.name, self.planned(arm, path.before, None), joint.handle)
        await self.straight(arm, path.poses[1], path.joints[0], joint.handle)
        problem: ManipulationFailure | ContainerStuck | None = None
        try:
            await platform.hands.move(arm, closed=True)
            if not platform.hands.is_on(arm, joint.handle or joint.leaf):
                raise GraspMissed(arm=arm.name, what=joint.handle)
            await self._lead(path, joint)
        except (ManipulationFailure, ContainerStuck) as failure:
            problem = failure
        await platform.hands.move(arm, closed=False, fingers=path.fingers)
        await self.back(arm, path.poses, joint.handle)
        if problem is not None:
            raise problem
        if abs(self._value(joint) - before) < NO_FURTHER * joint.upper:
            raise ContainerStuck(what=joint.leaf)

    async def _lead(self, path: LeafPath, joint: Articulation) -> None:
        """Move the hand with the leaf; what the hand feels is where the leaf is."""
        platform, arm = self.platform, path.arm
        platform.hands.lead(arm, joint.leaf)
        motion = await platform.follow(arm.name, self._timed(path, joint))
        if joint.leaf not in platform.belief.led:  # the fingers feel it no more
            raise GraspSlipped(arm=arm.name, what=joint.handle)
        if motion.state is not MotionState.DONE:
            await platform.sensing.bump(motion)
            in_the_way = "" if motion.blocked_by is None else f" by {motion.blocked_by}"
            raise ContainerStuck(f"{joint.leaf} is stopped{in_the_way}", what=joint.leaf)

    def _timed(self, path: LeafPath, joint: Articulation) -> Trajectory:
        """Return the way of the arm with times; the hand stays on the way of the handle between its postures, too."""
        platform, arm = self.platform, path.arm
        now = platform.arm_joints(arm)
        whole_turns = 2 * np.pi * np.round((now - path.joints[1]) / (2 * np.pi))  # of joints that turn without end
        rows = np.concatenate([now[None], path.joints[1:] + whole_turns])
        for left_out, timing in product(SHORTER, (time_curve, time_path)):
            trajectory = platform.timed(arm.joints, rows[: max(2, len(rows) - left_out)], timing)
            within = arm.solver.chain.within(trajectory.positions, 1e-6).all()
            if within and self._stray(path, trajectory) < STRAY and self._is_free(arm, trajectory):
                return trajectory
        raise ManipulationPoseUnreachable(arm=arm.name, what=joint.handle)

    def _is_free(self, arm: ArmModel, trajectory: Trajectory) -> bool:
        """Return whether nothing is in the way of the arm and of the leaf behind it."""
        world, base = self.platform.scene.world, self.platform.base()
        rows = (dict(zip(arm.joints, row, strict=True)) for row in trajectory.positions.tolist())
        return not any(world.contacts(Configuration(base, row)) for row in rows)

    def _stray(self, path: LeafPath, trajectory: Trajectory) -> float:
        """Return the largest distance of the tip from the way of the handle [m]."""
        tips = moved(Pose.planar(*path.base).matrix(), path.arm.solver.chain.fk(trajectory.positions)[:, :3, 3])
        line = path.poses[1:, :3, 3]
        starts, ways = line[:-1], np.diff(line, axis=0)
        shares = np.einsum("nmk,mk->nm", tips[:, None] - starts[None], ways) / np.maximum((ways**2).sum(axis=1), 1e-12)
        nearest = starts[None] + np.clip(shares, 0.0, 1.0)[..., None] * ways[None]
        return float(np.linalg.norm(tips[:, None] - nearest, axis=2).min(axis=1).max())


@process_module
class Containers(LeafWork):
    """Opens and closes doors, drawers and lids."""

    name = "container"
    actions = ("OpeningAContainerArtifact", "ClosingAContainerArtifact")
    failures = (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure, DesignatorFailure)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the whole robot."""
        return self.whole_robot()

    async def execute(self, action: Action) -> str:
        """Open or close ``object_acted_on``; return the name of the door, drawer or lid."""
        what = action.get("object_acted_on")
        if not isinstance(what, Object):
            raise ActionUnresolvable("opening and closing need object_acted_on", designator=str(action))
        opens = "OpeningAContainerArtifact" in self.platform.ancestors(action.type)
        joint = self.platform.scene.bodies.leaf_of(what, shut=opens)
        if joint is None:
            raise ActionUnresolvable(f"{what} has no door, drawer or lid", designator=str(action))
        return await self.moved(joint, opens)
