"""Feel for a thing that a robot without a camera has missed: strokes of a hand over what the thing stands on.

Each stroke is a guarded move: the closed hand, pointing down, goes straight ahead until a contact stops it. How wide a
strip it feels over follows from the shape of the hand and the height of the thing. A round thing is known by one touch,
another one by a second, across the first. Where the arm does not get to, the base drives on.
"""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import suppress
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from executive.belief.obstacles import EDGE, NAMES
from executive.belief.scene_collisions import BasePose
from executive.locations.demands import goals_of
from executive.locations.grasp_candidates import UP
from executive.modules.arm.hand_work import HandWork
from executive.modules.arm_paths import ArmPaths
from executive.modules.platform import Platform
from executive.modules.runner import Skill
from executive.modules.tools.strokes import slowed
from executive.motion import MotionError, time_curve
from executive.robots.arms import ArmModel
from planlang.designators import Location, a_location
from planlang.failures import (
    DesignatorFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    NavigationFailure,
    ObjectNotFound,
    ObjectNowhereToBeFound,
    PlanFailure,
)
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, moved, product, rigid
from planlang.language.performing import actions_around
from planlang.language.remaining import remaining_actions
from planlang.protocols import MotionState, Touch, Trajectory
from planlang.records import dataclass

WITHIN = 0.5
"""Distance from where a thing is believed to be up to which it is felt for [m]: on a table that may have been moved."""
MOVED = 0.2
"""Distance by which the support may have been moved, so that the thing stands beyond its believed edge [m]."""
LEAST_HEIGHT = 0.05
"""Height of the lowest things that are felt for [m]: others are as low as the fingers over their support."""
OVER = 0.02
"""Height of the fingertips over the support [m]."""
BELOW_TOP = 0.02
"""Depth below the top of the thing to which a part of the hand has to reach in order to feel it [m]."""
STEP = 0.05
"""Spacing of the waypoints of a stroke, and of the points that are felt over [m]."""
SPEED = 0.12
"""Speed of a stroke [m/s]: the hand stops within the 4 mm of one step of the world."""
JUMP = 0.6
"""Largest change of a joint between two waypoints [rad, m]."""
LEANS = (0.0, 0.4, 0.8)
"""Angles between the hand and the vertical to try, least first: one that leans ahead gets farther [rad]."""
SHORTEST = 3
"""Least number of waypoints of a stroke."""
MOST_STROKES = 20
"""Strokes for one thing."""
MOST_BASES = 3
"""Base poses from which to feel for it, beside the first."""
WORTH = 0.1
"""Share of the points within reach of a base pose, of all, from which on it is worth driving there."""
LEVEL = 0.5
"""Least horizontal share of the normal of a touch at the side of a thing."""
HEIGHTS = 0.01
"""Tolerance of the heights at which a thing is touched [m]."""
FLAT = 0.2
"""Sine of the angle between the normals of a touch and of a side of the thing up to which that side was touched."""
ITS_OWN = 0.05
"""Distance from a touch up to which a body that does not move, or a person, explains it [m]."""
DRAWN_BACK = (0.05, 0.03)
"""Distances to try by which the hand leaves the thing that it has felt [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Stroke:
    """A straight motion of a hand, and the points that it feels over, by number."""

    arm: ArmModel
    waypoints: Array
    """Joint positions (n, d)."""
    ahead: Array
    """Unit direction in the map (3,)."""
    over: NDArray[np.intp]


class Feeler(HandWork):
    """Feels for one thing with an empty hand."""

    def __init__(self, platform: Platform, name: str) -> None:
        super().__init__(platform)
        self._name, self._first = name, platform.scene.bodies.pose(name)
        self._block = platform.scene.bodies.block(name)
        cosine, sine = math.cos(self._block.yaw), math.sin(self._block.yaw)
        self._axes = np.array([[cosine, sine], [-sine, cosine]])
        """Directions of the thing's own axes (2, 2)."""
        self._points = self._where()
        self._felt = np.zeros(len(self._points), np.bool_)
        """Which points a hand has felt over."""

    async def find(self) -> None:
        """Feel for the thing, and come near to it: it is then believed where it was felt.

        Raises ObjectNowhereToBeFound if it was not felt, ObjectNotFound if no hand is free, or it is too low.
        """
        if self._block.high - self._block.low < LEAST_HEIGHT:
            raise ObjectNotFound(f"{self._name} is too low to be felt by a hand", what=self._name)
        if not self.free_hands():
            raise ObjectNotFound(f"no hand is free to feel for {self._name}", what=self._name)
        if not await self._find_met():
            failures = (ManipulationFailure, NavigationFailure, ObjectNotFound)
            await Skill(self._strokes, self._feel, failures=failures, most=MOST_STROKES, otherwise=self._nowhere).run()
        await self._come_near()

    async def _find_met(self) -> bool:
        """Feel beside what the robot has run into where the thing may be; return whether it is the thing."""
        platform, belief = self.platform, self.platform.belief
        for name in [one for one in belief.names() if one in NAMES]:
            at = np.array(belief.pose(name).position)
            is_high = self._block.low <= at[2] <= self._block.high + EDGE
            if not is_high or float(np.hypot(*(self._points - at[:2]).T).min()) > STEP:
                continue
            belief.forget((name,))
            arm = self.free_hands()[0]
            with suppress(ManipulationFailure):
                await platform.hands.move(arm, closed=True)
                there = await self._beside(arm, self._ahead(arm), self._at(at))
                if there is not None:
                    await self._found(arm, self._ahead(arm), there)
                    return True
        return False

    async def _nowhere(self, problem: PlanFailure | None, tried: int) -> PlanFailure:
        where = "the map has it" if self.platform.belief.by_map_alone(self._name) else "it was last"
        rest = 1.0 - float(self._felt.mean())
        beyond = f"; {rest:.0%} of that was out of reach of the hand" if rest >= WORTH else ""
        told = f"{self._name} was not felt within {100 * WITHIN:.0f} cm of where {where}, in {tried} strokes{beyond}"
        return ObjectNowhereToBeFound(told, what=self._name)

    # Where to feel

    def _where(self) -> Array:
        """Sample the points (n, 2) of the map where the thing may be, nearest to where it is believed first."""
        steps = np.arange(-WITHIN, WITHIN + STEP / 2, STEP)
        offsets = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        offsets = offsets[np.argsort(np.hypot(*offsets.T).round(6), kind="stable")]
        points: Array = np.array(self._first.position[:2]) + offsets[np.hypot(*offsets.T) <= WITHIN]
        support = self.platform.sensing.support_of(self._name)
        return points if support is None else np.asarray(points[support.distance(points) <= MOVED])

    async def _strokes(self) -> AsyncIterator[Stroke | None]:
        """Yield strokes over what was not felt over yet: from here, then from where the base can get."""
        for stroke in self._from_here():
            yield stroke
        for base in islice(self._bases(), MOST_BASES):
            try:
                await self.tuck()
                await self.drive(base)
            except (ManipulationFailure, NavigationFailure):
                continue
            for stroke in self._from_here():
                yield stroke

    def _bases(self) -> Iterator[BasePose]:
        """Yield base poses from which the thing could be grasped if it were where nobody has felt yet."""
        platform, tried = self.platform, set[int]()
        while not platform.robot.base.fixed and (~self._felt).mean() >= WORTH:
            left = [number for number in np.flatnonzero(~self._felt).tolist() if number not in tried]
            middle = self._points[~self._felt].mean(axis=0)
            away = [float(np.hypot(*(self._points[number] - middle))) for number in left]
            if not left:
                return
            number = left[int(np.argmin(away))]
            tried.update(one for one in left if np.hypot(*(self._points[one] - self._points[number])) <= WITHIN / 2)
            resolver = platform.resolver.when(
                platform.belief.state.placed({self._name: self._at(self._points[number])})
            )
            with suppress(DesignatorFailure):
                yield next(resolver.bases(self._in_reach())).base

    def _at(self, point: Array) -> Pose:
        return Pose((float(point[0]), float(point[1]), self._first.position[2]), self._first.orientation)

    def _in_reach(self) -> Location:
        return a_location(in_reach_of=self.platform.scene.bodies.designator(self._name))

    # Strokes from here

    def _from_here(self) -> Iterator[Stroke | None]:
        """Yield strokes away from the robot, the one through where the thing is believed first."""
        planning = self._planned()
        for arm in self.free_hands():
            ahead = self._ahead(arm)
            across = np.array([-ahead[1], ahead[0], 0.0])
            width = self._width(arm)
            for number in range(1 + 2 * math.ceil(WITHIN / width)):
                aside = width * ((number + 1) // 2) * (1.0 if number % 2 else -1.0)
                yield None
                stroke = self._stroke(planning, arm, ahead, across, aside, width)
                if stroke is not None:
                    yield stroke

    def _ahead(self, arm: ArmModel) -> Array:
        """Compute the unit direction (3,) of the map from an arm to where the thing is believed."""
        shoulder = moved(Pose.planar(*self.platform.base()).matrix(), arm.shoulder_low[None])[0]
        away = np.array(self._first.position[:2]) - shoulder[:2]
        return np.array([*(away / max(float(np.hypot(*away)), 1e-9)), 0.0])

    def _width(self, arm: ArmModel) -> float:
        """Compute the width of the strip in which a stroke feels the middle of the thing [m]."""
        along = arm.hand_corners @ np.array(arm.frame.approach)
        height = self._tip(arm) - self._block.low - along
        lateral = np.abs(arm.hand_corners @ np.array(arm.frame.closing))
        reaching = height <= self._block.high - self._block.low - BELOW_TOP
        return float(lateral[reaching].max(initial=STEP / 2)) * 2 + min(self._block.half_x, self._block.half_y)

    def _tip(self, arm: ArmModel) -> float:
        """Compute the height of the tip with the fingertips over the support [m]."""
        return self._block.low + OVER + max(float((arm.hand_corners @ np.array(arm.frame.approach)).max()), 0.0)

    def _stroke(
        self, planning: Platform, arm: ArmModel, ahead: Array, across: Array, aside: float, width: float
    ) -> Stroke | None:
        """Plan a stroke at an offset [m] from where the thing is believed; None if it would feel over nothing new."""
        middle = np.array(self._first.position[:2])
        forward, lateral = (self._points - middle) @ ahead[:2], (self._points - middle) @ across[:2]
        strip = (np.abs(lateral - aside) <= width / 2) & ~self._felt
        if not strip.any():
            return None
        # it begins before the strip, so that the hand comes down beside the thing
        margin = max(self._block.half_x, self._block.half_y) + STEP
        places = np.arange(float(forward[strip].min()) - margin, float(forward[strip].max()) + STEP, STEP)
        line = np.array([*middle, self._tip(arm)]) + aside * across + places[:, None] * ahead
        rows, first = self._best(planning, arm, line, ahead)
        if len(rows) < SHORTEST:
            return None
        over = np.flatnonzero(strip & (forward >= places[first]) & (forward <= places[first + len(rows) - 1]))
        return Stroke(arm, rows, ahead, over) if len(over) else None

    def _best(self, planning: Platform, arm: ArmModel, line: Array, ahead: Array) -> tuple[Array, int]:
        """Find how a hand follows most of a line (n, 3): postures (m, d), and the number of the first point."""
        across = np.array([-ahead[1], ahead[0], 0.0])
        best, begin = np.zeros((0, len(arm.joints))), 0
        for lean in LEANS:
            approach = math.sin(lean) * ahead - math.cos(lean) * UP
            for closing in (across, -across):
                rotation = arm.frame.rotation(approach, closing)
                rows, first = self._reached(planning, arm, [rigid(rotation, point) for point in line])
                if len(rows) > len(best):
                    best, begin = rows, first
        return best, begin

    def _reached(self, planning: Platform, arm: ArmModel, poses: Sequence[Array]) -> tuple[Array, int]:
        """Find the longest row of map poses (4, 4) that an arm reaches one after the other: postures, and the first."""
        base = planning.base()
        back, current = inverse(Pose.planar(*base).matrix()), planning.arm_joints(arm)
        quick, contacts = planning.scene.collisions.quick_check(arm, None), planning.scene.collisions.contacts
        rows: list[Array] = []
        best, begin = np.zeros((0, len(arm.joints))), 0
        for number, pose in enumerate(poses):
            seeds = rows[-1][None] if rows else np.vstack([current[None], arm.seeds])
            q, ok = arm.solve(product(back, pose)[None], seeds[None])
            follows = ok[0] and (not rows or np.abs(q[0] - rows[-1]).max() <= JUMP)
            if follows:
                (pairs,) = quick.doubtful(q)
                follows = not (pairs is None or pairs) or not contacts(base, arm, q[0], among=pairs)
            rows = [*rows, q[0]] if follows else []
            if len(rows) > len(best):
                best, begin = np.stack(rows), number + 1 - len(rows)
        return best, begin

    # Guarded moves

    async def _feel(self, stroke: Stroke) -> None:
        """Make a stroke, until the thing is felt. Raises ObjectNotFound if the hand did not feel it."""
        platform, arm = self.platform, stroke.arm
        await platform.hands.move(arm, closed=True)
        try:
            path = self._planning().path(arm, stroke.waypoints[0])
        except MotionError as problem:
            raise ManipulationPoseUnreachable(arm=arm.name, what=f"where a hand feels for {self._name}") from problem
        touch = await self._guarded(arm, path) or await self._guarded(arm, self._slow(arm, stroke.waypoints))
        if touch is None:
            tip = platform.scene.arms.tip(arm)[:3, 3] - np.array(self._first.position)
            local = self._points[stroke.over] - np.array(self._first.position[:2])
            self._felt[stroke.over[local @ stroke.ahead[:2] <= float(tip @ stroke.ahead) + STEP]] = True
            raise ObjectNotFound(f"{self._name} was not felt", what=self._name)
        there = self._told(touch)
        if there is None:
            await self._draw_back(arm, UP)
            about = self._at(np.array(touch.point))
            there = await self._beside(arm, stroke.ahead, about) or about
        else:
            await self._draw_back(arm, -stroke.ahead)
        await self._found(arm, stroke.ahead, there)

    async def _found(self, arm: ArmModel, ahead: Array, there: Pose) -> None:
        """Record where the thing was felt, after a second touch if it is not round; it explains what was met there."""
        belief = self.platform.belief
        if not self._block.round:
            there = await self._across(arm, ahead, there)
        belief.felt(self._name, there)
        block = self.platform.scene.bodies.block(self._name)
        met = (one for one in belief.names() if one in NAMES)
        belief.forget([one for one in met if block.away(np.array(belief.pose(one).position)) <= EDGE])

    def _planned(self, there: Pose | None = None) -> Platform:
        """Make the platform on which motions are planned, as if the thing were at a pose, or nowhere."""
        state = self.platform.belief.state.placed({self._name: there})
        return self.platform.supposing(self.platform.scene.supposing(state))

    def _planning(self, there: Pose | None = None) -> ArmPaths:
        return ArmPaths(self._planned(there), self.platform.rng)

    def _slow(self, arm: ArmModel, waypoints: Array) -> Trajectory:
        """Time a stroke through waypoints (n, d) so that the hand stops where it feels something."""
        path = self.platform.timed(arm.joints, waypoints, time_curve)
        if not arm.chain.within(path.positions, 1e-6).all():  # a curve may leave the limits of the joints
            path = self.platform.timed(arm.joints, waypoints)
        least = STEP * (len(waypoints) - 1) / SPEED * self.platform.world.rate
        return slowed(path, max(1.0, least / max(len(path.positions) - 1, 1)))

    async def _guarded(self, arm: ArmModel, path: Trajectory) -> Touch | None:
        """Move until a contact; return a touch of the thing, None if the motion arrived.

        Raises ManipulationGoalInCollision if something else is in the way, and records that.
        """
        motion = await self.platform.follow(arm.name, path)
        if motion.state is MotionState.DONE:
            return None
        if motion.touch is not None and (self._told(motion.touch) is not None or self._is_on_top(motion.touch)):
            return motion.touch
        met = await self.platform.sensing.bump(motion)
        raise ManipulationGoalInCollision(arm=arm.name, what=self._name, blocked_by=met)

    def _told(self, touch: Touch) -> Pose | None:
        """Conclude where the thing stands from a touch at its side; None if something else explains that."""
        point, normal = np.array(touch.point), np.array([*touch.normal[:2], 0.0])
        share, block = float(np.linalg.norm(normal)), self._block
        at_side = share >= LEVEL and block.low - HEIGHTS <= point[2] <= block.high + HEIGHTS
        if not at_side or self._is_explained(point):
            return None
        normal /= share
        along, across = float(normal[:2] @ self._axes[0]), float(normal[:2] @ self._axes[1])
        if not block.round and min(abs(along), abs(across)) > FLAT:  # a vertical edge: it tells both coordinates
            corner = math.copysign(block.half_x, along), math.copysign(block.half_y, across)
            return self._at(point[:2] - np.array(corner) @ self._axes)
        return self._at(point - block.support(math.atan2(normal[1], normal[0])) * normal)

    def _is_on_top(self, touch: Touch) -> bool:
        """Check whether a hand that came down has touched the top of the thing."""
        point = np.array(touch.point)
        is_above = touch.normal[2] > LEVEL and abs(point[2] - self._block.high) <= HEIGHTS
        return is_above and not self._is_explained(point)

    def _is_explained(self, point: Array) -> bool:
        """Check whether something else explains a touch at a point (3,): it is there, or is believed nearer to it."""
        bodies, belief = self.platform.scene.bodies, self.platform.belief
        mine = bodies.block(self._name).away(point)
        others = (one for one in bodies.names() if one != self._name and one not in NAMES and bodies.is_solid(one))
        for name in others:
            distance = bodies.from_walls(name, point) if bodies.is_room(name) else bodies.block(name).away(point)
            is_other = bodies.is_graspable(name) and name not in belief.held and distance < mine
            stays = bodies.is_person(name) or not bodies.is_movable(name)
            if is_other or (stays and distance <= ITS_OWN):
                return True
        return False

    async def _draw_back(self, arm: ArmModel, direction: Array) -> None:
        """Leave the thing by some centimetres, so that the next motion begins clear of it."""
        path = self.platform.arms.drawn(arm, (far * direction for far in DRAWN_BACK), self._name)
        if path is not None:
            with suppress(ManipulationFailure):
                await self.follow_to_end(arm.name, path, self._name)

    async def _beside(self, arm: ArmModel, ahead: Array, there: Pose) -> Pose | None:
        """Feel from all sides for a thing that is about at a pose; None without a touch."""
        across = np.array([-ahead[1], ahead[0], 0.0])
        for side in (ahead, across, -across, -ahead):
            if (told := await self._felt_from(arm, there, side)) is not None:
                return told
        return None

    async def _across(self, arm: ArmModel, ahead: Array, there: Pose) -> Pose:
        """Feel once more across a first touch of a thing that is not round; its pose by both."""
        across = np.array([-ahead[1], ahead[0], 0.0])
        for side in (across, -across):
            if (told := await self._felt_from(arm, there, side)) is not None:
                shift, normal = np.array(told.position) - np.array(there.position), self._normal(side)
                return self._at(np.array(there.position[:2]) + float(shift @ normal) * normal[:2])
        return there

    def _normal(self, side: Array) -> Array:
        """Select the normal (3,) of the thing's side that a hand which moves in a direction (3,) meets."""
        axes = np.vstack([self._axes, -self._axes])
        return np.array([*axes[int(np.argmin(axes @ side[:2]))], 0.0])

    async def _felt_from(self, arm: ArmModel, there: Pose, side: Array) -> Pose | None:
        """Feel in a direction (3,) for a thing that is about at a pose; None without a touch."""
        half = max(self._block.half_x, self._block.half_y)
        middle = np.array([*there.position[:2], self._tip(arm)])
        line = middle + np.arange(-2 * half - 3 * STEP, half, STEP)[:, None] * side
        rows = self._best(self._planned(), arm, line, side)[0]
        if len(rows) < SHORTEST:
            return None
        with suppress(MotionError, ManipulationFailure):
            if await self._guarded(arm, self._planning(there).path(arm, rows[0])) is None:
                touch = await self._guarded(arm, self._slow(arm, rows))
                if touch is not None and (told := self._told(touch)) is not None:
                    await self._draw_back(arm, -side)
                    return told
        return None

    # Afterwards

    async def _come_near(self) -> None:
        """Drive to where the thing, and what it is taken to next, are in reach, if they are not from here."""
        platform = self.platform
        goals = goals_of(self._name, (*actions_around(), *remaining_actions()), platform.scene)[:1]
        what = platform.scene.bodies.designator(self._name)
        for location in (*(a_location(in_reach_of=(what, goal)) for goal in goals), self._in_reach()):
            with suppress(DesignatorFailure, ManipulationFailure, NavigationFailure):
                if platform.resolver.satisfies(location, platform.base()) is not None:
                    return
                if platform.robot.base.fixed or not platform.resolver.is_possible(location):
                    continue
                base = next(platform.resolver.bases(location)).base
                await self.tuck()
                await self.drive(base)
                return
