"""Process module that wipes a surface: it moves a tool over all free parts of it, lane by lane."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Iterable, Sequence
from functools import partial

import numpy as np

from executive.locations.standing import BEST
from executive.modules.tools.lanes import HAND, Room, Surface, lifted
from executive.modules.tools.motion_grounding import GroundedMotion, Grounding
from executive.modules.tools.strokes import Plane, StrokeWork
from executive.robots.arms import called, too_far
from planlang.designators import Action
from planlang.failures import (
    ManipulationGoalInCollision,
    NavigationFailure,
    PlanFailure,
)
from planlang.geometry import Array
from planlang.geometry.matrices import moved
from planlang.language.process_module import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied
from planlang.protocols import Trajectory

SHORT = 3
"""Most waypoints of a lane that is not divided after a failure."""
IN_A_ROW = 4
"""Consecutive failures of lanes, or halves of lanes, before wiping stops: the remaining ones are farther away."""
HERE = 4
"""The same limit for one base pose."""
BESIDE = 0.15
"""Distance from a lane that failed within which others are tried last: they most likely fail as well [m]."""
ENOUGH = 0.8
"""Least share of the free area to wipe."""


@process_module
class Wiping(StrokeWork):
    """Wipes surfaces."""

    name = "wiping"
    actions = ("WipingMotion",)

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Wipe the surface; return (), as no constraint is dropped. Raises ConstraintsUnsatisfied below ENOUGH.

        The lanes that the arm reaches most easily come first; from each base pose, all lanes within reach are wiped. If
        a lane fails, its halves are tried, after the lanes that are not beside it.
        """
        grounding, motion = await self.begun(action)
        plane, problems, wiped, in_a_row = Plane.of(motion, action), list[PlanFailure](), list[Array](), 0
        failed: list[Array] = []
        await self._look_from_near(grounding, plane, motion)
        motion = grounding.grounded()
        stroke = partial(self.stroke, grounding, plane, closed=False)
        room = self._room(plane, motion)
        pending = self._nearest_first(plane, motion, room.lanes())
        if not pending:
            raise self._no_room(plane, motion)
        while pending and in_a_row < IN_A_ROW:
            lane = pending.pop(0)
            try:
                await self.gone(motion, await stroke(lane))
            except (ConstraintsUnsatisfied, ManipulationGoalInCollision, NavigationFailure) as failure:
                problems, in_a_row, failed = [*problems, failure], in_a_row + 1, [*failed, lane]
                places = lane[1:-1, :3]
                halves = map(lifted, np.array_split(places, 2)) if len(places) > SHORT else ()
                pending = sorted(
                    self._nearest_first(plane, motion, (*pending, *halves)), key=partial(_by_failed, failed)
                )
                continue
            done = [lane, *await self._from_here(stroke, motion, lane, pending)]
            pending = [one for one in pending if not any(one is other for other in done)]
            wiped, in_a_row = [*wiped, *done], 0
        self._straightened()
        share = room.share(wiped, self._room(plane, motion))  # not counting room that objects seen since then occupy
        if share < ENOUGH:
            raise self._too_little(plane, motion, share, pending, problems)
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

    async def _from_here(
        self,
        stroke: Callable[..., Awaitable[Trajectory]],
        motion: GroundedMotion,
        last: Array,
        pending: Sequence[Array],
    ) -> list[Array]:
        """Wipe the lanes that the arm reaches without driving, those near the last one first; return them."""
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
        """Sort lanes by how near the shoulder gets to them, long ones first among those that are near enough."""
        every, enough = list(lanes), BEST * min(arm.reach for arm in motion.arms)
        distances = [max(round(one, 1), enough) for one in self._distances(plane, motion, every)]
        return [every[k] for k in sorted(range(len(every)), key=lambda k: (distances[k], -len(every[k])))]

    def _distances(self, plane: Plane, motion: GroundedMotion, lanes: Sequence[Array]) -> list[float]:
        in_map = [moved(motion.things[plane.thing], lane[:, :3])[:, :2] for lane in lanes]
        return self.platform.standing().distances(in_map, motion.arms) if lanes else []

    def _no_room(self, plane: Plane, motion: GroundedMotion) -> ConstraintsUnsatisfied:
        """Build the failure for a surface without free positions."""
        name, arm = self.platform.scene.bodies.bind(plane.thing), motion.arms[0].name
        message = f"{name} has no free place for {self.tool(motion)} with {HAND:.2f} m beside it for the hand"
        return ConstraintsUnsatisfied(message, arm=arm, what=name)

    def _too_little(
        self,
        plane: Plane,
        motion: GroundedMotion,
        share: float,
        pending: Sequence[Array],
        problems: Sequence[PlanFailure],
    ) -> ConstraintsUnsatisfied:
        """Build the failure that reports how much was wiped, and why the rest was not."""
        name, arm = self.platform.scene.bodies.bind(plane.thing), motion.arms[0]
        obstacle = next((one for one in (getattr(each, "blocked_by", None) for each in problems) if one), None)
        nearest = min(self._distances(plane, motion, pending), default=math.inf)
        reason = (
            f"{obstacle} is in the way"
            if obstacle is not None
            else too_far(arm, "the rest", nearest)
            or f"no posture of {called(arm.name)} was found that holds {self.tool(motion)} flat where it was tried"
        )
        message = f"{share:.0%} of {name} was wiped instead of at least {ENOUGH:.0%}: {reason}"
        return ConstraintsUnsatisfied(message, arm=arm.name, what=name, blocked_by=obstacle)

    def _room(self, plane: Plane, motion: GroundedMotion) -> Room:
        name, feature = self.platform.scene.bodies.bind(plane.thing), plane.height.world
        middle, normal = np.array(feature.position), np.array(feature.direction)
        width, length = sorted(self.platform.scene.world.size(self.tool(motion)))[1:]
        surface = Surface(self.platform, name, motion.things[plane.thing], middle, normal, plane.axes())
        return surface.room(width, length)


def _by_failed(failed: Sequence[Array], lane: Array) -> bool:
    """Check whether the middle of a lane is beside that of one that failed."""
    middles = np.array([one[:, :3].mean(axis=0) for one in failed])
    return bool(np.linalg.norm(middles - lane[:, :3].mean(axis=0), axis=1).min() < BESIDE)
