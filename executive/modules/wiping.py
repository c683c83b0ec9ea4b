"""The process module that wipes a surface: it moves a tool over all of it that is free, lane by lane."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from executive.modules.motion_grounding import GroundedMotion
from executive.modules.stances import BEST, distances
from executive.modules.strokes import Plane, StrokeWork
from executive.motion.clearance import clearance_at
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
from planlang.geometry.matrices import inverse, moved
from planlang.geometry.shapes import corners
from planlang.modules import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied
from planlang.protocols import Trajectory

OVERLAP = 0.8
"""Distance of lanes, as a share of the width of the tool."""
STEP = 0.06
"""Distance of places along a lane [m]."""
SHORT = 3
"""Places of a lane that is not divided."""
MOST = 9
"""Places of a lane that are wiped without a stop."""
LIFTED = 0.04
"""Height from which the tool is lowered to a lane, and to which it is lifted behind it [m]."""
HAND = 0.05
"""Room beside the tool that the hand needs [m]."""
ABOVE = 0.3
"""Height over the surface up to which things are in the way of the hand [m]."""
BESIDE = 0.02
"""Height over the surface from which what stands beside it is in the way of the tool [m]."""
LEVEL = 0.99
"""Least cosine between the vertical and the normal of a surface of which it is known what stands beside it."""
FINE = 0.01
"""Distance of places of which it is looked whether there is room beside the surface [m]."""
HAIR = 1e-6
"""What rounding takes from this room [m]."""
IN_A_ROW = 6
"""Lanes, or halves of lanes, that fail one after another before it is given up: the others are farther away."""
HERE = 2
"""The same from one base pose."""
ENOUGH = 0.8
"""Share of the free places that has to be wiped."""


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
        plane, problems, wiped, in_a_row = Plane.of(motion, action), list[PlanFailure](), 0, 0
        stroke = partial(self.stroke, grounding, phase, asked, plane, closed=False)
        pending = self._nearest_first(plane, motion, self._lanes(plane, motion))
        due = sum(map(_places, pending))
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
            wiped, in_a_row = wiped + sum(map(_places, done)), 0
        due = min(due, sum(map(_places, self._lanes(plane, motion))))  # things that were seen since may stand there
        if wiped < ENOUGH * due:
            raise self._too_little(plane, motion, wiped / due, pending, problems)
        return ()

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
        return distances(self.platform, there, motion.arms) if lanes else []

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

    def _lanes(self, plane: Plane, motion: GroundedMotion) -> Iterator[Array]:
        """Yield lanes (n, 4) of free places, with one over each end, in the frame of the thing, back and forth."""
        size = np.array(self.platform.scene.world.size(self.platform.scene.bodies.bind(plane.thing)))
        width, length = sorted(self.platform.scene.world.size(self.tool(motion)))[1:]
        axes = sorted(plane.axes(), key=lambda axis: float(np.abs(axis) @ size))
        across, along = self._spread(plane, motion, axes, size, width)
        middle = np.array(plane.height.world.position)
        for number, shift in enumerate(across):
            lane = middle + shift * axes[0] + along[:, None] * axes[1]
            lane = lane[:: -1 if number % 2 else 1]
            free = self._free(plane, motion, lane, length / 2 + HAND) & self._beside(plane, motion, lane, width / 2)
            for run in np.split(lane, np.flatnonzero(np.diff(free.astype(int))) + 1):
                begun = int(np.flatnonzero((lane == run[0]).all(axis=1))[0])
                if free[begun]:
                    yield from (_lifted(part) for part in np.array_split(run, -(-len(run) // MOST)))

    def _spread(
        self, plane: Plane, motion: GroundedMotion, axes: Sequence[Array], size: Array, width: float
    ) -> tuple[Array, Array]:
        """Return where lanes are along the first of two axes (n,), and places of a lane along the second (m,).

        They begin where the tool is flush with the edge, or beside a wall that stands there as near as the hand gets.
        """
        ends = [max(float(np.abs(axis) @ size) - width, 0.0) / 2 for axis in axes]
        first, second = (_spread(-end, end, FINE) for end in ends)
        places = np.array(plane.height.world.position) + (
            first[:, None, None] * axes[0] + second[None, :, None] * axes[1]
        )
        free = self._beside(plane, motion, places.reshape(-1, 3), width / 2).reshape(len(first), len(second))
        across, along = first[free.any(axis=1)], second[free.any(axis=0)]
        if not len(across):
            return np.zeros(0), np.zeros(0)
        return _spread(across[0], across[-1], OVERLAP * width), _spread(along[0], along[-1], STEP)

    def _beside(self, plane: Plane, motion: GroundedMotion, places: Array, half: float) -> Array:
        """Return at which places (n, 3) walls and furniture leave the hand room beside the narrow side of the tool."""
        pose, bodies = motion.things[plane.thing], self.platform.scene.world.scene.bodies
        if pose[:3, :3] @ np.array(plane.height.world.direction) @ (0.0, 0.0, 1.0) < LEVEL:
            return np.ones(len(places), bool)
        there = moved(pose, places)
        top = float(there[:, 2].max(initial=-math.inf))
        fixed, _ = self.platform.scene.collisions.boxes_but([body.name for body in bodies if body.movable])
        return clearance_at(there[:, :2], fixed, [(top + BESIDE, top + ABOVE, half + HAND)]) >= -HAIR

    def _free(self, plane: Plane, motion: GroundedMotion, places: Array, room: float) -> Array:
        """Return at which places (n, 3) nothing stands on the surface within so much room [m] (n,)."""
        world, pose = self.platform.scene.world, motion.things[plane.thing]
        normal = np.array(plane.height.world.direction)
        axes = np.stack(plane.axes())
        free = np.ones(len(places), bool)
        for name in world.names():
            body = world.scene.body(name)
            if not body.movable and world.support(name) != self.platform.scene.bodies.bind(plane.thing):
                continue
            if name in self.platform.belief.held:
                continue
            box = moved(inverse(pose), corners(world.pose(name), body.size)) - np.array(plane.height.world.position)
            over = box @ normal
            if over.max() <= 0.0 or over.min() >= ABOVE:
                continue
            low, high = (box @ axes.T).min(axis=0), (box @ axes.T).max(axis=0)
            at = (places - np.array(plane.height.world.position)) @ axes.T
            free &= np.linalg.norm(np.maximum(np.maximum(low - at, at - high), 0.0), axis=1) > room
        return free


def _places(lane: Array) -> int:
    """Count the places of a lane, without those over its ends."""
    return len(lane) - 2


def _halves(lane: Array) -> tuple[Array, ...]:
    """Divide a lane in two; one of three places or fewer is not divided."""
    places = lane[1:-1, :3]
    return tuple(map(_lifted, np.array_split(places, 2))) if len(places) > SHORT else ()


def _spread(low: float, high: float, step: float) -> Array:
    """Return places (n,) from one end to the other, at most a step from each other."""
    count = max(1, int(np.ceil((high - low) / step)))
    return np.linspace(low, high, count + 1) if high > low else np.array([low])


def _lifted(places: Array) -> Array:
    """Return places (n + 2, 4) with one over the first and one over the last of places (n, 3)."""
    over = np.zeros(len(places) + 2)
    over[[0, -1]] = LIFTED
    return np.column_stack([np.vstack([places[:1], places, places[-1:]]), over])
