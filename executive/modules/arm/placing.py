"""Process module that lowers a held object onto a place, where it stands when the hand opens."""

from __future__ import annotations

from collections.abc import Iterator
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
"""Distance of an object from a compartment before it is moved in [m]."""

FEW = 300
"""Iterations of the path search to above a place; few, because there are other hand and base poses to try."""


@process_module
class Lowering(HandReaching):
    """Moves a held object above a place, then straight down onto it."""

    name = "lowering"
    actions = ("LoweringAnObject",)

    def _target(self, action: Action) -> Location | None:
        """Convert ``to_location`` to the place of the object; a body there means on top of it or inside it."""
        where = action.get("to_location")
        return resting_on(where) if isinstance(where, (Object, Location)) else None

    def _arms(self, action: Action) -> list[ArmModel]:
        """Find the arms that hold the object to put down; without ``object_acted_on`` all that hold something."""
        what, arms = action.get("object_acted_on"), self.platform.arms.with_stated(action)
        if not arms:
            missing = self.platform.scene.bodies.bind(what) if isinstance(what, Object) else "an object"
            raise ActionUnresolvable(f"no hand holds {missing} to put down; grasp it first", designator=str(action))
        return arms

    async def _look_first(self, location: Location) -> None:
        """Look at the place's reference objects; if the held object hides them, rely on where they were last seen."""
        with suppress(PerceptionFailure, LookingFailure):
            await super()._look_first(location)

    async def _go(self, solution: HandSolution, location: Location, iterations: int) -> None:
        """Move above the place, into a compartment straight through its open side, then straight down."""
        outside = self._outside(solution)
        arm, plan, first = solution.arm, solution.plan, solution.joints[0] if outside is None else outside
        await self._joint_path(arm, first, None, plan.label, iterations=min(FEW, iterations))
        for pose in plan.poses[1 if outside is None else 0 : 2]:
            await self.straight(arm, pose, plan.touches, plan.label)

    def first_posture(self, solution: HandSolution) -> Array:
        """Return the joint positions (d,) above a place, or before a compartment, from which the hand goes straight."""
        outside = self._outside(solution)
        return solution.joints[0] if outside is None else outside

    def _outside(self, solution: HandSolution) -> Array | None:
        """Find joint positions (d,) in front of a compartment from which the object can be moved straight in.

        None if it goes into no compartment, that has no open side, or no straight path leads through one.
        """
        scene, arm, base = self.platform.scene, solution.arm, Pose.planar(*self.platform.base()).inverse().matrix()
        held, body = scene.arms.held(arm.name), scene.world.scene.body(solution.reach.body)
        if held is None or not solution.reach.inside:
            return None
        above, stands = solution.plan.poses[0], self.platform.base()

        def is_free(q: Array) -> bool:
            return not scene.collisions.contacts(stands, arm, q)

        held_in_body = scene.bodies.pose(body.name).inverse().matrix() @ above @ held.pose.matrix()
        for direction, wall in _open_sides(body):
            distance = wall - float(held_in_body[:3, 3] @ direction) + max(held.size) / 2 + CLEAR
            out = above.copy()
            out[:3, 3] += distance * rotated(scene.bodies.pose(body.name).rotation, direction)
            ends = base @ out, base @ above
            joints, reached = arm.chain.solve(np.repeat(ends[0][None], len(arm.seeds), axis=0), arm.seeds[:, None])
            for q in joints[reached]:
                if is_free(q) and cartesian_path(arm.chain, q, *ends, is_free, solve=arm.solve).waypoints is not None:
                    return np.asarray(q)
        return None


def _open_sides(body: Body) -> Iterator[tuple[Array, float]]:
    """Yield the horizontal directions (3,) in which compartments of a body are open, in the body's frame.

    Each comes with the distance of that side from the body's centre [m].
    """
    half = np.array(body.size) / 2
    for cavity in body.cavities:
        for axis, sign in product((0, 1), (1.0, -1.0)):
            if sign * cavity.centre[axis] + cavity.size[axis] / 2 > half[axis]:
                yield sign * np.eye(3)[axis], float(half[axis])
