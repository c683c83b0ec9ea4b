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
from executive.modules.furniture.witnessing import is_witnessed
from executive.modules.tries import Tries
from executive.motion import time_curve, time_path
from executive.robots.arms import ArmModel
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
    StateUnknown,
)
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved
from planlang.kernel import checkpoint
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
FELT = 0.01
"""Accuracy with which fingers feel where a handle is [m]."""
FELT_BY = 0.15
"""Share of its range by which a hand at the handle should be able to move a leaf that it only feels."""
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
        """Open or close a leaf; return its name. Raises ContainerStuck, HandleNotReachable or StateUnknown."""
        await is_witnessed(self, joint.leaf, drives=False)
        for _ in range(PLACES):
            if await self._is_surely_done(joint, opens):
                if opens and self._covers_something(joint):
                    await self._farther(joint)
                return joint.leaf
            goal, sufficient = (joint.upper, joint.first_open) if opens else (0.0, joint.last_shut)
            await self._from_one_place(joint, goal, sufficient)
        if await self._is_surely_done(joint, opens):
            return joint.leaf
        at = f"{joint.leaf} is only at {self._value(joint):.2f} after motions from {PLACES} base poses"
        raise ContainerStuck(at, what=joint.leaf)

    def _value(self, joint: Articulation) -> float:
        return self.platform.belief.joint(joint.leaf)

    async def _is_surely_done(self, joint: Articulation, opens: bool) -> bool:
        """Check whether a leaf is as open or closed as asked for; if only the map says so, look at it or feel it."""
        if self._is_done(joint, opens) and not await is_witnessed(self, joint.leaf):
            await self._feel(joint)
        return self._is_done(joint, opens)

    def _is_done(self, joint: Articulation, opens: bool) -> bool:
        value = self._value(joint)
        return joint.is_open(value) if opens else joint.is_shut(value)

    async def _feel(self, joint: Articulation) -> None:
        """Close a hand on the handle of a leaf that cannot be seen, and believe what it feels. Raises StateUnknown."""
        value, unknown = self._value(joint), f"it is not known how far {joint.leaf} is open: it was not seen"
        if joint.handle is None or joint.is_knob:
            raise StateUnknown(f"{unknown}, and has no handle to feel", what=joint.leaf)
        aside = joint.upper * (FELT_BY if value < joint.upper / 2 else -FELT_BY)
        try:
            await self._from_one_place(joint, value + aside, value + aside, leads=False)
        except (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure) as failure:
            raise StateUnknown(f"{unknown}, and no hand felt its handle", what=joint.leaf) from failure

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
            await self._from_one_place(joint, joint.upper, joint.upper)

    async def _from_one_place(self, joint: Articulation, goal: float, sufficient: float, *, leads: bool = True) -> None:
        """Move the leaf as far as one base pose allows. Raises HandleNotReachable if no path can be executed.

        ``sufficient``: value that the leaf should reach at least. Without ``leads``, only feel where its handle is.
        """
        if joint.handle is None:
            no_handle = f"{joint.leaf} has no handle; state one in the map as a part of it (properPhysicalParts)"
            raise HandleNotReachable(f"{HandleNotReachable.text}: {no_handle} of the class Handle", what=joint.leaf)
        arms = self.hands_for(joint.handle, joint.leaf)
        await self.tuck(self.platform.arms.untucked())
        tries, tried = Tries(*ELSEWHERE), 0
        paths = leaf_paths.LeafPaths(self.platform.scene, joint)
        for path in paths.towards(goal, arms, sufficient):
            if path is None:
                await checkpoint()
                continue
            with tries:
                return await self._along(path, joint, leads=leads)
            await self.tuck(self.platform.arms.untucked())
            if (tried := tried + 1) == WAYS:
                break
        message = f"the handle of {joint.leaf} is out of reach: {ways_tried(tried)}"
        cause = tries.problem or leaf_failures.leaf_failure(paths, joint, self.platform.scene)
        raise HandleNotReachable(message, what=joint.leaf) from cause

    async def _along(self, path: LeafPath, joint: Articulation, *, leads: bool) -> None:
        """Drive to the path's base pose, grasp the handle, move the leaf, release the handle, and look at the leaf."""
        platform, arm, before = self.platform, path.arm, self._value(joint)
        await self.drive(path.base)
        await is_witnessed(self, joint.leaf, drives=False)
        if abs(self._value(joint) - path.values[0]) > 1e-9:
            return  # the leaf is not where it was believed to be: the caller searches for a new path
        platform.arms.choices.choose(arm.name)
        await platform.hands.move(arm, closed=False, fingers=path.fingers)
        await self.follow_to_end(arm.name, self.planned(arm, path.before, None), joint.handle)
        await self.straight(arm, path.poses[1], joint.handle)
        problem: ManipulationFailure | ContainerStuck | None = None
        is_as_believed = False
        try:
            await platform.hands.move(arm, closed=True)
            if not platform.hands.is_on(arm, joint.handle or joint.leaf):
                raise GraspMissed(arm=arm.name, what=joint.handle)
            is_as_believed = self._feels_as_believed(arm, joint)
            if leads and is_as_believed:
                await self._lead(path, joint)
        except (ManipulationFailure, ContainerStuck) as failure:
            problem = failure
        await platform.hands.move(arm, closed=False, fingers=path.fingers)
        await self.back(arm, path.poses, joint.handle)
        if leads and await self._is_elsewhere(joint, problem, before):
            return
        if problem is not None:
            raise problem
        if leads and is_as_believed and abs(self._value(joint) - before) < NO_FURTHER * joint.upper:
            raise ContainerStuck(what=joint.leaf)

    async def _is_elsewhere(self, joint: Articulation, problem: Exception | None, before: float) -> bool:
        """Look at a leaf after a motion; return whether a grasp missed it because it is not where it was believed."""
        if isinstance(problem, GraspMissed):
            return await is_witnessed(self, joint.leaf) and self._value(joint) != before
        belief = self.platform.belief
        belief.doubted(joint.leaf)
        if not await is_witnessed(self, joint.leaf, drives=False) and not isinstance(problem, GraspSlipped):
            belief.touched(joint.leaf, self._value(joint))  # what the hand felt
        return False

    def _feels_as_believed(self, arm: ArmModel, joint: Articulation) -> bool:
        """Believe of a leaf that was not seen what fingers feel at its handle; return whether it was believed there."""
        platform, value = self.platform, self._value(joint)
        point = platform.between_fingers(arm.name)
        if point is None or joint.handle is None or joint.is_knob or platform.belief.witnessed(joint.leaf):
            return True
        closed = np.array(platform.scene.world.scene.body(joint.handle).pose.position)
        there = joint.value_at(closed, point)
        is_as_believed = abs(there - value) * self._lever(joint, closed) <= FELT
        platform.belief.touched(joint.leaf, value if is_as_believed else there)
        return is_as_believed

    def _lever(self, joint: Articulation, closed: Array) -> float:
        """Compute how far a handle at a point (3,) moves per unit of its joint [m/rad, m/m]."""
        if joint.kind is JointKind.PRISMATIC:
            return 1.0
        return float(np.linalg.norm(np.cross(joint.axis, closed - joint.point)))

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
    # beside those of looking, which LookingFirst declares for all modules

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the whole robot."""
        return self.whole_robot()

    async def execute(self, action: Action) -> str:
        """Open or close ``object_acted_on``; return the name of the door, drawer or lid.

        Furniture is open when one of its leaves is, the nearest that is closed, and closed when all of them are.
        """
        what = action.get("object_acted_on")
        if not isinstance(what, Object):
            raise ActionUnresolvable("name the object to open or close as object_acted_on", designator=str(action))
        opens = "OpeningAContainerArtifact" in self.platform.ancestors(action.type)
        leaves = self.platform.scene.bodies.leaves_of(what, shut=opens)
        if not leaves:
            raise ActionUnresolvable(f"{what} has no door, drawer or lid", designator=str(action))
        for joint in leaves[: 1 if opens else len(leaves)]:
            await self.moved(joint, opens)
        return leaves[0].leaf
