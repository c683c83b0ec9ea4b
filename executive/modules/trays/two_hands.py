"""Process module for objects that take two hands, such as trays: it grasps, carries and puts them down level.

The base drives to where the hands reach opposite sides of the object; they grasp it, lift it and draw it in. The arms
keep their posture while the base drives. To put it down, both hands lower it together and release it at the same time.
"""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain, combinations, islice
from typing import TypeVar

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.locations import ReachKind
from executive.locations.demands import use_at
from executive.locations.rejections import Rejections
from executive.modules.arm.hand_work import HandWork
from executive.modules.platform import Platform
from executive.modules.runner import Skill, each, nothing
from executive.modules.trays.pair_paths import LIFT, PairGrasp, PairPaths, PairPlace
from executive.modules.verifying import begin_to_watch, check_is_where_put
from executive.motion import MotionError
from executive.robots.arm_pair import ArmPair
from planlang.designators import Action, Location, Object, resting_on
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    GraspMissed,
    GripperFailure,
    HandsLacking,
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    NavigationFailure,
    ObjectNotFound,
    ObjectUndeliverable,
    PerceptionFailure,
    PlanFailure,
    TooHeavy,
)
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import apart
from planlang.language.location import AGAIN, AGAIN_WITHIN, NOT_ARRIVED
from planlang.language.process_module import process_module
from planlang.language.recovery import Recovery, with_failure_handling
from planlang.protocols import Group, GroupKind
from sim.people import LOW

T = TypeVar("T")

NEAR = 1.5
"""Distance within which the current base pose is tried first [m]."""
MOST_SPOTS, APART = 32, 0.12
"""Most poses for putting an object down, and their least difference [m, rad]."""
MOST_STANDS = 4
"""Most base poses from which to hold an object out."""
LOOKED_AT = 4000
"""Samples from which to choose these poses."""
SAME = 0.05
"""Difference below which two base poses count as the same [m, rad]."""
OUTWARDS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.05, 0.0)
"""Distances to try for extending the held object outwards to put it down [m]."""
HAIR = 1e-6
"""Guard against division by zero [m]."""
CLOSE = 0.3
"""Distance from the base's axis to which a held object is drawn in, if there is room [m]."""


@process_module
class TwoHands(HandWork):
    """Grasps, carries and puts down objects that take two hands."""

    name = "two_hands"
    actions = (
        "GraspingSomething",
        "PickingUpAnObject",
        "TakingSomething",
        "CarryingWhileLocomoting",
        "PuttingDownAnObject",
        "LoweringAnObject",
        "ReleasingGraspOfSomething",
    )
    failures = (
        ManipulationFailure,
        GripperFailure,
        NavigationFailure,
        PerceptionFailure,
        LookingFailure,
        ObjectUndeliverable,
        DesignatorFailure,
    )

    def __init__(self, platform: Platform) -> None:
        super().__init__(platform)
        self._held_awkwardly = set[str]()
        """Objects that the arms, as they once held them, could put down nowhere: they are not just taken from here."""

    async def execute(self, action: Action) -> str:
        """Perform what the action's class states on ``object_acted_on``; return the object's name.

        Raises ObjectUndeliverable if the hands, as they hold it, reach no place to put it down.
        """
        what = self.object_of(action, "handle")
        name, classes = self.platform.scene.bodies.bind(what), self.platform.ancestors(action.type)
        if not {"GraspingSomething", "PickingUpAnObject", "TakingSomething"}.isdisjoint(classes):
            await self._take(name, what)
            return name
        if "ReleasingGraspOfSomething" not in classes:
            await self._bring(name, what, action)
        if not {"ReleasingGraspOfSomething", "PuttingDownAnObject"}.isdisjoint(classes):
            await self._let_go(name)
        return name

    # Taking

    async def _take(self, name: str, what: Object) -> None:
        """Grasp the object from the current base pose or others; raises LocationUnresolvable if none works."""
        if name in self.platform.belief.held:
            return
        pairs = self._pairs(name)
        await self.tuck()

        async def bases() -> AsyncIterator[BasePose]:
            block, tried = self.platform.scene.bodies.block(name), list[BasePose]()
            if self._is_near(block.centre) and name not in self._held_awkwardly:
                yield self.platform.base()
            point, square_on = block.centre[:2], block.yaw + np.arange(4) * math.pi / 2
            for paths in pairs:
                standing, arms = self.platform.standing(), paths.pair.arms
                every = chain(standing.before(point, arms, square_on), standing.before(point, arms))
                free = (one for one in every if not _is_one_of(one, tried))
                async for grasp in each(paths.grasps(name, free)):
                    if not _is_one_of(grasp.base, tried):
                        tried.append(grasp.base)
                        yield grasp.base

        async def approach(base: BasePose) -> None:
            if base != self.platform.base():
                await self.drive(base)
            await self._seen(name, what)

        paths, grasp = await Skill(
            bases,
            lambda _: self._from_here(pairs, name),
            approach,
            between=self.tuck,
            believed=lambda: self.platform.belief.pose(name),  # it may look different from each base pose
            failures=(ManipulationPoseUnreachable, ManipulationGoalInCollision, GraspMissed, NavigationFailure),
            otherwise=partial(self._nowhere, name, pairs, "taking"),
        ).run()
        await self._go(paths, grasp.lift, name)
        await self._draw_in(paths, name)

    async def _from_here(self, pairs: Sequence[PairPaths], name: str) -> tuple[PairPaths, PairGrasp]:
        """Grasp the object from the current base pose; return how."""

        def grasps() -> Iterator[tuple[PairPaths, PairGrasp] | None]:
            for paths in pairs:
                for grasp in paths.grasps(name, [self.platform.base()]):
                    yield None if grasp is None else (paths, grasp)

        return await Skill(
            grasps,
            partial(self._grasp, name),
            between=self.tuck,
            failures=(ManipulationPoseUnreachable,),
            otherwise=partial(_no_path, name),
        ).run()

    def _is_near(self, point: Array) -> bool:
        return math.dist(point[:2], self.platform.base()[:2]) <= NEAR

    async def _seen(self, name: str, what: Object) -> None:
        """Look at the object if it has not been seen since the base moved. Raises ObjectNotFound."""
        sensing = self.platform.sensing
        if sensing.must_look(what):
            await self.look(name)
            if sensing.must_look(what):
                sensing.not_seen(name)
                raise ObjectNotFound(what=name)

    def _pairs(self, name: str) -> list[PairPaths]:
        """Find the pairs of empty hands that can carry an object with all that stands on it.

        Raises HandsLacking or TooHeavy if there is none.
        """
        platform, bodies = self.platform, self.platform.scene.bodies
        free, needed = self.free_hands(), bodies.hands(name)
        if len(free) < needed or needed > 2:
            raise self._lacking(name)
        mass = bodies.mass(name)
        pairs = [pair for pair in combinations(free, 2) if mass / 2 <= min(arm.payload for arm in pair)]
        if not pairs:
            payload = 2 * max(min(arm.payload for arm in pair) for pair in combinations(free, 2))
            raise TooHeavy(designator=name, what=name, mass=mass, payload=payload, hands=2, load=bodies.load(name))
        joints = platform.world.configuration().joints
        return [PairPaths(platform, ArmPair(pair, joints)) for pair in pairs]

    def _lacking(self, name: str) -> HandsLacking:
        needed, free, hands = self.platform.scene.bodies.hands(name), self.free_hands(), self.platform.scene.arms.hands
        return HandsLacking(designator=name, what=name, needed=needed, hands=len(free), of=len(hands))

    async def _nowhere(
        self, name: str, pairs: Sequence[PairPaths], doing: str, problem: PlanFailure | None, tried: int
    ) -> PlanFailure:
        """Build the failure that counts why all candidates were rejected."""
        log = Rejections()
        for paths in pairs:
            log.include(paths.log)
        size = " m by ".join(f"{extent:g}" for extent in self.platform.scene.bodies.size(name)[:2])
        return log.failure(f"{doing} {name}, {size} m, with two hands", self.platform.scene.bodies)

    async def _undeliverable(
        self, name: str, pairs: Sequence[PairPaths], problem: PlanFailure | None, tried: int
    ) -> PlanFailure:
        """Make the failure of an object that the hands, as they hold it, can put down nowhere."""
        self._held_awkwardly.add(name)
        failure = ObjectUndeliverable(what=name)
        failure.__cause__ = await self._nowhere(name, pairs, "putting down", problem, tried)
        return failure

    async def _grasp(self, name: str, way: tuple[PairPaths, PairGrasp]) -> tuple[PairPaths, PairGrasp]:
        """Approach and close both hands; return the way. Raises GraspMissed if a hand does not feel the object."""
        paths, grasp = way
        hands, arms = self.platform.hands, paths.pair.arms
        for arm, fingers in zip(arms, grasp.fingers, strict=True):
            await again(partial(hands.move, arm, closed=False, fingers=fingers))
        await self._arms_to(paths, grasp.approach[0], name)
        await self._go(paths, grasp.approach, name)
        for arm in arms:
            await again(partial(hands.close, arm))
        if missed := next((arm for arm in arms if hands.between_fingers(arm) != name), None):
            for arm in arms:
                await hands.move(arm, closed=False)
            await self._go(paths, grasp.approach[::-1], name)
            raise GraspMissed(arm=missed.name, what=name)
        for arm in arms:
            hands.grasp(arm, name)
        return way

    async def _arms_to(self, paths: PairPaths, q: Array, name: str) -> None:
        """Move the arms one after the other to joint positions (n,), in the order in which they find paths."""
        pending = {one.name: (one, q[own]) for one, own in zip(paths.pair.arms, paths.pair.group.columns, strict=True)}

        async def go(arm: str) -> None:
            await self.follow_to_end(arm, self.planned(*pending[arm], None), name)

        async def move(arm: str) -> None:
            await again(partial(go, arm))
            del pending[arm]

        async def is_done() -> bool:
            return not pending

        # moving one arm may make room for the other, which is a candidate again then
        await Skill(lambda: tuple(pending), move, failures=(ManipulationPoseUnreachable,)).until(is_done)

    async def _go(self, paths: PairPaths, rows: Array, name: str, *, repeats: bool = True) -> None:
        """Move both arms along a joint path (k, n); if they stop short, along the rest of it, if it ``repeats``."""
        if len(rows) < 2:
            return
        arms = Group(GroupKind.ARMS, *(arm.name for arm in paths.pair.arms))

        async def go() -> None:
            try:
                trajectory = paths.timed(paths.rest(rows))
            except MotionError as problem:
                raise ManipulationPoseUnreachable(arm=arms, what=name) from problem
            await self.follow_to_end(arms, trajectory, name)

        await (again(go) if repeats else go())

    async def _draw_in(self, paths: PairPaths, name: str) -> None:
        """Draw a held object in towards the base as far as possible."""
        x, y, _ = paths.pose_of(name, paths.now())[:3, 3].tolist()
        away = math.hypot(x, y)
        if away > CLOSE:
            shift = np.array([x, y, 0.0]) * (CLOSE / away - 1.0)
            with suppress(ManipulationFailure):
                await self._go(paths, paths.shifted(name, shift), name)

    # Putting down

    def _holding(self, name: str) -> PairPaths:
        """Build the path planner of the two arms that hold an object. Raises ActionUnresolvable if two do not."""
        platform = self.platform
        grip = platform.belief.held.get(name)
        arms = [arm for arm in platform.scene.arms.all if grip is not None and arm.name in grip.arms]
        if len(arms) != 2 and len(platform.scene.arms.hands) < 2:
            raise self._lacking(name)
        if len(arms) != 2:
            raise ActionUnresolvable(f"{name} is not held in two hands; grasp it first", designator=name)
        return PairPaths(platform, ArmPair((arms[0], arms[1]), platform.world.configuration().joints))

    async def _bring(self, name: str, what: Object, action: Action) -> None:
        """Carry the held object to where ``to_location`` is in reach; lower it there unless that is not asked for.

        To a person it is held out.
        """
        paths, where, classes = self._holding(name), action.get("to_location"), self.platform.ancestors(action.type)
        repeats = "LoweringAnObject" not in classes  # which the plan itself repeats
        if not isinstance(where, (Object, Location)):
            raise ActionUnresolvable("state where to carry the object as to_location", designator=str(action))
        location, tried, here = resting_on(where), list[BasePose](), self.platform.base
        use = use_at(location, name, self.platform.scene, here()[:2])
        if use is not None and use.kind is ReachKind.OFFER:
            return await self._hold_out(paths, name, use.body)

        async def lower(place: PairPlace) -> None:
            if "CarryingWhileLocomoting" not in classes:
                await self._go(paths, place.lower, name, repeats=repeats)

        def lowered(candidate: tuple[PairPlace | None, list[Pose]]) -> Awaitable[None]:
            return Skill(
                lambda: paths.places(name, candidate[1], lambda _: [here()]),
                lower,
                failures=(ManipulationPoseUnreachable,),
                otherwise=partial(_no_path, name),
            ).run()

        async def places() -> AsyncIterator[tuple[PairPlace | None, list[Pose]]]:
            spots = self._spots(what, location)
            if self._is_near(np.array(spots[0].position)):
                yield None, spots
            while True:
                spots = self._spots(what, location)
                await self._rise(paths, name, max(spot.position[2] for spot in spots), repeats=repeats)
                async for place in each(paths.places(name, spots, partial(self._before, paths, name, tried))):
                    tried.append(place.base)
                    yield place, spots
                    break
                else:
                    return

        async def approach(candidate: tuple[PairPlace | None, list[Pose]]) -> None:
            place, spots = candidate
            if place is not None:
                await self.drive(place.base)
                await self._look_at_support(place.pose)
                spots[:] = self._spots(what, location)

        await Skill(
            places,
            lowered,
            approach,
            failures=(ManipulationPoseUnreachable, ManipulationGoalInCollision, NavigationFailure),
            otherwise=partial(self._undeliverable, name, [paths]),
        ).run()

    async def _hold_out(self, paths: PairPaths, name: str, person: str) -> None:
        """Drive to where a person takes the held object as the hands have it, raised as far as that needs."""
        zone = self.platform.scene.bodies.zone(person)
        shoulder = zone.shoulders[0][2]

        def bases() -> Iterator[BasePose]:
            here, standing = Pose.from_matrix(paths.pose_of(name, paths.now())), self.platform.standing()
            (x, y, height), yaw = here.position, zone.heading + math.pi + here.yaw
            held = Pose.planar(x, y, here.yaw)
            for to_x, to_y, _ in zone.points((height - shoulder,)).tolist():
                yield from standing.with_thing_at([held], Pose.planar(to_x, to_y, yaw))

        for rise in (-math.inf, *sorted(LOW)):
            await self._rise(paths, name, shoulder + rise - LIFT)
            if found := list(islice(bases(), MOST_STANDS)):
                await Skill(partial(iter, found), nothing, self.drive, failures=(NavigationFailure,)).run()
                return
        raise await self._nowhere(name, [paths], "holding out", None, 0)

    def _before(self, paths: PairPaths, name: str, tried: Sequence[BasePose], pose: Pose) -> Iterator[BasePose]:
        """Yield free base poses before a put-down pose, those first from which the object is only extended outwards."""
        standing, here = self.platform.standing(), Pose.from_matrix(paths.pose_of(name, paths.now()))
        x, y, _ = here.position
        factors = 1.0 + np.array(OUTWARDS) / max(math.hypot(x, y), HAIR)
        extended = [Pose.planar(x * factor, y * factor, here.yaw) for factor in factors.tolist()]
        point = np.array(pose.position[:2])
        bases = chain(standing.with_thing_at(extended, pose), standing.before(point, paths.pair.arms))
        return (one for one in bases if not _is_one_of(one, tried))

    def _spots(self, what: Object, location: Location) -> list[Pose]:
        """Choose put-down poses for an object: the best that differ enough, each also turned by half a turn.

        Raises LocationUnresolvable if there is none.
        """
        spots: list[Pose] = []
        for pose in self.platform.resolver.best_things(location, what, LOOKED_AT):
            near = (one for one in spots if one.distance(pose) < APART and abs(one.yaw - pose.yaw) < APART)
            if next(near, None) is None:
                spots.append(pose)
            if len(spots) == MOST_SPOTS:
                break
        turned = [Pose.planar(x, y, one.yaw + math.pi, z) for one in spots for x, y, z in [one.position]]
        return [pose for both in zip(spots, turned, strict=True) for pose in both]

    async def _rise(self, paths: PairPaths, name: str, height: float, *, repeats: bool = True) -> None:
        """Lift a held object to LIFT above its put-down height [m], so that it clears the edge of the support."""
        missing = height + LIFT - float(paths.pose_of(name, paths.now())[2, 3])
        if missing > 0:
            await self._go(paths, paths.shifted(name, np.array([0.0, 0.0, missing])), name, repeats=repeats)

    async def _look_at_support(self, pose: Pose) -> None:
        bodies = self.platform.scene.bodies
        there = np.array(pose.position)
        under = [one for one in bodies.names() if bodies.is_solid(one) and bodies.block(one).away(there) < 2 * LIFT]
        for one in under[:1]:
            await self.look(one)

    async def _let_go(self, name: str) -> None:
        """Open both hands, retreat, and tuck the arms."""
        platform, paths = self.platform, self._holding(name)
        arms = paths.pair.arms
        platform.check_hold([arm.name for arm in arms])
        begin_to_watch(platform, name)

        async def release() -> None:
            if name in platform.belief.held:
                await platform.hands.release(arms, name, platform.arms.opening)
            else:  # it has left them, although one has not opened
                for arm in arms:
                    await platform.hands.move(arm, closed=False)

        await again(release)
        await platform.hands.settled(name)
        await check_is_where_put(platform, name)
        await self._go(paths, paths.away(name), name)
        await self.tuck()


def again(motion: Callable[[], Awaitable[T]]) -> Awaitable[T]:
    """Make a motion, and repeat it as plans do with a motion of one hand that stops short."""
    return with_failure_handling(motion, Recovery(NOT_ARRIVED, retries=AGAIN, within=AGAIN_WITHIN))


async def _no_path(name: str, problem: PlanFailure | None, tried: int) -> PlanFailure:
    return problem or ManipulationPoseUnreachable(what=name)


def _is_one_of(base: BasePose, tried: Iterable[BasePose]) -> bool:
    """Check whether a base pose is close to one that was tried."""
    return any(max(apart(base, one)) < SAME for one in tried)
