"""Process module that wipes a surface: it moves a tool over all free parts of it, lane by lane."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import field, replace
from functools import partial
from itertools import islice

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.modules.platform import Platform
from executive.modules.runner import Skill
from executive.modules.tools.lane_reach import LaneReach, Run, lane_reach
from executive.modules.tools.lanes import HAND, LEVEL, Room, Surface, lifted
from executive.modules.tools.motion_grounding import GroundedMotion, Grounding
from executive.modules.tools.strokes import Plane, Planned, StrokeWork
from executive.robots.arms import called
from planlang.designators import Action
from planlang.failures import (
    ActionUnresolvable,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    NavigationFailure,
    PlanFailure,
)
from planlang.geometry import Array
from planlang.geometry.matrices import moved
from planlang.language.process_module import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied
from planlang.records import dataclass

ENOUGH = 0.8
"""Least share of the free area to wipe."""
SHORT, LONG = 2, 6
"""Fewest waypoints of a part of a lane that is wiped by itself, and of one that is halved when no stroke is found."""
STANDS = 12
"""Most base poses from which to wipe a surface."""
SCREENED, JUDGED = 12, 3
"""Base poses that reach most waypoints and pass the quick check for collisions, and of these the exact one."""
MOST = 48
"""Most base poses to check, SCREENED at a time, while the arm can wipe nothing from any of those before."""
DRIVING = 2.0
"""Waypoints that must be gained by driving one metre, once enough is wiped."""
HERE = 4
"""Consecutive failures of strokes before the base moves on."""
WAYS = 3
"""Ways to make a stroke that are tried: postures, each from both ends of the lane."""
BESIDE, TURNED = 0.12, 0.5
"""Distance and angle within which a base pose is as bad as one from which a lane failed [m], [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class Lane:
    """Lane, or part of one, that is yet to be wiped."""

    places: Array
    """Positions (k, 3) in the object's frame."""
    failed: tuple[BasePose, ...] = ()
    """Base poses from which no stroke was found."""

    def is_due_at(self, base: BasePose) -> bool:
        """Check that the lane has not failed from this base pose or one beside it."""
        return not any(map(partial(_beside, base), self.failed))


@dataclass(slots=True, eq=False)
class Wipe:
    """Surface that is being wiped: what is due, what is done, and why the rest is not."""

    platform: Platform
    motion: GroundedMotion
    pose: Array
    """Pose (4, 4) of the object in the map."""
    room: Room
    """What is free of the surface."""
    reach: LaneReach | None
    """What the arm reaches; None if no posture holds the tool flat."""
    due: list[Lane]
    wiped: list[Array] = field(default_factory=list)
    """Waypoints (k, 4) of the strokes that were made."""
    problems: list[PlanFailure] = field(default_factory=list)

    async def is_done(self) -> bool:
        """Check that nothing is due any more."""
        return not self.due

    def is_enough(self) -> bool:
        """Check that so much was wiped that wiping may end."""
        return self.room.share(self.wiped, self.room) >= ENOUGH

    def in_map(self, lane: Lane) -> Array:
        """Compute the positions (k, 2) of a lane in the map."""
        return np.asarray(moved(self.pose, lane.places)[:, :2])

    # Base poses

    def stands(self) -> Iterator[BasePose]:
        """Yield base poses from which much of what is due can be wiped, the best first.

        Of those that reach most waypoints, what is free of collisions counts. Once enough is wiped, a base pose has to
        be worth the drive.
        """
        bases, driving = self._bases(coarse=True), 1.0 if self.is_enough() else 0.0
        worth = self._worth(bases, driving)
        best = bases[np.argsort(-worth, kind="stable")[:1], :2]
        fine = self._bases(coarse=False)
        fine = fine[np.linalg.norm(fine[:, None, :2] - best, axis=2).min(axis=1, initial=math.inf) < 2 * BESIDE]
        bases, worth = np.concatenate([bases, fine]), np.concatenate([worth, self._worth(fine, driving)])
        screened = self._screened(bases, worth)
        while some := sorted(islice(screened, SCREENED)):
            judged = list[tuple[float, int, BasePose]]()
            for _, number, base in some:
                if len(judged) < JUDGED and (number == 0 or self.platform.standing().poses.has_room(base)):
                    gain = sum(len(next(self.runs(base, lane), ())) for lane in self.due)
                    if gain > driving * (cost := self._cost(bases[number])):
                        judged.append((round(cost - gain, 6), number, base))
            yield from (base for _, _, base in sorted(judged))
            if judged:
                return

    def _screened(self, bases: Array, worth: Array) -> Iterator[tuple[float, int, BasePose]]:
        """Yield some of bases (m, 3) that are worth most and not beside each other: cost less gain, number, pose."""
        chosen: list[BasePose] = []
        for number in np.argsort(-worth, kind="stable").tolist():
            x, y, yaw = bases[number].tolist()
            base = (x, y, yaw)
            if len(chosen) == MOST or worth[number] == -math.inf or self.reach is None:
                return
            if not any(map(partial(_beside, base), chosen)):
                chosen.append(base)
                gain = self.reach.gain(base, [self.in_map(lane) for lane in self.due if lane.is_due_at(base)])
                if gain:
                    yield round(self._cost(bases[number]) - gain, 6), number, base

    def runs(self, base: BasePose, lane: Lane) -> Iterator[Run]:
        """Yield the parts of a lane that can be wiped from a base pose, as far as checks of postures say."""
        if self.reach is None or not lane.is_due_at(base):
            return iter(())
        runs = self.reach.runs(base, self.in_map(lane), self.platform.joints(self.motion.arms[0].joints))
        return (run for run in runs if len(run) >= min(SHORT, len(lane.places)))

    def _bases(self, *, coarse: bool) -> Array:
        """List the free base poses (m, 3) around what is due: the current one and coarse ones, or those between."""
        if not self.due:
            return np.zeros((0, 3))
        standing, points = self.platform.standing(), np.concatenate([self.in_map(lane) for lane in self.due])
        every, is_coarse = standing.lattice(self.motion.arms[0], np.column_stack([points, np.zeros(len(points))]))
        is_coarse[0] = True
        every = every[is_coarse == coarse]
        free = standing.poses.free(every)
        free[:1] |= coarse
        return np.asarray(every[free])

    def _worth(self, bases: Array, driving: float) -> Array:
        """Count the due waypoints that are reached from bases (m, 3), less the cost of driving there (m,).

        It is -inf where they are no more than ``driving`` times that cost.
        """
        if self.reach is None or not len(bases):
            return np.full(len(bases), -math.inf)
        counts = self.reach.counts(bases, [self.in_map(lane) for lane in self.due])
        for number, lane in enumerate(self.due):
            if lane.failed:
                counts[:, number] *= np.array([lane.is_due_at((x, y, yaw)) for x, y, yaw in bases.tolist()])
        gains, costs = counts.sum(axis=1), np.array(list(map(self._cost, bases)))
        return np.where(gains > driving * costs, (gains - costs).round(6), -math.inf)

    def _cost(self, base: Array) -> float:
        return DRIVING * math.dist(base[:2].tolist(), self.platform.base()[:2])

    # What became of lanes

    def done(self, lane: Lane, run: Run) -> None:
        """Note that a part of a lane was wiped; the rest stays due, from the last place that was wiped."""
        self.wiped.append(lifted(lane.places[run.first : run.last + 1]))
        rest = lane.places[: run.first + 1], lane.places[run.last :]
        self._replace(lane, [replace(lane, places=part) for part in rest if len(part) >= SHORT])

    def failed(self, lane: Lane, problem: PlanFailure) -> None:
        """Note that no stroke was found for a lane: its halves are tried; short ones from other base poses only."""
        self.problems.append(problem)
        if len(lane.places) >= LONG:
            middle = len(lane.places) // 2
            halves = lane.places[: middle + 1], lane.places[middle:]
            self._replace(lane, [replace(lane, places=half) for half in halves])
        else:
            self._replace(lane, [Lane(lane.places, (*lane.failed, self.platform.base()))])

    def _replace(self, lane: Lane, others: Sequence[Lane]) -> None:
        self.due = [one for one in self.due if one is not lane] + list(others)

    def within_reach(self) -> list[Array]:
        """List waypoints (k, 4) of what was wiped, and of what is due that some free base pose reaches."""
        if self.reach is None:
            return self.wiped
        bases = np.concatenate([self._bases(coarse=True), self._bases(coarse=False)])
        marks = [(lane, self.reach.reached(bases, self.in_map(lane))) for lane in self.due]
        return [*self.wiped, *(lifted(lane.places[reached]) for lane, reached in marks if reached.any())]


@process_module
class Wiping(StrokeWork):
    """Wipes surfaces."""

    name = "wiping"
    actions = ("WipingMotion",)

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Wipe the surface; return (), as no constraint is dropped. Raises ConstraintsUnsatisfied below ENOUGH.

        The base stands where most of what is due can be wiped, wipes that, and moves on.
        """
        grounding, motion = await self.begun(action)
        plane = Plane.of(motion, action)
        await self._look_from_near(grounding, plane, motion)
        motion = grounding.grounded()
        room = self._room(plane, motion)
        lanes = [Lane(lane[1:-1, :3]) for lane in room.lanes()]
        if not lanes:
            raise self._no_room(plane, motion)
        reach = self._reach(grounding, plane, motion, lanes)
        wipe = Wipe(self.platform, motion, motion.things[plane.thing], room, reach, lanes)
        failures = (ConstraintsUnsatisfied, NavigationFailure, ManipulationPoseUnreachable)
        skill = Skill(
            wipe.stands,
            partial(self._wipe_from_here, wipe, grounding, plane),
            partial(self._stand_at, grounding),
            failures=failures,
            most=STANDS,
        )
        with suppress(*failures):
            await skill.until(wipe.is_done)
        self._straightened()
        later = self._room(plane, motion)  # not counting room that objects seen since then occupy
        if room.share(wipe.wiped, later) < ENOUGH:
            raise self._too_little(plane, wipe, room, later)
        return ()

    async def _look_from_near(self, grounding: Grounding, plane: Plane, motion: GroundedMotion) -> None:
        """Drive to where the surface is visible, if it has not been seen yet: objects on it may have been moved."""
        belief, name = self.platform.belief, self.platform.scene.bodies.bind(plane.thing)
        if belief.seen_from_here(name) or self.platform.robot.camera is None or not self._is_mobile():
            return

        async def look() -> bool:
            await self._look(grounding)
            return belief.seen_from_here(name)

        bases = self.platform.standing().before(motion.things[plane.thing][:2, 3], motion.arms)
        await self.seen_from(lambda: bases, self.drive_with_room, look)

    async def _stand_at(self, grounding: Grounding, base: BasePose) -> None:
        if base != self.platform.base():
            await self.drive_with_room(base)
            await self._look(grounding)

    async def _wipe_from_here(self, wipe: Wipe, grounding: Grounding, plane: Plane, _: BasePose) -> None:
        """Wipe what the arm reaches without driving, near parts first. Raises the first failure if that is nothing."""
        here, done, in_a_row, last = self.platform.base(), len(wipe.wiped), 0, None
        tried: list[Lane] = []
        while in_a_row < HERE:
            lanes = [lane for lane in wipe.due if not any(lane is one for one in tried)]
            if last is not None:
                lanes.sort(key=partial(_away, last))
            lane, runs = next(((one, runs) for one in lanes if (runs := list(wipe.runs(here, one)))), (None, []))
            if lane is None:
                break
            tried.append(lane)
            try:
                run, planned = await self._planned(wipe, grounding, plane, lane, runs)
                await self.gone(planned[0], await self.begin_stroke(planned))
            except (ConstraintsUnsatisfied, ManipulationGoalInCollision) as failure:
                wipe.failed(lane, failure)
                in_a_row += 1
                continue
            wipe.done(lane, run)
            last, in_a_row = lane.places[run.last], 0
        if len(wipe.wiped) == done:
            raise ConstraintsUnsatisfied(arm=wipe.motion.arms[0].name)

    async def _planned(
        self, wipe: Wipe, grounding: Grounding, plane: Plane, lane: Lane, runs: Sequence[Run]
    ) -> tuple[Run, Planned]:
        """Plan a stroke over the longest part of a lane that allows it, from its nearer end, else from the other.

        Raises ConstraintsUnsatisfied.
        """
        start, chain = self._start(wipe.motion), wipe.motion.arms[0].chain
        problem: ConstraintsUnsatisfied | None = None
        ways = []
        for run in runs:
            for step in (1, -1):
                guess = chain.near(run.postures[::step], start)
                away = round(float(np.abs(guess[0] - start).max()), 3)
                ways.append((-len(run), away, run, lane.places[run.first : run.last + 1][::step], guess))
        for _, _, run, places, guess in sorted(ways, key=lambda way: way[:2])[:WAYS]:
            try:
                stroke = self.planned_stroke(grounding, plane, lifted(places), guess, closed=False)
                return run, await stroke
            except ConstraintsUnsatisfied as failure:
                problem = problem or failure
        raise problem or ConstraintsUnsatisfied()

    def _reach(
        self, grounding: Grounding, plane: Plane, motion: GroundedMotion, lanes: Sequence[Lane]
    ) -> LaneReach | None:
        """Compute what the arm reaches over a surface. Raises ActionUnresolvable for one that is not level."""
        upwards = motion.things[plane.thing][:3, :3] @ np.array(plane.height.world.direction)
        if len(motion.arms) > 1 or upwards[2] < LEVEL * float(np.linalg.norm(upwards)):
            name = self.platform.scene.bodies.bind(plane.thing)
            message = f"{name} is not level" if len(motion.arms) == 1 else "one arm wipes, and tools are in several"
            raise ActionUnresolvable(message, designator=str(plane.thing))
        return lane_reach(self.platform, grounding, motion, plane, lifted(lanes[0].places)[1])

    def _no_room(self, plane: Plane, motion: GroundedMotion) -> ConstraintsUnsatisfied:
        """Build the failure for a surface without free positions."""
        name, arm = self.platform.scene.bodies.bind(plane.thing), motion.arms[0].name
        message = f"{name} has no free place for {self.tool(motion)} with {HAND:.2f} m beside it for the hand"
        return ConstraintsUnsatisfied(message, arm=arm, what=name)

    def _too_little(self, plane: Plane, wipe: Wipe, room: Room, later: Room) -> ConstraintsUnsatisfied:
        """Build the failure that reports how much was wiped, and why the rest was not."""
        name, arm = self.platform.scene.bodies.bind(plane.thing), wipe.motion.arms[0]
        obstacle = next((one for one in (getattr(each, "blocked_by", None) for each in wipe.problems) if one), None)
        share, within = (room.share(lanes, later) for lanes in (wipe.wiped, wipe.within_reach()))
        reasons = [] if within > 0.995 else [f"{1 - within:.0%} is out of reach from any side"]
        if wipe.reach is None:
            reasons = [f"no posture of {called(arm.name)} holds {self.tool(wipe.motion)} flat at its height"]
        elif obstacle is not None:
            reasons.append(f"{obstacle} is in the way")
        elif within - share > 0.005:
            reasons.append(f"no stroke of {called(arm.name)} was found for {within - share:.0%}")
        message = f"{share:.0%} of {name} was wiped instead of at least {ENOUGH:.0%}: {'; '.join(reasons)}"
        return ConstraintsUnsatisfied(message, arm=arm.name, what=name, blocked_by=obstacle)

    def _room(self, plane: Plane, motion: GroundedMotion) -> Room:
        name, feature = self.platform.scene.bodies.bind(plane.thing), plane.height.world
        middle, normal = np.array(feature.position), np.array(feature.direction)
        width, length = sorted(self.platform.scene.world.size(self.tool(motion)))[1:]
        surface = Surface(self.platform, name, motion.things[plane.thing], middle, normal, plane.axes())
        return surface.room(width, length)


def _beside(base: BasePose, other: BasePose) -> bool:
    return math.dist(base[:2], other[:2]) < BESIDE and abs(math.remainder(base[2] - other[2], math.tau)) < TURNED


def _away(place: Array, lane: Lane) -> float:
    """Compute the distance of a lane's nearer end from a place (3,) [m]."""
    return round(float(np.linalg.norm(lane.places[[0, -1]] - place, axis=1).min()), 6)
