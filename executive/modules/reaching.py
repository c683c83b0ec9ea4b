"""The process module of arms: to named postures, before things, around them, over them, and to people."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from executive.locations import HandSolution, ReachKind
from executive.locations.demands import asks_for
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
from planlang.modules import process_module
from planlang.protocols import MotionState, Trajectory
from planlang.relations import Sense

MOST_SOLUTIONS = 6
"""Hand poses of one location for which a path is planned: further ones differ little and fail alike."""


@process_module
class Reaching:
    """Brings a hand to a location, after a look at things not seen since the base last moved."""

    name = "arm"
    actions = ("Reaching",)
    failures = (ManipulationFailure, PerceptionFailure, LookingFailure, DesignatorFailure)

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the arms that the action may mean, and the torso if it moves with them."""
        arms = self._arms(action)
        torso = [] if all(self.platform.robot.torso not in arm.joints for arm in arms) else ["torso"]
        return (*(arm.name for arm in arms), *torso)

    async def execute(self, action: Action) -> None:
        """Reach; raises a failure of the classes in ``failures``."""
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
        """Return the arms to try: of the device; else one that holds something; else the one chosen before; else all.

        To grasp, free arms come first; to reach a person, arms that hold something.
        """
        scene, arms = self.platform.scene, self.platform.arms
        device, location = action.get("device_used"), action.get("to_location")
        named = scene.arms.of(device) if isinstance(device, Device) else scene.arms.all
        if isinstance(location, Location) and self.platform.resolver.is_grasp(location) and (free := arms.free(named)):
            return free
        if isinstance(device, Device):
            meant = arms.in_order(named)
            offering = [arm for arm in meant if scene.arms.held(arm.name)] if self._is_for_person(action) else []
            return offering or meant
        return arms.holding(scene.arms.all) or arms.in_order(scene.arms.all)

    def _is_for_person(self, action: Action) -> bool:
        """Return whether the hand is to go to where a person reaches it."""
        location, scene = action.get("to_location"), self.platform.scene
        return isinstance(location, Location) and any(
            isinstance(relation.reference, Object) and scene.bodies.is_person(scene.bodies.bind(relation.reference))
            for relation in location.relations
        )

    async def _look_first(self, location: Location) -> None:
        for relation in location.relations:
            match relation:
                case Relation(_, Object() as what) if self.platform.sensing.must_look(what):
                    await perform(action("LookingForSomething", object_acted_on=what))

    async def _to_posture(self, arm: ArmModel, name: str) -> None:
        await self._joint_path(arm, self.platform.arms.posture(arm, name), None, name)

    async def _reach(self, arm: ArmModel, location: Location) -> None:
        """Try hand poses that satisfy the location until one has a path."""
        problem: ManipulationPoseUnreachable | None = None
        for solution in islice(self._solutions(arm, location), MOST_SOLUTIONS):
            try:
                await self._go(solution, location)
            except ManipulationPoseUnreachable as failure:
                problem = problem or failure
                continue
            self.platform.arms.use(arm, solution)
            return
        raise problem or ManipulationPoseUnreachable(arm=arm.name, what=str(location))

    def _solutions(self, arm: ArmModel, location: Location) -> Iterator[HandSolution]:
        """Yield the grasp that was begun, so that it goes on from its pre-grasp; then all others."""
        begun = self.platform.arms.begun_grasp(arm, location)
        if begun is not None:
            yield begun
        yield from self.platform.resolver.hands(location, arm, self.platform.arm_joints(arm))

    async def _go(self, solution: HandSolution, location: Location) -> None:
        match solution.reach.kind:
            case ReachKind.RETREAT:
                await self._straight(solution, solution.joints)
            case ReachKind.GRASP if asks_for(location, "hand", Sense.GRASP_POINT):
                if not self.platform.arms.is_at(solution.arm, solution.joints[0]):
                    await self._joint_path(solution.arm, solution.joints[0], None, solution.plan.label)
                await self._straight(solution, solution.joints[1:2])
            case _:
                await self._joint_path(solution.arm, solution.joints[0], None, solution.plan.label)

    async def _joint_path(self, arm: ArmModel, goal: Array, touches: str | None, label: str) -> None:
        try:
            trajectory = self.platform.arms.path(arm, goal, touches)
        except MotionError as problem:
            raise ManipulationPoseUnreachable(arm=arm.name, what=label) from problem
        await self._follow(arm, trajectory, label)

    async def _straight(self, solution: HandSolution, joints: Array) -> None:
        """Move along straight lines of the tip to the last poses of a solution."""
        poses = (
            solution.plan.poses[-len(joints) :]
            if solution.reach.kind is ReachKind.RETREAT
            else solution.plan.poses[1 : 1 + len(joints)]
        )
        for pose, q in zip(poses, joints, strict=True):
            try:
                trajectory = self.platform.arms.straight_path(solution.arm, pose, q, solution.plan.touches)
            except MotionError as problem:
                raise ManipulationPoseUnreachable(arm=solution.arm.name, what=solution.plan.label) from problem
            await self._follow(solution.arm, trajectory, solution.plan.label)

    async def _follow(self, arm: ArmModel, trajectory: Trajectory, label: str) -> None:
        motion = await self.platform.follow(arm.name, trajectory)
        if motion.state is not MotionState.DONE:
            self.platform.sensing.bump(motion.blocked_by)
            raise ManipulationGoalInCollision(arm=arm.name, what=label, blocked_by=motion.blocked_by)
