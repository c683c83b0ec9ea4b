"""Process module that opens and closes doors, drawers and lids by their handles.

The base drives to where the arm can move the leaf; the hand grasps the handle, moves with the leaf, and releases it. If
one base pose is not enough, the motion is continued from another.
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
"""Most base poses from which to move one leaf, one after another."""
ELSEWHERE = (ManipulationPoseUnreachable, ManipulationGoalInCollision, GraspMissed, NavigationFailure)
"""Failures after which another path is tried."""
WAYS = 4
"""Most paths to try; more differ little."""
STRAY = 0.01
"""Largest distance of the hand from the handle's path [m]."""
SHORTER = (0, 1, 2, 4)
"""Numbers of steps to cut off the end of a path whose timing fails."""
AT_ITS_END = 0.9
"""Share of its range above which opening a drawer farther is not worth another drive."""
NO_FURTHER = 0.02
"""Share of its range by which a leaf must move so that it does not count as stuck."""


def ways_tried(count: int) -> str:
    """Describe how many paths of a hand were tried in vain."""
    if count == 0:
        return "no way was found from any base pose that the base can drive to"
    return "the one way that was found failed" if count == 1 else f"{count} ways were tried and failed"


class LeafWork(HandWork):
    """Moves doors, drawers, lids and knobs by their handles."""

    async def moved(self, joint: Articulation, opens: bool) -> str:
        """Open or close a leaf; return its name. Raises ContainerStuck or HandleNotReachable."""
        for _ in range(PLACES):
            if self._is_done(joint, opens):
                if opens and self._covers_something(joint):
                    await self._farther(joint)
                return joint.leaf
            await self._from_one_place(joint, opens)
        if self._is_done(joint, opens):
            return joint.leaf
        at = f"{joint.leaf} is only at {self._value(joint):.2f} after motions from {PLACES} base poses"
        raise ContainerStuck(at, what=joint.leaf)

    def _value(self, joint: Articulation) -> float:
        return self.platform.belief.joint(joint.leaf)

    def _is_done(self, joint: Articulation, opens: bool) -> bool:
        value = self._value(joint)
        return joint.is_open(value) if opens else joint.is_shut(value)

    def _covers_something(self, joint: Articulation) -> bool:
        """Check whether a drawer opens farther, and something in it cannot be lifted straight out as it is."""
        scene = self.platform.scene
        if joint.kind is not JointKind.PRISMATIC or self._value(joint) > AT_ITS_END * joint.upper:
            return False
        things = [name for name in scene.bodies.names() if scene.bodies.is_graspable(name)]
        inside = (name for name in things if scene.bodies.drawer_of(name) == joint)
        ways = (way_out(name, scene) for name in inside)
        return any(way is None or len(way) > 1 for way in ways)

    async def _farther(self, joint: Articulation) -> None:
        """Open a drawer farther from another base pose, if possible, to uncover what lies at its back."""
        with suppress(ManipulationFailure, NavigationFailure, EnvironmentManipulationFailure):
            await self._from_one_place(joint, opens=True, sufficient=joint.upper)

    async def _from_one_place(self, joint: Articulation, opens: bool, sufficient: float | None = None) -> None:
        """Move the leaf as far as one base pose allows. Raises HandleNotReachable if no path can be executed.

        ``sufficient``: value that the leaf should reach; by default the one at which it counts as open or closed.
        """
        arms = self.free_hands()
        if joint.handle is None or not arms:
            no_handle = f"{joint.leaf} has no handle; state one in the map as a part of it (properPhysicalParts)"
            reason = "no hand is free" if joint.handle else f"{no_handle} of the class Handle"
            raise HandleNotReachable(f"{HandleNotReachable.text}: {reason}", what=joint.leaf)
        await self.tuck(self.platform.arms.untucked())
        goal, least = (joint.upper, joint.first_open) if opens else (0.0, joint.last_shut)
        tries, tried = Tries(*ELSEWHERE), 0
        paths = leaf_paths.LeafPaths(self.platform, joint)
        for path in paths.towards(goal, arms, least if sufficient is None else sufficient):
            if path is None:
                await checkpoint()
                continue
            with tries:
                return await self._along(path, joint)
            await self.tuck(self.platform.arms.untucked())
            if (tried := tried + 1) == WAYS:
                break
        message = f"the handle of {joint.leaf} is out of reach: {ways_tried(tried)}"
        cause = tries.problem or leaf_failures.leaf_failure(paths, joint, self.platform.scene)
        raise HandleNotReachable(message, what=joint.leaf) from cause

    async def _along(self, path: LeafPath, joint: Articulation) -> None:
        """Drive to the path's base pose, grasp the handle, move the leaf, and release the handle."""
        platform, arm, before = self.platform, path.arm, self._value(joint)
        await self.drive(path.base)
        await self.look(joint.handle or joint.leaf)
        if abs(self._value(joint) - path.values[0]) > 1e-9:
            return  # the leaf is not where it was believed to be: the caller searches for a new path
        platform.arms.choices.choose(arm.name)
        await platform.hands.move(arm, closed=False, fingers=path.fingers)
        await self.follow_to_end(arm.name, self.planned(arm, path.before, None), joint.handle)
        await self.straight(arm, path.poses[1], joint.handle)
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
        """Move the hand with the leaf. Raises GraspSlipped, or ContainerStuck if something stops them."""
        platform, arm = self.platform, path.arm
        platform.hands.lead(arm, joint.leaf)
        motion = await platform.follow(arm.name, self._timed(path, joint))
        if joint.leaf not in platform.belief.led:  # the fingers no longer feel the handle
            raise GraspSlipped(arm=arm.name, what=joint.handle)
        if motion.state is not MotionState.DONE:
            await platform.sensing.bump(motion)
            by = "" if motion.blocked_by is None else f" by {motion.blocked_by}"
            raise ContainerStuck(f"{joint.leaf} is stopped{by}", what=joint.leaf)

    def _timed(self, path: LeafPath, joint: Articulation) -> Trajectory:
        """Time the arm's path so that the hand stays on the handle's path also between waypoints; shorten if needed.

        Raises ManipulationPoseUnreachable if no timing is free and within limits.
        """
        platform, arm = self.platform, path.arm
        start = platform.arm_joints(arm)
        whole_turns = 2 * np.pi * np.round((start - path.joints[1]) / (2 * np.pi))  # of continuous joints
        rows = np.concatenate([start[None], path.joints[1:] + whole_turns])
        for cut, timing in product(SHORTER, (time_curve, time_path)):
            trajectory = platform.timed(arm.joints, rows[: max(2, len(rows) - cut)], timing)
            within = arm.solver.chain.within(trajectory.positions, 1e-6).all()
            if within and self._stray(path, trajectory) < STRAY and self._is_free(arm, trajectory):
                return trajectory
        raise ManipulationPoseUnreachable(arm=arm.name, what=joint.handle)

    def _is_free(self, arm: ArmModel, trajectory: Trajectory) -> bool:
        """Check whether the arm and the leaf that moves with it are collision-free along a trajectory."""
        world, base = self.platform.scene.world, self.platform.base()
        rows = (dict(zip(arm.joints, row, strict=True)) for row in trajectory.positions.tolist())
        return not any(world.contacts(Configuration(base, row)) for row in rows)

    def _stray(self, path: LeafPath, trajectory: Trajectory) -> float:
        """Compute the largest distance of the tip from the polyline of the handle's path [m]."""
        tips = moved(Pose.planar(*path.base).matrix(), path.arm.solver.chain.fk(trajectory.positions)[:, :3, 3])
        line = path.poses[1:, :3, 3]
        starts, edges = line[:-1], np.diff(line, axis=0)
        lengths = np.maximum((edges**2).sum(axis=1), 1e-12)
        shares = np.einsum("nmk,mk->nm", tips[:, None] - starts[None], edges) / lengths
        nearest = starts[None] + np.clip(shares, 0.0, 1.0)[..., None] * edges[None]
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
            raise ActionUnresolvable("name the object to open or close as object_acted_on", designator=str(action))
        opens = "OpeningAContainerArtifact" in self.platform.ancestors(action.type)
        joint = self.platform.scene.bodies.leaf_of(what, shut=opens)
        if joint is None:
            raise ActionUnresolvable(f"{what} has no door, drawer or lid", designator=str(action))
        return await self.moved(joint, opens)
