"""The process module that wipes a surface: it moves a tool over all of it that is free, lane by lane."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from itertools import islice

import numpy as np

from executive.locations.base_poses import BEST
from executive.modules.phases import Phase
from executive.modules.tools.lanes import HAND, Room, Surface, lifted
from executive.modules.tools.motion_grounding import GroundedMotion, Grounding
from executive.modules.tools.strokes import Plane, StrokeWork
from planlang.designators import Action
from planlang.failures import (
    DesignatorFailure,
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    NavigationFailure,
    PerceptionFailure,
    PlanFailure,
)
from planlang.geometry import Array
from planlang.geometry.matrices import moved
from planlang.language.process_module import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied, MotionConstraint
from planlang.protocols import Trajectory

SHORT = 3
"""Places of a lane that is not divided."""
IN_A_ROW = 4
"""Lanes, or halves of lanes, that fail one after another before it is given up: the others are farther away."""
HERE = 4
"""The same from one base pose."""
VIEWS = 5
"""Places of the base from which it is looked at a surface that was not seen yet."""
ENOUGH = 0.8
"""Share of what is free that has to be wiped."""


Stroke = Callable[..., Awaitable[Trajectory]]


@process_module
class Wiping(StrokeWork):
    """Wipes surfaces."""

    name = "wiping"
    actions = ("WipingMotion",)
    failures = (ManipulationFailure, NavigationFailure, PerceptionFailure, LookingFailure, DesignatorFailure)

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Wipe; return (): no constraint is given up. Raises ConstraintsUnsatisfied if too little was wiped.

        The lanes that the arm reaches most easily come first; from each base pose all lanes within reach are wiped. If
        a lane cannot be wiped as a whole, its halves are tried.
        """
        grounding, phase, asked, motion = await self.begun(action)
        plane, problems, wiped, in_a_row = Plane.of(motion, action), list[PlanFailure](), list[Array](), 0
        await self._seen_from_near(grounding, phase, asked, plane, motion)
        motion = grounding.grounded(asked, phase)
        stroke = partial(self.stroke, grounding, phase, asked, plane, closed=False)
        room = self._room(plane, motion)
        pending = self._nearest_first(plane, motion, room.lanes())
        if not pending:
            raise self._no_room(plane, motion)
        while pending and in_a_row < IN_A_ROW:
            lane = pending.pop(0)
            try:
                await self.gone(motion, await stroke(lane))
            except (ConstraintsUnsatisfied, ManipulationGoalInCollision, NavigationFailure) as failure:
                problems, in_a_row = [*problems, failure], in_a_row + 1
                pending = self._nearest_first(plane, motion, (*pending, *_halves(lane)))
                continue
            done = [lane, *await self._from_here(stroke, motion, lane, pending)]
            pending = [one for one in pending if not any(one is other for other in done)]
            wiped, in_a_row = [*wiped, *done], 0
        share = room.share(wiped, self._room(plane, motion))  # things that were seen since may stand there
        if share < ENOUGH:
            raise self._too_little(plane, motion, share, pending, problems)
        return ()

    async def _seen_from_near(
        self,
        grounding: Grounding,
        phase: Phase,
        asked: Sequence[MotionConstraint],
        plane: Plane,
        motion: GroundedMotion,
    ) -> None:
        """Go where the surface is seen, if it was not seen yet: what stands on it may stand elsewhere by now."""
        name = self.platform.scene.bodies.bind(plane.thing)
        if self.platform.robot.camera is None or not self._is_mobile():
            return
        poses = self.platform.base_poses()
        for base in islice(poses.before(motion.things[plane.thing][:2, 3], motion.arms), VIEWS):
            if self.platform.belief.seen_from_here(name):
                return
            with suppress(NavigationFailure):
                await self.drive_with_room(base)
                await self._look(grounding, asked, phase)

    async def _from_here(
        self,
        stroke: Callable[..., Awaitable[Trajectory]],
        motion: GroundedMotion,
        last: Array,
        pending: Sequence[Array],
    ) -> list[Array]:
        """Wipe the lanes near the last one that the arm reaches without driving; return them."""
        done, in_a_row = list[Array](), 0
        for lane in sorted(pending, key=lambda one: float(np.linalg.norm(one[0, :3] - last[-1, :3]))):
            try:
                await self.gone(motion, await stroke(lane, drives=False))
            except (ConstraintsUnsatisfied, ManipulationGoalInCollision):
                in_a_row += 1
                if in_a_row == HERE:
                    break
                continue
            done, in_a_row = [*done, lane], 0
        return done

    def _nearest_first(self, plane: Plane, motion: GroundedMotion, lanes: Iterable[Array]) -> list[Array]:
        """Sort lanes by how near the base gets the arm to them, long ones first of those that are near enough."""
        every, enough = list(lanes), BEST * min(arm.reach for arm in motion.arms)
        away = [max(round(one, 1), enough) for one in self._away(plane, motion, every)]
        return [every[k] for k in sorted(range(len(every)), key=lambda k: (away[k], -len(every[k])))]

    def _away(self, plane: Plane, motion: GroundedMotion, lanes: Sequence[Array]) -> list[float]:
        there = [moved(motion.things[plane.thing], lane[:, :3])[:, :2] for lane in lanes]
        return self.platform.base_poses().distances(there, motion.arms) if lanes else []

    def _no_room(self, plane: Plane, motion: GroundedMotion) -> ConstraintsUnsatisfied:
        """Return the failure that says that no place of a surface is free."""
        name, arm = self.platform.scene.bodies.bind(plane.thing), motion.arms[0].name
        said = f"{name} has no free place for {self.tool(motion)} with {HAND:.2f} m beside it for the hand"
        return ConstraintsUnsatisfied(said, arm=arm, what=name)

    def _too_little(
        self,
        plane: Plane,
        motion: GroundedMotion,
        share: float,
        pending: Sequence[Array],
        problems: Sequence[PlanFailure],
    ) -> ConstraintsUnsatisfied:
        """Return the failure that says how much was wiped, and what the rest is too far from."""
        name, arm = self.platform.scene.bodies.bind(plane.thing), motion.arms[0]
        in_the_way = next((one for one in (getattr(each, "blocked_by", None) for each in problems) if one), None)
        nearest = min(self._away(plane, motion, pending), default=math.inf)
        why = (
            f"{in_the_way} is in the way"
            if in_the_way is not None
            else "the base has no room beside the rest"
            if nearest == math.inf
            else f"the shoulder of {arm.name} gets no nearer to the rest than {nearest:.2f} m, out of its reach "
            f"with {self.tool(motion)} held flat"
        )
        said = f"{share:.0%} of {name} was wiped, {ENOUGH:.0%} is due: {why}"
        return ConstraintsUnsatisfied(said, arm=arm.name, what=name, blocked_by=in_the_way)

    def _room(self, plane: Plane, motion: GroundedMotion) -> Room:
        name, feature = self.platform.scene.bodies.bind(plane.thing), plane.height.world
        middle, normal = np.array(feature.position), np.array(feature.direction)
        width, length = sorted(self.platform.scene.world.size(self.tool(motion)))[1:]
        self.platform.sync()
        surface = Surface(self.platform, name, motion.things[plane.thing], middle, normal, plane.axes())
        return surface.room(width, length)


def _halves(lane: Array) -> tuple[Array, ...]:
    """Divide a lane in two; one of three places or fewer is not divided."""
    places = lane[1:-1, :3]
    return tuple(map(lifted, np.array_split(places, 2))) if len(places) > SHORT else ()
