"""The process module that lowers what a hand holds onto a place, so that it stands there when the hand opens."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import product

import numpy as np

from executive.locations import HandSolution
from executive.modules.arm.reaching import HandReaching
from executive.motion import cartesian_path
from executive.robots.arms import ArmModel
from planlang.designators import Action, Location, Object, resting_on
from planlang.failures import ActionUnresolvable, LookingFailure, PerceptionFailure
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotated
from planlang.language.process_module import process_module
from sim import Body

CLEAR = 0.05
"""Distance that a thing has from a compartment before it goes in [m]."""

FEW = 300
"""Branches that the search of a path over a place grows: there are other hand poses to try, and other base poses."""


@process_module
class Lowering(HandReaching):
    """Brings what a hand holds over a place, and straight down onto it."""

    name = "lowering"
    actions = ("LoweringAnObject",)

    def _target(self, action: Action) -> Location | None:
        """Return where the thing is to rest; for a thing on that."""
        where = action.get("to_location")
        return resting_on(where) if isinstance(where, (Object, Location)) else None

    def _arms(self, action: Action) -> list[ArmModel]:
        """Return the arm that holds what is to be put down, else those that hold something."""
        scene, what = self.platform.scene, action.get("object_acted_on")
        name = scene.bodies.bind(what) if isinstance(what, Object) else None
        full = self.platform.arms.holding(scene.arms.all)
        meant = [arm for arm in full if (held := scene.arms.held(arm.name)) is not None and name in (None, held.name)]
        if not meant:
            missing = "nothing" if name is None else f"no {name}"
            raise ActionUnresolvable(f"there is {missing} in a hand to put down", designator=str(action))
        return meant

    async def _look_first(self, location: Location) -> None:
        """Look at what the place is relative to; what the hand holds may hide it, and then it is where it was seen."""
        with suppress(PerceptionFailure, LookingFailure):
            await super()._look_first(location)

    async def _go(self, solution: HandSolution, location: Location, iterations: int) -> None:
        """Go above the place, into a compartment straight through where it is open, then straight down."""
        outside = self._outside(solution) if solution.reach.inside else None
        first = solution.joints[0] if outside is None else outside
        await self._joint_path(solution.arm, first, None, solution.plan.label, iterations=min(FEW, iterations))
        if outside is not None:
            await self._line(solution, solution.plan.poses[0], solution.joints[0])
        await self._straight(solution, solution.joints[1:2])

    def _outside(self, solution: HandSolution) -> Array | None:
        """Return joint values (d,) before the open side of what a thing is put into, from where it goes straight in.

        None if there is no open side, or no way through.
        """
        scene, arm, base = self.platform.scene, solution.arm, Pose.planar(*self.platform.base()).inverse().matrix()
        held, body = scene.arms.held(arm.name), scene.world.scene.body(solution.reach.body)
        if held is None:
            return None
        above = solution.plan.poses[0]
        at = scene.bodies.pose(body.name).inverse().matrix() @ above @ held.pose.matrix()
        for direction, wall in _open_sides(body):
            way = wall - float(at[:3, 3] @ direction) + max(held.size) / 2 + CLEAR
            out = above.copy()
            out[:3, 3] += way * rotated(scene.bodies.pose(body.name).rotation, direction)
            ends, is_free = (base @ out, base @ above), self._is_free(arm)
            found, reached = arm.solver.solve(np.repeat(ends[0][None], len(arm.seeds), axis=0), arm.seeds[:, None])
            for q in found[reached]:
                if is_free(q) and cartesian_path(arm.solver, q, *ends, is_free).waypoints is not None:
                    return np.asarray(q)
        return None

    def _is_free(self, arm: ArmModel) -> Callable[[Array], bool]:
        base = self.platform.base()
        return lambda q: not self.platform.scene.collisions.contacts(base, arm, q)


def _open_sides(body: Body) -> Iterator[tuple[Array, float]]:
    """Yield the level directions in which a compartment of a body is open, and how far its side is, in its frame."""
    half = np.array(body.size) / 2
    for cavity in body.cavities:
        for axis, sign in product((0, 1), (1.0, -1.0)):
            if sign * cavity.centre[axis] + cavity.size[axis] / 2 > half[axis]:
                yield sign * np.eye(3)[axis], float(half[axis])
