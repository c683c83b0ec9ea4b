"""The process module that pushes a thing along what it stands on, with a closed hand, until it is where it should be.

The hand goes down behind the thing, straight ahead, back and up again: a stroke under the constraints of the motion.
The robot looks where the thing has come to, and pushes again if that is not near enough. Where the hand feels nothing
ahead of it in the end, the thing has not gone there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from typing import Protocol

import numpy as np

from executive.modules.arm.hand_work import HandWork
from executive.modules.furniture.leaf_pushing import LeafStrokes
from executive.modules.phases import Phase
from executive.modules.platform import Platform
from executive.modules.tools.constrained_motions import constraints_of
from executive.modules.tools.motion_grounding import Grounding
from executive.modules.tools.strokes import Plane, StrokeWork
from executive.modules.tries import Tries
from executive.robots.arms import ArmModel
from planlang import perform
from planlang.designators import Action, Device, Location, Object, a_location, resting_on
from planlang.designators import action as look_for
from planlang.failures import (
    ActionUnresolvable,
    EnvironmentManipulationFailure,
    LookingFailure,
    ManipulationGoalNotReached,
    ObjectNowhereToBeFound,
    PerceptionFailure,
)
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, moved
from planlang.geometry.shapes import corners
from planlang.language.performing import actions_around
from planlang.language.process_module import process_module
from planlang.motion_constraints import MotionConstraint, a_constraint, a_feature
from planlang.protocols import Trajectory
from planlang.records import dataclass
from sim import BodyShape

NEAR = 0.02
"""Difference of distances up to which a thing was pushed as far as it should be [m]."""
LEAST = 0.02
"""Shortest way of a push [m]."""
PUSHES = 4
"""Pushes after which a thing that is elsewhere still is given up."""
PLACES = 6
"""Places for a thing, or directions, that are tried."""
LOOKED_AT = 30
"""Places of a location among which those are looked for to which a thing can be pushed straight."""
LEAD = 0.02
"""Distance of the tip from the thing that the hand pushes, until that is known [m]."""
BEHIND = 0.05
"""Room between hand and thing where the hand comes down, and up again [m]."""
OVER = 0.08
"""Height from which it comes down, and to which it goes [m]."""
STEP = 0.05
"""Distance of places on its way [m]."""
TURNED = tuple(sign * turn * math.pi / 8 for turn in range(9) for sign in (1, -1)[: 1 + (0 < turn < 8)])
"""Angles from straight away from the robot at which a thing is pushed that has to go some distance [rad]."""
SQUARE = 0.35
"""Angle between the way of a thing and one of its sides up to which it hardly turns [rad]."""
LEANS = (0.2, 0.85)
"""Cosines between the hand and its way: the fingers meet the thing first."""
ACROSS = (-0.15, 0.15)
"""Cosines of the line along which fingers close with the way and with up: side by side they keep the thing ahead."""
ASIDE = 0.02
"""Room beside the way of a thing [m]."""
AHEAD = 0.3
"""Share along the way of a hand from which on what presses against it is ahead."""
LOWER = 0.01
"""Difference of heights below which a thing is on the same level [m]."""


class Wish(Protocol):
    """A place to which a thing is to be pushed."""

    def is_there(self) -> bool:
        """Return whether it is believed to be there."""

    def places(self) -> Iterable[Array]:
        """Return places (2,) of the map for its middle, the best first."""


@dataclass(frozen=True, slots=True)
class ToLocation:
    """A wish to have a thing at a location, on the level on which it is."""

    platform: Platform
    name: str
    what: Object
    location: Location

    def is_there(self) -> bool:
        """Return whether the location holds of the thing."""
        return self.platform.resolver.holds(self.location, self.what)

    def places(self) -> Iterable[Array]:
        """Return places at the location, those first on the way to which the thing hardly turns."""
        x, y, height = self.platform.scene.bodies.pose(self.name).position
        found = self.platform.resolver.best_things(self.location, self.what, LOOKED_AT)
        level = [np.array(pose.position[:2]) for pose in found if abs(pose.position[2] - height) <= LOWER]
        return sorted(level, key=lambda place: not self._is_square(place - (x, y)))

    def _is_square(self, way: Array) -> bool:
        block = self.platform.scene.bodies.block(self.name)
        turned = (math.atan2(way[1], way[0]) - block.yaw) % (math.pi / 2)
        return block.round or min(turned, math.pi / 2 - turned) <= SQUARE


@dataclass(frozen=True, slots=True)
class ByDistance:
    """A wish to have a thing at a distance from where it was, in any direction: away from the robot if that can be."""

    platform: Platform
    name: str
    distance: float
    start: Array
    """The place where it was (2,)."""

    def _here(self) -> Array:
        return np.array(self.platform.belief.pose(self.name).position[:2])

    def is_there(self) -> bool:
        """Return whether the thing is so far from where it was."""
        return abs(math.dist(self._here(), self.start) - self.distance) <= NEAR

    def places(self) -> Iterable[Array]:
        """Return places around where it was, straight ahead first."""
        gone = self._here() - self.start
        away = gone if np.hypot(*gone) > LEAST else self.start - self.platform.base()[:2]
        heading = math.atan2(away[1], away[0])
        return [self.start + self.distance * _ahead(heading + turn) for turn in TURNED]


@process_module
class Pushing(StrokeWork):
    """Pushes things."""

    name = "pushing"
    actions = ("PushingMotion",)
    failures = (EnvironmentManipulationFailure, *StrokeWork.failures, ObjectNowhereToBeFound)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the whole robot."""
        return self.whole_robot()

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Push; return (): no constraint is given up. Raises ManipulationGoalNotReached where it does not arrive."""
        platform, what = self.platform, action.get("object_acted_on")
        if not isinstance(what, Object):
            raise ActionUnresolvable("pushing needs object_acted_on", designator=str(action))
        with suppress(PerceptionFailure, LookingFailure):
            await perform(look_for("LookingForSomething", object_acted_on=what))
        name = platform.scene.bodies.bind(what)
        leaf = next((one for one in platform.belief.joints.values() if name in one.bodies and not one.is_knob), None)
        if leaf is not None:
            await LeafStrokes(HandWork(platform), leaf).shut()
            return ()
        if name in platform.belief.held:
            raise ActionUnresolvable(f"{name} is held: it is not pushed", designator=str(action))
        if not platform.scene.bodies.is_movable(name):
            raise ActionUnresolvable(f"{name} cannot be pushed along anything", designator=str(action))
        wish, lead = self._wish(action, name), LEAD
        for _ in range(PUSHES):
            if wish.is_there():
                return ()
            lead = await self._once(action, name, wish, lead)
            if platform.robot.camera is not None and not platform.belief.seen(name):
                await perform(look_for("LookingForSomething", object_acted_on=what))  # it may have fallen
        if not wish.is_there():
            raise ManipulationGoalNotReached(f"{name} is not where it should be after {PUSHES} pushes", what=name)
        return ()

    async def _once(self, action: Action, name: str, wish: Wish, lead: float) -> float:
        """Push a thing to the first place to which that succeeds; return how far the tip was from it [m]."""
        tries = Tries()
        here = self.platform.belief.pose(name).position[:2]
        free = (goal for goal in wish.places() if math.dist(goal, here) > LEAST and self._is_free(name, goal))
        for goal in islice(free, PLACES):
            with tries:
                return await self._push(action, name, goal, lead)
        raise tries.problem or ManipulationGoalNotReached(f"{name} has no free way to where it should be", what=name)

    # Where to

    def _wish(self, action: Action, name: str) -> Wish:
        """Return where a thing is to be pushed, as the action, or one around it, states."""
        bodies, what = self.platform.scene.bodies, action.get("object_acted_on")
        stated = (one.get("to_location") for one in (action, *actions_around()))
        where = next((one for one in stated if isinstance(one, Location | Object)), None)
        distance = self.number(action, "distance_translated")
        assert isinstance(what, Object)
        if where is not None:
            location, support = resting_on(where), bodies.support(name)
            if support is not None and all(one.name not in ("on", "in_") for one in location.relations):
                location = location & a_location(on=bodies.designator(support))
            return ToLocation(self.platform, name, what, location)
        if distance is None:
            raise ActionUnresolvable("pushing needs to_location or distance_translated", designator=str(action))
        return ByDistance(self.platform, name, distance, np.array(bodies.pose(name).position[:2]))

    def _is_free(self, name: str, goal: Array) -> bool:
        """Return whether nothing is on the way of a thing to a place (2,), and it stays on what it stands on."""
        world, bodies = self.platform.scene.world, self.platform.scene.bodies
        pose, block = bodies.pose(name), bodies.block(name)
        way = goal - np.array(pose.position[:2])
        length, heading = float(np.hypot(*way)), math.atan2(way[1], way[0])
        ahead, across = _ahead(heading), _ahead(heading + math.pi / 2)
        half = np.array([block.support(heading), block.support(heading + math.pi / 2)]) + ASIDE
        support, riders = world.support(name), world.standing_on(name)
        for other in world.names():
            body = world.scene.body(other)
            if other in (name, support, *riders) or body.shape is BodyShape.ROOM:
                continue
            box = corners(world.pose(other), body.size)
            if box[:, 2].max() <= block.low + LOWER or box[:, 2].min() >= block.high:
                continue
            at = (box[:, :2] - pose.position[:2]) @ np.column_stack([ahead, across])
            behind, before = [-half[0] + ASIDE, -half[1]], [length + half[0], half[1]]
            if (at.max(axis=0) > behind).all() and (at.min(axis=0) < before).all():
                return False
        return support is None or self._stands(name, goal, support)

    def _stands(self, name: str, goal: Array, support: str) -> bool:
        """Return whether a thing would stand on the same thing at a place (2,)."""
        world, pose = self.platform.scene.world, self.platform.scene.bodies.pose(name)
        try:
            world.set_pose(name, Pose((float(goal[0]), float(goal[1]), pose.position[2]), pose.orientation))
            return world.support(name) == support and abs(world.height_above_support(name)) <= LOWER
        finally:
            self.platform.sync()

    # The push

    async def _push(self, action: Action, name: str, goal: Array, lead: float) -> float:
        """Push a thing once, with the first hand that can; return how far the tip was from it in the end [m]."""
        work, arms = HandWork(self.platform), HandWork(self.platform).free_hands()
        tries = Tries()
        for arm in self.platform.arms.in_order(arms):
            await work.tuck(self.platform.arms.untucked())
            await self.platform.hands.move(arm, closed=True)
            with tries:
                return await self._pushed(action, name, goal, lead, arm)
            await work.tuck(self.platform.arms.untucked())
            await work.look(name)
        raise tries.problem or ManipulationGoalNotReached("no hand is free", what=name)

    async def _pushed(self, action: Action, name: str, goal: Array, lead: float, arm: ArmModel) -> float:
        platform, device = self.platform, self.platform.robot.arm(arm.name).hand
        stated = replace(action, properties=tuple(sorted({**dict(action.properties), "device_used": device}.items())))
        asked = tuple(one for one in constraints_of(stated) if one.is_active)
        moving = (name, *platform.scene.world.standing_on(name))
        grounding, phase, before = Grounding(platform, gone=moving), Phase(), platform.belief.pose(name)
        way = goal - np.array(before.position[:2])
        heading = math.atan2(way[1], way[0])
        asked = (*asked, *self._hand(asked, device, arm, before, heading))
        motion = grounding.grounded(asked, phase)
        plane = Plane.of(motion, action)
        reach = platform.scene.bodies.block(name).support(heading)
        points = self._points(before, goal, reach + lead)
        places = np.column_stack([moved(inverse(before.matrix()), points[:, :3]), points[:, 3]])
        lap = await self.stroke(grounding, phase, asked, plane, places, closed=False)
        link, length = platform.robot.arm(arm.name).tip, float(np.hypot(*way))
        gone = arm.solver.chain.fk(lap.positions)[:, :2, 3] @ _ahead(heading - platform.base()[2])
        end = int(gone.argmax())
        poses = {one: platform.belief.pose(one) for one in moving}
        far: float | None = None
        try:
            await self.gone(motion, Trajectory(lap.names, lap.positions[: end + 1]), pushes=link)
            far = length if self._feels(arm, heading) else 0.0
            await self.gone(motion, Trajectory(lap.names, lap.positions[end:]), pushes=link)
        finally:
            if far is None:  # the hand was stopped, or what moves it: the thing is ahead of it, if it came that far
                behind = np.array(platform.world.link_pose(link).position[:2]) - poses[name].position[:2]
                far = float(np.clip(behind @ _ahead(heading) + reach + lead, 0.0, length))
            self._believe(poses, far * _ahead(heading))
        await HandWork(platform).tuck(platform.arms.untucked())
        if far:
            await HandWork(platform).look(name)
        else:
            platform.sensing.not_seen(name)
            await perform(look_for("LookingForSomething", object_acted_on=platform.scene.bodies.designator(name)))
        came = np.array(platform.belief.pose(name).position[:2]) - points[-3, :2]
        return max(0.0, float(came @ _ahead(heading)) - reach)

    def _feels(self, arm: ArmModel, heading: float) -> bool:
        """Return whether a hand feels something ahead of it: what it has pushed is still there."""
        touches = self.platform.world.touches(arm.hand_links)
        return any(-np.array(touch.normal[:2]) @ _ahead(heading) > AHEAD for touch in touches)

    def _hand(
        self, asked: Sequence[MotionConstraint], device: Device, arm: ArmModel, pose: Pose, heading: float
    ) -> Iterator[MotionConstraint]:
        """Yield how a hand is turned that pushes a thing at a pose along a heading."""
        ahead, up = (pose.rotation.T @ one for one in ([*_ahead(heading), 0.0], [0.0, 0.0, 1.0]))
        for own, direction, (lower, upper), name in (
            (arm.frame.approach, ahead, LEANS, "hand leans ahead"),
            (arm.frame.closing, ahead, ACROSS, "fingers side by side"),
            (arm.frame.closing, up, ACROSS, "fingers level"),
        ):
            tool, world = (
                a_feature("LINE", of=of, position=(0.0, 0.0, 0.0), direction=tuple(map(float, along)))
                for of, along in ((device, own), (asked[0].world.of, direction))
            )
            yield a_constraint("PERPENDICULARITY", tool, world, lower=lower, upper=upper, name=name)

    def _points(self, pose: Pose, goal: Array, reach: float) -> Array:
        """Return the way of the tip (n, 4) in the map: down, ahead up to so far behind a place (2,), back, and up."""
        here = np.array(pose.position[:2])
        length = float(np.hypot(*(goal - here)))
        ahead = (goal - here) / length
        along = np.linspace(-reach - BEHIND, length - reach, 2 + math.ceil((length + BEHIND) / STEP))
        back = length - reach - BEHIND
        along = np.concatenate([along[:1], along, [back, back]])
        points = np.column_stack([here + along[:, None] * ahead, np.full(len(along), pose.position[2]), 0.0 * along])
        points[[0, -1], 3] = OVER
        return points

    def _believe(self, poses: Mapping[str, Pose], way: Array) -> None:
        """Believe that things that were at some poses were pushed along a way (2,)."""
        shift = Pose((*way.tolist(), 0.0))
        for name, pose in poses.items():
            self.platform.belief.pushed(name, shift @ pose)
        self.platform.sync()


def _ahead(heading: float) -> Array:
    """Return the unit vector (2,) of a heading."""
    return np.array([math.cos(heading), math.sin(heading)])
