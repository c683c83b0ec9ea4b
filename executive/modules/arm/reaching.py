"""Process module that moves arms to postures, to poses at, around or above objects, and to people."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Sequence
from functools import partial
from itertools import chain, islice, product, repeat

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations import HandSolution, ReachKind
from executive.locations.changes import Changes
from executive.locations.demands import asks_for
from executive.locations.rejections import Rejections
from executive.locations.supposed import at_rest
from executive.modules.arm.hand_work import HandWork
from executive.modules.arm_paths import ITERATIONS
from executive.modules.runner import Skill, first_failure, nothing
from executive.modules.verifying import check_is_where_put
from executive.modules.ways_out import planned, way_out_of_arm
from executive.motion import MotionError, NoPath
from executive.robots.arms import ArmModel
from planlang.designators import (
    Action,
    Device,
    Location,
    Object,
    Person,
    a_location,
    action,
)
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    LocationUnresolvable,
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    NavigationFailure,
    PerceptionFailure,
    PlanFailure,
)
from planlang.geometry import Array
from planlang.kernel import checkpoint
from planlang.language.performing import perform
from planlang.language.process_module import process_module
from planlang.language.resources import using
from planlang.protocols import Trajectory
from planlang.relations.reaching import InCenterOf

BACKING = (0.15, 0.3)
"""Least distances by which the base backs off, tried in turn, when an arm has no path [m]."""
FREER = (0.45, 0.2)
"""The same for an arm that has no path to a hand pose: the farther back, the more room to unfold."""
DRAWN_OUT = (0.3, 0.2, 0.1)
"""Distances to try for pulling a hand straight out of tight surroundings [m]."""
FEW = 300
"""Iterations of a path search after which the base backs off."""
MOST_SOLUTIONS = 6
"""Hand poses of one location for which to plan a path: more differ little and fail alike."""
FURTHER = ITERATIONS // (MOST_SOLUTIONS - 1)
"""Iterations for each hand pose after one without a path: together no more than for that one."""


class HandReaching(HandWork):
    """Moves a hand to a location, after a look at objects not seen since the base last moved."""

    failures = (ManipulationFailure, PerceptionFailure, LookingFailure, DesignatorFailure)

    def resources(self, action: Action) -> tuple[str, ...]:
        """List the arms that the action may use, and the torso if it moves with them."""
        arms = self._arms(action)
        torso = [] if all(self.platform.robot.torso not in arm.joints for arm in arms) else ["torso"]
        return (*(arm.name for arm in arms), *torso)

    async def execute(self, action: Action) -> None:
        """Move a hand to ``to_location``. Raises failures of the classes in ``failures``."""
        location = self._target(action)
        if location is None:
            raise ActionUnresolvable("state where the hand goes as to_location", designator=str(action))
        arms = self._arms(action)
        if not arms:
            raise ActionUnresolvable("the robot has no arm that this action may use", designator=str(action))
        if self.platform.scene.arms.mates(arms[0].name) and self._is_for_person(action):
            await self._hold_out_together(arms[0], location)
            return
        arms = [arm for arm in arms if not self.platform.scene.arms.mates(arm.name)]
        if not arms:
            raise ActionUnresolvable(
                "two arms hold an object together, so neither moves alone; put it down first", designator=str(action)
            )
        if not location.relations:
            await self._to_posture(arms[0], location.name or "")
            return
        if not any(self.platform.arms.begun_grasp(arm, location) for arm in arms):
            await self._look_first(location)
        bodies = self.platform.scene.bodies
        names = [bodies.bind(one) for one in location.objects()]
        await Skill(
            lambda: arms,
            partial(self._reach, location=location),
            believed=lambda: [bodies.pose(name) for name in names],  # a touch may show that a thing stands elsewhere
            failures=(ManipulationPoseUnreachable, ManipulationGoalInCollision, LocationUnresolvable),
            otherwise=partial(self._out_of_reach, arms[0], location),
        ).run()

    def _target(self, action: Action) -> Location | None:
        """Convert ``to_location`` to a hand location: for an object its grasp, for a person a pose in their reach."""
        match action.get("to_location"):
            case Location() as location:
                return location
            case Person() as person:
                return a_location(in_reach_of=person)
            case Object() as what:
                return a_location(in_center_of=what)
        return None

    def _arms(self, action: Action) -> list[ArmModel]:
        """Find the arms to try, best first: those of the stated device, else those holding something, else all.

        Only empty arms for a grasp, if there are any; arms of a device that hold something for a person.
        """
        scene, arms = self.platform.scene, self.platform.arms
        device, location = action.get("device_used"), self._target(action)
        allowed = scene.arms.asked(device)
        if location is not None and self.platform.resolver.is_grasp(location) and (free := arms.free(allowed)):
            return free
        if isinstance(device, Device):
            ordered = arms.in_order(allowed)
            offering = [arm for arm in ordered if scene.arms.held(arm.name)] if self._is_for_person(action) else []
            return offering or ordered
        return arms.holding_for(action, allowed) or arms.in_order(allowed)

    def _is_for_person(self, action: Action) -> bool:
        """Check whether the target is a pose relative to a person."""
        location, scene = self._target(action), self.platform.scene
        return location is not None and any(
            scene.bodies.is_person(scene.bodies.bind(one)) for one in location.objects()
        )

    async def _hold_out_together(self, arm: ArmModel, location: Location) -> None:
        """Hold out what an arm holds together with another one, where a person takes it."""
        held = self.platform.scene.arms.held(arm.name)
        assert held is not None
        what = self.platform.scene.bodies.designator(held.name)
        await perform(action("CarryingWhileLocomoting", object_acted_on=what, to_location=location))

    async def _look_first(self, location: Location) -> None:
        for what in filter(self.platform.sensing.must_look, location.objects()):
            await perform(action("LookingForSomething", object_acted_on=what))

    async def _to_posture(self, arm: ArmModel, name: str) -> None:
        """Move an arm to a named posture; without a path, pull the hand out first, then back off with the base."""
        # A dropped object that has not been seen since may be believed around the fingers; it must not block the arm.
        belief = self.platform.belief
        lost = belief.memory.dropped.get(arm.name)
        touches = None if lost is None or belief.seen_from_here(lost) else lost
        postures = self.platform.arms.postures(arm, name)
        if not postures:
            raise ManipulationPoseUnreachable("the held object cannot be kept upright there", arm=arm.name, what=name)
        path = partial(self._joint_path, arm, postures[0], touches, name, postures[1:])
        back_off = [partial(self._back_off, arm, name, postures, least) for least in BACKING]
        with_torso = partial(nothing)

        def ways() -> Iterator[Callable[[], Awaitable[None]]]:
            yield nothing
            contacts, base = self.platform.scene.collisions.contacts, self.platform.base()
            if not all(contacts(base, arm, posture, touches) for posture in postures):
                yield partial(self._draw_out, arm, name)  # it is the hand that is stuck, and not the goal
            yield from back_off
            if arm.standing is not None:
                yield with_torso  # without room to back off, a slow one may clear the way

        await Skill(
            ways,
            lambda way: path(ITERATIONS if way in (back_off[-1], with_torso) else FEW),
            approach=lambda way: way(),
        ).run()

    async def _draw_out(self, arm: ArmModel, label: str) -> None:
        """Pull the hand straight back or up out of its surroundings. Raises a ManipulationFailure if it cannot."""
        offsets = (
            far * direction for direction, far in product((self.back_of(arm), np.array([0.0, 0.0, 1.0])), DRAWN_OUT)
        )
        path = self.platform.arms.drawn(arm, offsets, None)
        if path is None:
            raise ManipulationPoseUnreachable(arm=arm.name, what=label)
        await self.follow_to_end(arm.name, path, label)

    async def _back_off(self, arm: ArmModel, label: str, postures: Sequence[Array], least: float) -> None:
        """Back off by at least ``least`` [m], to room for one of the postures. Raises a failure if there is none."""
        for posture in postures:
            if await self.back_off([(arm, posture)], least):
                return
        raise ManipulationPoseUnreachable(arm=arm.name, what=label)

    async def _reach(self, arm: ArmModel, location: Location) -> None:
        """Try hand poses that satisfy the location until one has a path."""

        stuck: list[HandSolution] = []

        async def reach(way: tuple[HandSolution, int, float]) -> None:
            solution, iterations, away = way
            try:
                if away:
                    await self._ready_from(solution, away)
                await self._go(solution, location, iterations)
            except ManipulationPoseUnreachable as problem:
                if isinstance(problem.__cause__, NoPath) and not away:
                    stuck.append(solution)
                raise
            self.platform.arms.use(arm, solution)

        await Skill(
            partial(self._ways, arm, location, stuck),
            reach,
            between=checkpoint,
            failures=(ManipulationPoseUnreachable,),
            most=MOST_SOLUTIONS + len(FREER),
        ).run()

    def _ways(
        self, arm: ArmModel, location: Location, stuck: Sequence[HandSolution]
    ) -> Iterator[tuple[HandSolution, int, float]]:
        """Yield hand poses, each with the iterations of its path search, and the distance to back off for it [m].

        At last the first of those that had no path from here, ``stuck``: close to furniture an arm that is tucked has
        little room to unfold, farther back it has.
        """
        solutions, unresolved = islice(self._solutions(arm, location), MOST_SOLUTIONS), None
        try:
            for solution, iterations in zip(solutions, chain((ITERATIONS,), repeat(FURTHER)), strict=False):
                yield solution, iterations, 0.0
        except LocationUnresolvable as problem:
            unresolved = problem
        for solution in stuck[:1]:
            yield from ((solution, FEW, away) for away in FREER)
        if unresolved is not None:
            raise unresolved

    async def _ready_from(self, solution: HandSolution, away: float) -> None:
        """Back off, bring an arm into the first posture of a solution, and drive back with it."""
        arm, first, label, here = solution.arm, solution.joints[0], solution.plan.label, self.platform.base()
        room = self.platform.standing().with_room_for([(arm, first)], away)
        if room is None:
            raise ManipulationPoseUnreachable(arm=arm.name, what=label)
        try:
            await self.drive(room)
            await self._joint_path(arm, first, None, label, iterations=FEW)
            await self.drive(here)
        except NavigationFailure as problem:
            raise ManipulationPoseUnreachable(arm=arm.name, what=label) from problem

    def _solutions(self, arm: ArmModel, location: Location) -> Iterator[HandSolution]:
        """Yield the solution that the arm has begun, to continue it, then all others."""
        begun = self.platform.arms.begun_grasp(arm, location)
        if begun is not None:
            yield begun
        yield from self.platform.resolver.hands(location, arm, self.platform.arm_joints(arm))

    async def _out_of_reach(
        self, arm: ArmModel, location: Location, problem: PlanFailure | None, tried: int
    ) -> PlanFailure:
        """Make the failure of a hand that none of the arms got to a location: what is in the way, if that is known.

        Of an arm that has no path, also what the robot can do so that one has, if that was found.
        """
        if isinstance(problem, LocationUnresolvable):
            blocking = next(iter(problem.blocking), None)
            kind = ManipulationPoseUnreachable if blocking is None else ManipulationGoalInCollision
            return kind(arm=arm.name, what=str(location), blocked_by=blocking)
        if problem is not None and any(isinstance(link, NoPath) for link in problem.chain()):
            decision = f"what to move so that an arm gets to {location}"
            once_moved = self.platform.ahead.decided(decision, partial(self._once_moved, location))
            if once_moved is not None:
                once_moved.__cause__ = problem
                failure = ManipulationPoseUnreachable(arm=arm.name, what=str(location))
                failure.__cause__ = once_moved
                return failure
        return await first_failure(problem, tried)

    def _once_moved(self, location: Location) -> LocationUnresolvable | None:
        """Find an open door or drawer near a location with which moved an arm has a path there; None without one."""
        scene, what = self.platform.scene, next(location.things(), None)
        body = None if what is None else scene.bodies.known(what)
        if body is None:
            return None
        changes = Changes(body, scene, Rejections(), lambda _: None)
        first, advice = changes.by_the_robot(partial(self._gets_to, location))
        if advice is None:
            return None
        return LocationUnresolvable(
            designator=str(location), figures=advice.sentence, first=first, changes=advice.changes
        )

    def _gets_to(self, location: Location, scene: PlanningScene) -> bool:
        """Check whether a base pose is found in a scene that is supposed from which an arm has a path to a location."""
        where = a_location(in_reach_of=location)

        def search(then: PlanningScene) -> bool:
            base, reached = self.platform.resolver.first_reached(where, then)
            there = self.supposing(then.supposing(at_rest(then, then.belief.state, base)))
            return bool(reached) and all(map(there.unfolds, reached))

        return self.platform.ahead.finds(f"path to {location}", scene.belief.state, search, otherwise=False)

    def unfolds(self, solution: HandSolution) -> bool:
        """Check whether an arm, as it is now, has a path to the first posture of a solution."""
        try:
            self.platform.arms.path(solution.arm, self.first_posture(solution), iterations=FEW)
        except MotionError:
            return False
        return True

    def first_posture(self, solution: HandSolution) -> Array:
        """Return the joint positions (d,) from which the hand goes straight."""
        return np.asarray(solution.joints[0])

    async def _go(self, solution: HandSolution, location: Location, iterations: int) -> None:
        grasps = asks_for(location, InCenterOf)
        arm, first, label = solution.arm, solution.joints[0], solution.plan.label
        await self.platform.hands.shape(arm, solution.plan.fingers)
        match solution.reach.kind:
            case ReachKind.RETREAT:
                for pose in solution.plan.poses[-len(solution.joints) :]:
                    await self.straight(arm, pose, solution.plan.touches, label)
                await self._look_back(solution.reach.body)
            case ReachKind.GRASP if grasps:
                if not self.platform.arms.is_at(arm, first):
                    await self._joint_path(arm, first, None, label, iterations=iterations)
                await self.straight(arm, solution.plan.poses[1], solution.plan.touches, label)
            case _:
                await self._joint_path(arm, first, None, label, iterations=iterations)

    async def _look_back(self, name: str) -> None:
        """Look at a thing that was put down from which the hand has drawn back, if it was in the hand's shade before.

        Raises ObjectLost if it is not where it was put.
        """
        if self.platform.robot.camera is not None and not self.platform.belief.seen_from_here(name):
            async with using("head"):
                await check_is_where_put(self.platform, name)

    async def _joint_path(
        self,
        arm: ArmModel,
        goal: Array,
        touches: str | None,
        label: str,
        others: Sequence[Array] = (),
        iterations: int = ITERATIONS,
    ) -> None:
        """Move to joint positions (d,), or to one of ``others``; an arm that is in collision escapes first."""
        plan = partial(self._planned, arm, goal, touches, label, others, iterations)
        follow = partial(self.follow_to_end, arm.name, what=label)
        await follow(await planned(plan, partial(way_out_of_arm, self.platform, arm, touches), follow))

    async def _planned(
        self, arm: ArmModel, goal: Array, touches: str | None, label: str, others: Sequence[Array], iterations: int
    ) -> Trajectory:
        rounds = max(1, iterations // FEW)  # restarts, because one long search would hold up all other tasks
        for number in range(1, rounds + 1):
            try:  # a slow torso moves at last: after few iterations there are other ways, as backing off
                still = number < rounds or iterations <= FEW
                return self.platform.arms.path(arm, goal, touches, iterations // rounds, others, still=still)
            except MotionError as problem:
                if not isinstance(problem, NoPath) or number == rounds:
                    raise ManipulationPoseUnreachable(arm=arm.name, what=label) from problem
                await checkpoint()
        raise AssertionError("there is at least one round")


@process_module
class Reaching(HandReaching):
    """Reaches for objects, places, postures and people."""

    name = "arm"
    actions = ("Reaching",)
