"""The process module for what one hand does not hold, such as trays: two hands take it, carry it level, put it down.

It drives to where both hands reach opposite sides of the thing, takes it, lifts it, and draws it in; the base drives
with the arms as they are. Where it is put down the hands lower it together, and let go at once.
"""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain, combinations
from typing import TypeVar

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.locations.base_poses import BasePoses
from executive.locations.rejections import Rejections
from executive.modules.arm.hand_work import HandWork
from executive.modules.trays.pair_paths import LIFT, PairGrasp, PairPaths
from executive.modules.tries import Tries
from executive.motion import MotionError
from executive.robots.arm_pair import ArmPair
from planlang import checkpoint
from planlang.designators import Action, Location, Object, resting_on
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    GraspMissed,
    GripperFailure,
    HandsLacking,
    LocationUnresolvable,
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    NavigationFailure,
    ObjectNotFound,
    PerceptionFailure,
    TooHeavy,
)
from planlang.geometry import Array, Pose
from planlang.language.process_module import process_module

PLACES = 3
"""Places of the base from which a thing is taken, or put down, one after another: what is seen there may differ."""
NEAR = 1.5
"""Distance of the base from a place from which on it is tried from where the base is [m]."""
MOST_SPOTS, APART = 32, 0.12
"""Places for a thing that are tried, and their distances from each other [m]."""
LOOKED_AT = 4000
"""Places for a thing among which these are chosen."""
WAYS = 4
"""Ways that are tried from one place of the base: others differ little."""
SAME = 0.05
"""Difference of two places of the base that are hardly another [m, rad]."""
OUTWARDS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.05, 0.0)
"""Distances by which what is held is held out to put it down [m]."""
HAIR = 1e-6
CLOSE = 0.3
"""Distance of a thing from the axis of the base to which it is drawn in, if there is room [m]."""

T = TypeVar("T")


@process_module
class TwoHands(HandWork):
    """Takes, carries and puts down what takes two hands."""

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
        DesignatorFailure,
    )

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the whole robot."""
        return self.whole_robot()

    async def execute(self, action: Action) -> str:
        """Do with ``object_acted_on`` what the action's class says; return the thing's name."""
        what = action.get("object_acted_on")
        if not isinstance(what, Object):
            raise ActionUnresolvable("it needs object_acted_on", designator=str(action))
        name, kinds = self.platform.scene.bodies.bind(what), self.platform.ancestors(action.type)
        if not {"GraspingSomething", "PickingUpAnObject", "TakingSomething"}.isdisjoint(kinds):
            await self._take(name, what)
            return name
        if "ReleasingGraspOfSomething" not in kinds:
            await self._bring(name, what, action, lowers="CarryingWhileLocomoting" not in kinds)
        if not {"ReleasingGraspOfSomething", "PuttingDownAnObject"}.isdisjoint(kinds):
            await self._let_go(name)
        return name

    # Taking

    async def _take(self, name: str, what: Object) -> None:
        if name in self.platform.belief.held:
            return
        pairs, tried = self._pairs(name), list[BasePose]()
        problem: ManipulationFailure | NavigationFailure | None = None
        await self.tuck(self.platform.arms.untucked())
        for number in range(PLACES + 1):
            if self._is_near(self.platform.scene.bodies.block(name).centre):
                await self._seen(name, what)
                try:
                    if await self._from_here(pairs, name):
                        return
                except (ManipulationPoseUnreachable, ManipulationGoalInCollision, GraspMissed) as failure:
                    if name in self.platform.belief.held:  # it was taken, and something stopped it then
                        raise
                    problem = problem or failure
                    if not isinstance(failure, ManipulationPoseUnreachable):  # it is not quite where it was seen
                        await self.tuck(self.platform.arms.untucked())
                        continue
            base = await self._elsewhere(pairs, name, tried) if number < PLACES else None
            if base is None:
                break
            tried.append(base)
            try:
                await self.drive(base)
            except NavigationFailure as failure:
                problem = problem or failure
        raise self._nowhere(name, pairs, "take") from problem

    async def _from_here(self, pairs: Sequence[PairPaths], name: str) -> bool:
        """Take the thing from where the base is; False if there is no way, a failure if there is and none was gone."""
        problem, tried = None, 0
        for paths in pairs:
            async for grasp in _found(paths.grasps(name, [self.platform.base()])):
                try:
                    await self._grasp(paths, grasp, name)
                    return True
                except ManipulationPoseUnreachable as failure:
                    if name in self.platform.belief.held:
                        raise
                    problem = problem or failure
                    await self.tuck(self.platform.arms.untucked())
                if (tried := tried + 1) == WAYS:
                    raise problem
        if problem is not None:
            raise problem
        return False

    async def _elsewhere(self, pairs: Sequence[PairPaths], name: str, tried: Sequence[BasePose]) -> BasePose | None:
        """Return a place of the base from which there is a way, other than those that were tried; None without."""
        block = self.platform.scene.bodies.block(name)
        point, square = block.centre[:2], block.yaw + np.arange(4) * math.pi / 2
        for paths in pairs:
            poses, arms = self.platform.base_poses(), paths.pair.arms
            every = chain(poses.before(point, arms, square), poses.before(point, arms))
            bases = (one for one in every if not _is_one_of(one, tried))
            async for grasp in _found(paths.grasps(name, bases)):
                return grasp.base
        return None

    def _is_near(self, point: Array) -> bool:
        return math.dist(point[:2], self.platform.base()[:2]) <= NEAR

    async def _seen(self, name: str, what: Object) -> None:
        """Look at the thing if it has to be; raises ObjectNotFound."""
        sensing = self.platform.sensing
        if sensing.must_look(what):
            await self.look(name)
            if sensing.must_look(what):
                sensing.not_seen(name)
                raise ObjectNotFound(what=name)

    def _pairs(self, name: str) -> list[PairPaths]:
        """Return the pairs of free hands that carry a thing; raises HandsLacking or TooHeavy."""
        platform, bodies = self.platform, self.platform.scene.bodies
        free, needed = self.free_hands(), bodies.hands(name)
        if len(free) < needed or needed > 2:
            raise HandsLacking(designator=f"take {name}", what=name, needed=needed, hands=len(free))
        platform.sync()
        mass = sum(map(bodies.mass, (name, *platform.scene.world.standing_on(name))))
        pairs = [pair for pair in combinations(free, 2) if mass / 2 <= min(arm.payload for arm in pair)]
        if not pairs:
            payload = 2 * max(min(arm.payload for arm in pair) for pair in combinations(free, 2))
            raise TooHeavy(designator=name, what=name, mass=mass, payload=payload, hands=2)
        still = platform.world.configuration().joints
        return [PairPaths(platform, ArmPair(pair, still)) for pair in pairs]

    def _nowhere(self, name: str, pairs: Sequence[PairPaths], doing: str) -> LocationUnresolvable:
        log = Rejections()
        for paths in pairs:
            log.include(paths.log)
        size = " m by ".join(f"{extent:g}" for extent in self.platform.scene.bodies.size(name)[:2])
        return log.failure(f"{doing} {name}, {size} m, with two hands")

    async def _grasp(self, paths: PairPaths, grasp: PairGrasp, name: str) -> None:
        hands, arms = self.platform.hands, paths.pair.arms
        for arm, fingers in zip(arms, grasp.fingers, strict=True):
            await hands.move(arm, closed=False, fingers=fingers)
        await self._arms_to(paths, grasp.approach[0], name)
        await self._go(paths, grasp.approach, name)
        for arm in arms:
            await hands.close(arm)
        if missed := next((arm for arm in arms if hands.between_fingers(arm) != name), None):
            for arm in arms:
                await hands.move(arm, closed=False)
            await self._go(paths, grasp.approach[::-1], name)
            raise GraspMissed(arm=missed.name, what=name)
        for arm in arms:
            hands.grasp(arm, name)
        await self._go(paths, grasp.lift, name, held=True)
        await self._draw_in(paths, name)

    async def _arms_to(self, paths: PairPaths, q: Array, name: str) -> None:
        """Bring the arms, one after the other, to joint values (n,); one may have to make room for the other."""
        waiting = list(zip(paths.pair.arms, paths.pair.group.columns, strict=True))
        tries = Tries(ManipulationPoseUnreachable)
        for _ in range(len(waiting)):
            for arm, columns in tuple(waiting):
                with tries:
                    await self.follow_to_end(arm.name, self.planned(arm, q[columns], None), name)
                    waiting = [one for one in waiting if one[0] is not arm]
        if waiting and tries.problem is not None:
            raise tries.problem

    async def _go(self, paths: PairPaths, rows: Array, name: str, *, held: bool = False) -> None:
        """Move both arms on a way (k, n)."""
        if len(rows) < 2:
            return
        arms = " and ".join(arm.name for arm in paths.pair.arms)
        try:
            trajectory = paths.timed(np.concatenate([paths.now()[None], rows[1:]]), held=held)
        except MotionError as problem:
            raise ManipulationPoseUnreachable(arm=arms, what=name) from problem
        await self.follow_to_end(arms, trajectory, name)

    async def _draw_in(self, paths: PairPaths, name: str) -> None:
        """Bring a held thing close to the base, as far as that goes."""
        x, y, _ = paths.pose_of(name, paths.now())[:3, 3].tolist()
        away = math.hypot(x, y)
        if away > CLOSE:
            shift = np.array([x, y, 0.0]) * (CLOSE / away - 1.0)
            with suppress(ManipulationFailure):
                await self._go(paths, paths.shifted(name, shift), name, held=True)

    # Putting down

    def _holding(self, name: str) -> PairPaths:
        """Return the ways of the arms that hold a thing; raises ActionUnresolvable if two do not."""
        platform = self.platform
        grip = platform.belief.held.get(name)
        arms = [arm for arm in platform.scene.arms.all if grip is not None and arm.name in grip.arms]
        if len(arms) != 2:
            raise ActionUnresolvable(f"two hands do not hold {name}", designator=name)
        return PairPaths(platform, ArmPair((arms[0], arms[1]), platform.world.configuration().joints))

    async def _bring(self, name: str, what: Object, action: Action, *, lowers: bool) -> None:
        """Bring what is held to where a place is in reach, and lower it there."""
        paths, where = self._holding(name), action.get("to_location")
        if not isinstance(where, (Object, Location)):
            raise ActionUnresolvable("it needs to_location", designator=str(action))
        location, tried = resting_on(where), list[BasePose]()
        tries = Tries(ManipulationPoseUnreachable, NavigationFailure)
        for number in range(PLACES + 1):
            spots = self._spots(what, location)
            if self._is_near(np.array(spots[0].position)):
                with tries:
                    if await self._lowered(paths, name, spots, lowers=lowers):
                        return
            await self._rise(paths, name, max(spot.position[2] for spot in spots))
            if number == PLACES:
                break
            place = await _first(paths.places(name, spots, partial(self._before, paths, name, tried)))
            if place is None:
                break
            tried.append(place.base)
            with tries:
                await self.drive(place.base)
            await self._look_at_support(place.pose)
        raise self._nowhere(name, [paths], "put down") from tries.problem

    async def _lowered(self, paths: PairPaths, name: str, spots: Sequence[Pose], *, lowers: bool) -> bool:
        """Lower what is held from where the base is; False without a way, a failure if none that there is was gone."""
        tries, tried, here = Tries(ManipulationPoseUnreachable), 0, partial(_only, self.platform.base())
        async for place in _found(paths.places(name, spots, here)):
            with tries:
                if lowers:
                    await self._go(paths, place.lower, name, held=True)
                return True
            if (tried := tried + 1) == WAYS:
                break
        if tries.problem is not None:
            raise tries.problem
        return False

    def _before(self, paths: PairPaths, name: str, tried: Sequence[BasePose], pose: Pose) -> Iterator[BasePose]:
        """Yield free places of the base before a place of what is held: first where it has only to be held out."""
        poses = self.platform.base_poses()
        bases = chain(
            self._held_out(poses, paths, name, pose), poses.before(np.array(pose.position[:2]), paths.pair.arms)
        )
        return (one for one in bases if not _is_one_of(one, tried))

    def _held_out(self, poses: BasePoses, paths: PairPaths, name: str, pose: Pose) -> Iterator[BasePose]:
        """Yield free places of the base from which what is held comes to a place when it is moved straight away."""
        here = Pose.from_matrix(paths.pose_of(name, paths.now()))
        x, y, _ = here.position
        shares = 1.0 + np.array(OUTWARDS) / max(math.hypot(x, y), HAIR)
        outs = (Pose.planar(x * share, y * share, here.yaw) for share in shares.tolist())
        bases = [Pose.planar(*pose.position[:2], pose.yaw) @ out.inverse() for out in outs]
        rows = np.array([(*base.position[:2], base.yaw) for base in bases])
        return poses.with_room(rows[poses.free(rows)])

    def _spots(self, what: Object, location: Location) -> list[Pose]:
        """Return places for a thing, the best ones of those that are apart; raises LocationUnresolvable."""
        spots: list[Pose] = []
        for pose in self.platform.resolver.best_things(location, what, LOOKED_AT):
            near = (one for one in spots if one.distance(pose) < APART and abs(one.yaw - pose.yaw) < APART)
            if next(near, None) is None:
                spots.append(pose)
            if len(spots) == MOST_SPOTS:
                break
        turned = [Pose.planar(x, y, one.yaw + math.pi, z) for one in spots for x, y, z in [one.position]]
        return [pose for both in zip(spots, turned, strict=True) for pose in both]

    async def _rise(self, paths: PairPaths, name: str, height: float) -> None:
        """Lift a held thing to where it passes over the edge of its support, at a height of its middle [m]."""
        missing = height + LIFT - float(paths.pose_of(name, paths.now())[2, 3])
        if missing > 0:
            await self._go(paths, paths.shifted(name, np.array([0.0, 0.0, missing])), name, held=True)

    async def _look_at_support(self, pose: Pose) -> None:
        bodies = self.platform.scene.bodies
        there = np.array(pose.position)
        under = [one for one in bodies.names() if bodies.is_solid(one) and bodies.block(one).away(there) < 2 * LIFT]
        for one in under[:1]:
            await self.look(one)

    async def _let_go(self, name: str) -> None:
        """Open both hands, draw them back, and bring the arms close to the robot."""
        platform, paths = self.platform, self._holding(name)
        arms = paths.pair.arms
        platform.check_hold([arm.name for arm in arms])
        opened = [platform.arms.opening(arm) for arm in arms]
        platform.hands.let_go(name)
        for arm, fingers in zip(arms, opened, strict=True):
            await platform.hands.move(arm, closed=False, fingers=fingers)
        await platform.hands.settled(name)
        await self._go(paths, paths.away(name), name)
        await self.tuck(platform.arms.untucked())


def _only(base: BasePose, pose: Pose) -> list[BasePose]:
    return [base]


def _is_one_of(base: BasePose, tried: Iterable[BasePose]) -> bool:
    """Return whether a place of the base is one that was tried, or hardly another."""
    return any(math.dist(base[:2], one[:2]) < SAME and abs(base[2] - one[2]) < SAME for one in tried)


async def _found(ways: Iterator[T | None]) -> AsyncIterator[T]:
    """Yield ways; other tasks go on while they are looked for."""
    for way in ways:
        if way is not None:
            yield way
        else:
            await checkpoint()


async def _first(ways: Iterator[T | None]) -> T | None:
    """Return the first way of some; other tasks go on while it is looked for."""
    async for way in _found(ways):
        return way
    return None
