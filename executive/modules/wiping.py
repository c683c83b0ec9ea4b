"""The process module that wipes a surface: it moves a tool over all of it that is free, lane by lane."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from executive.modules.motion_grounding import GroundedMotion
from executive.modules.strokes import Plane, StrokeWork
from planlang.designators import Action
from planlang.failures import (
    DesignatorFailure,
    LookingFailure,
    ManipulationFailure,
    ManipulationGoalInCollision,
    NavigationFailure,
    PerceptionFailure,
)
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved
from planlang.geometry.shapes import corners
from planlang.modules import process_module
from planlang.motion_constraints import ConstraintsUnsatisfied

OVERLAP = 0.8
"""Distance of lanes, as a share of the width of the tool."""
STEP = 0.06
"""Distance of places along a lane [m]."""
MOST = 9
"""Places of a lane that are wiped without a stop."""
LIFTED = 0.04
"""Height from which the tool is lowered to a lane, and to which it is lifted behind it [m]."""
HAND = 0.05
"""Room beside the tool that the hand needs [m]."""
ABOVE = 0.3
"""Height over the surface up to which things are in the way of the hand [m]."""
ENOUGH = 0.8
"""Share of the free places that has to be wiped."""


@process_module
class Wiping(StrokeWork):
    """Wipes surfaces."""

    name = "wiping"
    actions = ("WipingMotion",)
    failures = (ManipulationFailure, NavigationFailure, PerceptionFailure, LookingFailure, DesignatorFailure)

    async def execute(self, action: Action) -> tuple[str, ...]:
        """Wipe; return (): no constraint is given up. Raises ConstraintsUnsatisfied if too little was wiped."""
        grounding, phase, asked, motion = await self.begun(action)
        plane = Plane.of(motion, action)
        due = sum(len(lane) - 2 for lane in self._lanes(plane, motion))
        wiped, missed, problem = 0, 0, None
        for lane in self._lanes(plane, motion):
            try:
                lap = await self.stroke(grounding, phase, asked, plane, lane, closed=False)
                await self.gone(motion, lap)
                wiped += len(lane) - 2
            except (ConstraintsUnsatisfied, ManipulationGoalInCollision, NavigationFailure) as failure:
                missed, problem = missed + len(lane) - 2, problem or failure
                if missed > (1 - ENOUGH) * due:
                    break  # it cannot become enough any more: what is out of reach takes longest
        else:
            due = wiped + missed  # things that were seen meanwhile may stand on the rest
        share = wiped / max(1, due)
        if share < ENOUGH:
            name = self.platform.scene.bodies.bind(plane.thing)
            raise ConstraintsUnsatisfied(f"{share:.0%} of {name} was wiped", arm=motion.arms[0].name) from problem
        return ()

    def _lanes(self, plane: Plane, motion: GroundedMotion) -> Iterator[Array]:
        """Yield lanes (n, 4) of free places, with one over each end, in the frame of the thing, back and forth."""
        size = np.array(self.platform.scene.world.size(self.platform.scene.bodies.bind(plane.thing)))
        width, length = sorted(self.platform.scene.world.size(self.tool(motion)))[1:]
        axes = sorted(plane.axes(), key=lambda axis: float(np.abs(axis) @ size))
        across, along = (
            _spread(float(np.abs(axis) @ size) - width, step)
            for axis, step in zip(axes, (OVERLAP * width, STEP), strict=True)
        )
        middle = np.array(plane.height.world.position)
        for number, shift in enumerate(across):
            lane = middle + shift * axes[0] + along[:, None] * axes[1]
            lane = lane[:: -1 if number % 2 else 1]
            free = self._free(plane, motion, lane, length / 2 + HAND)
            for run in np.split(lane, np.flatnonzero(np.diff(free.astype(int))) + 1):
                begun = int(np.flatnonzero((lane == run[0]).all(axis=1))[0])
                if free[begun]:
                    yield from (_lifted(part) for part in np.array_split(run, -(-len(run) // MOST)))

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


def _spread(extent: float, step: float) -> Array:
    """Return places (n,) from one end of an extent about 0 to the other, at most a step from each other."""
    count = max(1, int(np.ceil(max(extent, 0.0) / step)))
    return np.linspace(-extent / 2, extent / 2, count + 1) if extent > 0 else np.zeros(1)


def _lifted(places: Array) -> Array:
    """Return places (n + 2, 4) with one over the first and one over the last of places (n, 3)."""
    over = np.zeros(len(places) + 2)
    over[[0, -1]] = LIFTED
    return np.column_stack([np.vstack([places[:1], places, places[-1:]]), over])
