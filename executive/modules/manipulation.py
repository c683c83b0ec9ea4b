"""The process modules of arms, grippers and handovers.

Arms go to named postures, before things, around them, over them, and to people; a handover waits until the person takes
what an arm holds.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from executive.locations import HandSolution, ReachKind
from executive.locations.demands import asks_for
from executive.modules.platform import Platform
from executive.motion import MotionError
from executive.robots.arms import ArmModel
from planlang import perform, wait_for
from planlang.designators import Action, Device, Location, Object, Person, Relation, action
from planlang.failures import (
    ActionUnresolvable,
    CommunicationFailure,
    DesignatorFailure,
    GraspMissed,
    GripperFailure,
    GripperGoalNotReached,
    HandoverNotTaken,
    LocationUnresolvable,
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    MissingCapability,
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
