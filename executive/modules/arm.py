"""Moves an arm: to named postures, before things, around them, over them, and to people."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from executive.locations import ReachSolution
from executive.modules.platform import Platform
from executive.motion import MotionError
from executive.robots.arms import ArmModel
from planlang import perform
from planlang.designators import Action, Device, Location, Object, Relation, action
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    LocationUnresolvable,
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    PerceptionFailure,
)
from planlang.geometry import Array
from planlang.protocols import Trajectory

MOST_WAYS = 6
"""Hand poses for one location that a path is looked for before giving up."""


class Reaching:
    """Brings a hand to a location; looks first at things that were not seen since the base last moved."""

    name = "arm"
    actions = ("Reaching",)
    failures = (ManipulationFailure, PerceptionFailure, LookingFailure, DesignatorFailure)

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """The arms that the action may mean, and the torso if it moves with them."""
        arms = self._arms(action)
        torso = [] if all(self.platform.robot.torso not in arm.joints for arm in arms) else ["torso"]
        return (*(arm.name for arm in arms), *torso)

    async def execute(self, action: Action) -> None:
        """Reach; raises what the failure classes say."""
        location = action.get("to_location")
        if not isinstance(location, Location):
            raise ActionUnresolvable("reaching needs to_location", designator=str(action))
        arms = self._arms(action)
        if not arms:
            raise ActionUnresolvable("the robot has no arm that this may mean", designator=str(action))
        if not location.relations:
            await self._to_posture(arms[0], location.name or "")
            return
        await self._look_first(location)
        problem: ManipulationFailure | LocationUnresolvable | None = None
        for arm in arms:
            try:
                await self._reach(arm, location)
                return
            except (ManipulationPoseUnreachable, LocationUnresolvable) as failure:
                problem = problem or failure
        if isinstance(problem, LocationUnresolvable):
            blocking = next(iter(problem.blocking), None)
            kind = ManipulationGoalInCollision if blocking else ManipulationPoseUnreachable
            raise kind(arm=arms[0].name, what=str(location), blocked_by=blocking) from problem
        raise problem or ManipulationPoseUnreachable(arm=arms[0].name, what=str(location))

    def _arms(self, action: Action) -> list[ArmModel]:
        """Its device's arm; else the arm that holds something; else the one chosen in this branch; else all.

        Of several that may be meant one that is free takes hold of a thing, one that holds something reaches for a
        person.
        """
        platform = self.platform
        device, location = action.get("device_used"), action.get("to_location")
        named = platform.scene.arms.of(device) if isinstance(device, Device) else platform.scene.arms.all
        if isinstance(location, Location) and platform.resolver.is_grasp(location) and (free := platform.free(named)):
            return free
        if isinstance(device, Device):
            meant = platform.in_order(named)
            offering = (
                [arm for arm in meant if platform.scene.arms.held(arm.name)] if self._is_for_person(action) else []
            )
            return offering or meant
        return platform.holding(platform.scene.arms.all) or platform.in_order(platform.scene.arms.all)

    def _is_for_person(self, action: Action) -> bool:
        """Whether the hand is to go to where a person reaches it."""
        location, scene = action.get("to_location"), self.platform.scene
        return isinstance(location, Location) and any(
            isinstance(relation.reference, Object) and scene.bodies.is_person(scene.bodies.bind(relation.reference))
            for relation in location.relations
        )

    async def _look_first(self, location: Location) -> None:
        for relation in location.relations:
            match relation:
                case Relation(_, Object() as what) if self.platform.must_look(what):
                    await perform(action("LookingForSomething", object_acted_on=what))

    async def _to_posture(self, arm: ArmModel, name: str) -> None:
        goal = self.platform.posture(arm, name)
        await self._joint_path(arm, goal, None, name)

    async def _reach(self, arm: ArmModel, location: Location) -> None:
        """Try ways to satisfy the location until one has a path."""
        problem: ManipulationPoseUnreachable | None = None
        platform = self.platform
        for way in islice(self._ways(arm, location), MOST_WAYS):
            try:
                await self._take(way, location)
            except ManipulationPoseUnreachable as failure:
                problem = problem or failure
                continue
            platform.use(arm, way)
            return
        raise problem or ManipulationPoseUnreachable(arm=arm.name, what=str(location))

    def _ways(self, arm: ArmModel, location: Location) -> Iterator[ReachSolution]:
        """The way that was begun first: a grasp goes on with the pre-grasp that was taken; then all others."""
        begun = self.platform.begun(arm, location)
        if begun is not None:
            yield begun
        yield from self.platform.resolver.hands(location, arm, self.platform.arm_joints(arm))

    async def _take(self, way: ReachSolution, location: Location) -> None:
        match way.reach.kind:
            case "retreat":
                await self._straight(way, way.joints)
            case "grasp" if any(relation.name == "in_center_of" for relation in location.relations):
                if not self.platform.is_at(way.arm, way.joints[0]):
                    await self._joint_path(way.arm, way.joints[0], None, way.plan.label)
                await self._straight(way, way.joints[1:2])
            case _:
                await self._joint_path(way.arm, way.joints[0], None, way.plan.label)

    async def _joint_path(self, arm: ArmModel, goal: Array, touches: str | None, label: str) -> None:
        try:
            trajectory = self.platform.arm_path(arm, goal, touches)
        except MotionError as problem:
            raise ManipulationPoseUnreachable(arm=arm.name, what=label) from problem
        await self._follow(arm, trajectory, label)

    async def _straight(self, way: ReachSolution, joints: Array) -> None:
        """Along straight lines of the tip to the last poses of a plan."""
        poses = way.plan.poses[-len(joints) :] if way.reach.kind == "retreat" else way.plan.poses[1 : 1 + len(joints)]
        for pose, q in zip(poses, joints, strict=True):
            try:
                trajectory = self.platform.straight_path(way.arm, pose, q, way.plan.touches)
            except MotionError as problem:
                raise ManipulationPoseUnreachable(arm=way.arm.name, what=way.plan.label) from problem
            await self._follow(way.arm, trajectory, way.plan.label)

    async def _follow(self, arm: ArmModel, trajectory: Trajectory, label: str) -> None:
        motion = await self.platform.follow(arm.name, trajectory)
        if motion.state != "done":
            self.platform.bump(motion.blocked_by)
            raise ManipulationGoalInCollision(arm=arm.name, what=label, blocked_by=motion.blocked_by)
