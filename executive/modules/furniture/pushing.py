"""Process module that pushes an object along its support with a closed hand.

A stroke under the constraints of the motion: the hand comes down behind the object, moves straight ahead, back, and up
again. The robot then looks where the object is, and pushes again if that is not near enough. If the hand feels nothing
ahead of it at the end of a stroke, the object has not moved with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice

import numpy as np

from executive.locations.shut_ways import check_way_to
from executive.modules.furniture.leaf_pushing import LeafStrokes
from executive.modules.platform import Platform
from executive.modules.runner import Skill
from executive.modules.tools.motion_grounding import Grounding, constraints_of
from executive.modules.tools.strokes import Plane, StrokeWork
from executive.robots.arms import ArmModel
from planlang.designators import Action, Device, Location, Object, a_location, resting_on
from planlang.designators import action as look_for
from planlang.failures import (
    ActionUnresolvable,
    EnvironmentManipulationFailure,
    LookingFailure,
    ManipulationGoalNotReached,
    ManipulationPoseUnreachable,
    ObjectNowhereToBeFound,
    PerceptionFailure,
    PlanFailure,
)
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, moved
from planlang.geometry.shapes import corners
from planlang.language.performing import actions_around, perform
from planlang.language.process_module import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied, MotionConstraint, a_constraint, a_feature
from planlang.protocols import Trajectory
from planlang.records import dataclass
from sim import BodyShape

NEAR = 0.02
"""Tolerance of the distance by which an object was pushed [m]."""
LEAST = 0.02
"""Shortest push [m]."""
PUSHES = 12
"""Most ways of pushing one object that are tried, whether they fail or move it: the hand may lose it sideways."""
PLACES = 6
"""Most goal positions, or directions, to try for one push."""
LOOKED_AT = 30
"""Samples of a location among which to find positions that a straight push reaches."""
LEAD = 0.02
"""Distance of the tip from the pushed object to assume for the first push; measured afterwards [m]."""
BEHIND = 0.05
"""Clearance between hand and object where the hand comes down and goes up again [m]."""
OVER = 0.08
"""Height of the hand above the stroke before and after it [m]."""
STEP = 0.05
"""Spacing of waypoints [m]."""
TURNED = tuple(sign * turn * math.pi / 8 for turn in range(9) for sign in (1, -1)[: 1 + (0 < turn < 8)])
"""Directions to try for a push by a distance, relative to straight away from the robot [rad]."""
SQUARE = 0.35
"""Largest angle between the push and a side of an object at which it hardly turns [rad]."""
LEANS = (0.2, 0.85)
"""Cosines between the hand's approach and the push, so that the fingers touch the object first."""
ACROSS = (-0.15, 0.15)
"""Cosines of the closing direction with the push and with the vertical: fingers side by side keep the object ahead."""
ASIDE = 0.02
"""Clearance beside the path of an object [m]."""
AHEAD = 0.3
"""Least component of a contact normal against the push for a touch to count as ahead of the hand."""
LOWER = 0.01
"""Difference of heights within which an object is on the same level [m]."""


@dataclass(frozen=True, slots=True)
class ToLocation:
    """Goal of having an object at a location, on its current level."""

    platform: Platform
    name: str
    what: Object
    location: Location

    async def is_there(self) -> bool:
        """Check whether the object satisfies the location."""
        return self.platform.resolver.holds(self.location, self.what)

    def places(self) -> Iterable[Array]:
        """Sample positions at the location, those first to which a push hardly turns the object."""
        x, y, height = self.platform.scene.bodies.pose(self.name).position
        poses = self.platform.resolver.best_things(self.location, self.what, LOOKED_AT)
        level = [np.array(pose.position[:2]) for pose in poses if abs(pose.position[2] - height) <= LOWER]
        return sorted(level, key=lambda place: not self._is_square(place - (x, y)))

    def _is_square(self, push: Array) -> bool:
        block = self.platform.scene.bodies.block(self.name)
        angle = (math.atan2(push[1], push[0]) - block.yaw) % (math.pi / 2)
        return block.round or min(angle, math.pi / 2 - angle) <= SQUARE


@dataclass(frozen=True, slots=True)
class ByDistance:
    """Goal of having an object at a distance from its start in any direction, preferably away from the robot."""

    platform: Platform
    name: str
    distance: float
    start: Array
    """Position of the object at the start (2,)."""

    def _here(self) -> Array:
        return np.array(self.platform.belief.pose(self.name).position[:2])

    async def is_there(self) -> bool:
        """Check whether the object is at the distance from its start."""
        return abs(math.dist(self._here(), self.start) - self.distance) <= NEAR

    def places(self) -> Iterable[Array]:
        """Sample positions around the start, straight ahead first."""
        shift = self._here() - self.start
        away = shift if np.hypot(*shift) > LEAST else self.start - self.platform.base()[:2]
        heading = math.atan2(away[1], away[0])
        return [self.start + self.distance * _ahead(heading + turn) for turn in TURNED]


Goal = ToLocation | ByDistance
"""Goal of pushing an object: whether it is believed to be there, and positions (2,) for its centre, best first."""


class ThingStrokes(StrokeWork):
    """Pushes one object to its goal."""

    def __init__(self, platform: Platform, action: Action, name: str, goal: Goal) -> None:
        super().__init__(platform)
        self._action, self._name, self._goal, self._lead = action, name, goal, LEAD

    async def push(self) -> None:
        """Push until the object is at its goal.

        Raises BehindClosedDoor if a door between rooms keeps the base from it, ManipulationPoseUnreachable if no hand
        gets behind it, and ManipulationGoalNotReached if it does not arrive.
        """
        if not self.platform.belief.seen_from_here(self._name):
            check_way_to(self.platform.scene, self._name)
        await Skill(
            self._ways,
            self._pushed,
            approach=lambda way: self.close_hand(way[1]),
            between=self._again,
            most=PUSHES,
            otherwise=self._not_there,
        ).until(self._goal.is_there)

    def _ways(self) -> Iterator[tuple[Array, ArmModel]]:
        """Yield positions (2,) to which a straight push is free, each with the hands that may make it."""
        here = self.platform.belief.pose(self._name).position[:2]
        places = (one for one in self._goal.places() if math.dist(one, here) > LEAST and self._is_free(one))
        for place in islice(places, PLACES):
            hands = self.hands_for(self._name, self._name, ManipulationGoalNotReached)
            yield from ((place, arm) for arm in self.platform.arms.in_order(hands))

    async def _again(self) -> None:
        await self.tuck()
        await self.look(self._name)

    async def _not_there(self, problem: PlanFailure | None, tried: int) -> PlanFailure:
        missing = f"{self._name} is not at its goal after {tried} pushes"
        if tried < PUSHES:
            missing = f"no straight path to its goal is free for {self._name}"
        return problem or ManipulationGoalNotReached(missing, what=self._name)

    def _out_of_reach(self, problem: ConstraintsUnsatisfied) -> ManipulationPoseUnreachable:
        """Make the failure of a push for which no hand gets behind the object, with what would help."""
        name, block = self._name, problem.blocked_by
        blocked = "" if block is None else f", because {block} is in the way"
        support = self.platform.scene.world.support(name)
        edge = "" if support is None else f" nearer to the edge of {support}"
        message = (
            f"no hand gets behind {name} to push it{blocked}: move it{edge}, "
            "clear the space around it, or push it elsewhere (toLocation)"
        )
        return ManipulationPoseUnreachable(message, arm=problem.arm, what=name, blocked_by=block)

    def _is_free(self, goal: Array) -> bool:
        """Check whether an object can move straight to a position (2,) without collision and stay on its support."""
        name, world, bodies = self._name, self.platform.scene.world, self.platform.scene.bodies
        pose, block = bodies.pose(name), bodies.block(name)
        push = goal - np.array(pose.position[:2])
        length, heading = float(np.hypot(*push)), math.atan2(push[1], push[0])
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
            local = (box[:, :2] - pose.position[:2]) @ np.column_stack([ahead, across])
            low, high = [-half[0] + ASIDE, -half[1]], [length + half[0], half[1]]
            if (local.max(axis=0) > low).all() and (local.min(axis=0) < high).all():
                return False
        return support is None or self._stands(goal, support)

    def _stands(self, goal: Array, support: str) -> bool:
        """Check whether an object would stand on the same support at a position (2,)."""
        name, scene, pose = self._name, self.platform.scene, self.platform.scene.bodies.pose(self._name)
        there = Pose((float(goal[0]), float(goal[1]), pose.position[2]), pose.orientation)
        world = scene.supposing(scene.belief.state.placed({name: there})).world
        return world.support(name) == support and abs(world.height_above_support(name)) <= LOWER

    async def _pushed(self, way: tuple[Array, ArmModel]) -> None:
        """Push the object once towards a position (2,) with one hand, update the belief, and look."""
        (goal, arm), name, action = way, self._name, self._action
        platform, device = self.platform, arm.part.hand
        stated = replace(action, properties=tuple(sorted({**dict(action.properties), "device_used": device}.items())))
        constraints = tuple(one for one in constraints_of(stated) if one.is_active)
        moving = (name, *platform.scene.world.standing_on(name))
        before = platform.belief.pose(name)
        push = goal - np.array(before.position[:2])
        heading = math.atan2(push[1], push[0])
        constraints = (*constraints, *self._hand(constraints, device, arm, before, heading))
        grounding = Grounding(platform, constraints, gone=moving)
        motion = grounding.grounded()
        plane = Plane.of(motion, action)
        reach = platform.scene.bodies.block(name).support(heading)
        points = self._points(before, goal, reach + self._lead)
        places = np.column_stack([moved(inverse(before.matrix()), points[:, :3]), points[:, 3]])
        try:
            lap = await self.stroke(grounding, plane, places, closed=False)
        except ConstraintsUnsatisfied as problem:  # many of its constraints are none that a recipe states
            raise self._out_of_reach(problem) from None
        link, length = arm.tip, float(np.hypot(*push))
        progress = arm.chain.fk(lap.positions)[:, :2, 3] @ _ahead(heading - platform.base()[2])
        end = int(progress.argmax())
        poses = {one: platform.belief.pose(one) for one in moving}
        distance: float | None = None
        try:
            await self.gone(motion, Trajectory(lap.names, lap.positions[: end + 1]), pushes=link)
            touches = platform.world.touches(arm.hand_links)
            feels = any(-np.array(touch.normal[:2]) @ _ahead(heading) > AHEAD for touch in touches)
            distance = length if feels else 0.0
            await self.gone(motion, Trajectory(lap.names, lap.positions[end:]), pushes=link)
        finally:
            if distance is None:  # the stroke was interrupted: the object is just ahead of the hand, if that reached it
                behind = np.array(platform.world.link_pose(link).position[:2]) - poses[name].position[:2]
                distance = float(np.clip(behind @ _ahead(heading) + reach + self._lead, 0.0, length))
            self._believe(poses, distance * _ahead(heading))
        await self.tuck()
        if distance:
            await self.look(name)
        else:
            platform.sensing.not_seen(name)
            await perform(look_for("LookingForSomething", object_acted_on=platform.scene.bodies.designator(name)))
        gap = np.array(platform.belief.pose(name).position[:2]) - points[-3, :2]
        self._lead = max(0.0, float(gap @ _ahead(heading)) - reach)
        if platform.robot.camera is not None and not platform.belief.seen(name):  # it may have fallen
            await perform(look_for("LookingForSomething", object_acted_on=platform.scene.bodies.designator(name)))

    def _hand(
        self, constraints: Sequence[MotionConstraint], device: Device, arm: ArmModel, pose: Pose, heading: float
    ) -> Iterator[MotionConstraint]:
        """Yield the constraints of a hand's orientation for pushing an object at a pose along a heading."""
        ahead, up = (pose.rotation.T @ one for one in ([*_ahead(heading), 0.0], [0.0, 0.0, 1.0]))
        for own, direction, (lower, upper), name in (
            (arm.frame.approach, ahead, LEANS, "hand leans ahead"),
            (arm.frame.closing, ahead, ACROSS, "fingers side by side"),
            (arm.frame.closing, up, ACROSS, "fingers level"),
        ):
            tool, world = (
                a_feature("LINE", of=of, position=(0.0, 0.0, 0.0), direction=tuple(map(float, along)))
                for of, along in ((device, own), (constraints[0].world.of, direction))
            )
            yield a_constraint("PERPENDICULARITY", tool, world, lower=lower, upper=upper, name=name)

    def _points(self, pose: Pose, goal: Array, reach: float) -> Array:
        """Sample the stroke of the tip (n, 4) in the map, positions and heights: down, ahead, back, and up.

        ``reach``: distance of the tip behind the object's centre at the goal (2,) [m].
        """
        here = np.array(pose.position[:2])
        length = float(np.hypot(*(goal - here)))
        ahead = (goal - here) / length
        along = np.linspace(-reach - BEHIND, length - reach, 2 + math.ceil((length + BEHIND) / STEP))
        back = length - reach - BEHIND
        along = np.concatenate([along[:1], along, [back, back]])
        points = np.column_stack([here + along[:, None] * ahead, np.full(len(along), pose.position[2]), 0.0 * along])
        points[[0, -1], 3] = OVER
        return points

    def _believe(self, poses: Mapping[str, Pose], push: Array) -> None:
        """Update the belief: objects that were at ``poses`` have been shifted by (2,) in the map."""
        shift = Pose((*push.tolist(), 0.0))
        for name, pose in poses.items():
            self.platform.belief.pushed(name, shift @ pose)


@process_module
class Pushing(StrokeWork):
    """Pushes objects, and leaves such as doors shut."""

    name = "pushing"
    actions = ("PushingMotion",)
    failures = (EnvironmentManipulationFailure, *StrokeWork.failures, ObjectNowhereToBeFound)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the whole robot."""
        return self.whole_robot()

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Push ``object_acted_on`` to its goal; return (), as no constraint is dropped.

        Raises BehindClosedDoor, ManipulationPoseUnreachable, and ManipulationGoalNotReached if it does not arrive.
        """
        platform, what = self.platform, self.object_of(action, "push")
        with suppress(PerceptionFailure, LookingFailure):
            await perform(look_for("LookingForSomething", object_acted_on=what))
        name = platform.scene.bodies.bind(what)
        leaf = next((one for one in platform.belief.joints.values() if name in one.bodies and not one.is_knob), None)
        if leaf is not None:
            await LeafStrokes(platform, leaf).shut()
            return ()
        if name in platform.belief.held:
            raise ActionUnresolvable(f"{name} is held in a hand; put it down to push it", designator=str(action))
        if not platform.scene.bodies.is_movable(name):
            raise ActionUnresolvable(f"{name} cannot be pushed, because it is not movable", designator=str(action))
        await ThingStrokes(platform, action, name, self._goal(action, name)).push()
        return ()

    def _goal(self, action: Action, name: str) -> Goal:
        """Read the goal of an object from the action, or from one that encloses it."""
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
            raise ActionUnresolvable(
                "state a goal of the push: to_location or distance_translated", designator=str(action)
            )
        return ByDistance(self.platform, name, distance, np.array(bodies.pose(name).position[:2]))


def _ahead(heading: float) -> Array:
    """Compute the unit vector (2,) of a heading."""
    return np.array([math.cos(heading), math.sin(heading)])
