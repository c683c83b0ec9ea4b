"""Paths of arms through the planning scene, timed: in joint space, and straight lines of the tip."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from typing import Self

import numpy as np

from executive.belief.scene_part import Kept
from executive.modules.commanding import Control
from executive.motion import (
    JointSpace,
    MotionError,
    NoPath,
    cartesian_path,
    keeps_line,
    plan_path,
    time_curve,
    time_path,
)
from executive.motion.upright import Upright
from executive.robots.arms import ArmModel
from planlang.geometry import Array, Pose, matrices
from planlang.protocols import Trajectory

ITERATIONS = 1000
"""Iterations of the path search (RRT) before it gives up."""
SEARCHES = 2
"""Searches for one path in one scene: chance guides a search, so that a second one may find what the first did not."""
SHARE = 0.8
"""Share of a held object's largest tilt that paths may use, a margin because they are checked at samples only."""
HAIR = 1e-6
"""Tolerance for rounding [rad]."""
CLOSE = 0.05
"""Spacing of exact checks in time, as a share of the collision-checking resolution; small, since a torso is slow."""


def _apart(rows: Array, step: Array) -> list[int]:
    """Select the indices of rows (n, d) of joint values that are a step (d,) apart in some joint, and the last row."""
    kept = [0] if len(rows) else []
    for number in range(1, len(rows)):
        if number == len(rows) - 1 or bool((np.abs(rows[number] - rows[kept[-1]]) >= step).any()):
            kept.append(number)
    return kept


class ArmPaths:
    """Plans motions of arms. ``rng`` feeds the path planner."""

    def __init__(self, control: Control, rng: np.random.Generator) -> None:
        self._control, self._rng = control, rng
        self._in_vain: Kept[dict[Hashable, list[NoPath]]] = Kept(1)

    def supposing(self, control: Control) -> Self:
        """Make the same arms of a robot that is supposed; what is planned for it changes no later path of this one."""
        other = copy(self)
        other._control, other._rng, other._in_vain = control, np.random.default_rng(0), Kept(1)
        return other

    def path(
        self,
        arm: ArmModel,
        goal: Array,
        touches: str | None = None,
        iterations: int = ITERATIONS,
        others: Sequence[Array] = (),
        *,
        still: bool = False,
    ) -> Trajectory:
        """Plan a timed path to joint positions (d,), or to one of ``others``, through the planning scene.

        The hand may touch the body ``touches``. Keeps the held object upright if its class requires it. A slow torso
        leaves the heights of start and goals only if there is no other way, and never if it is to be ``still``. Raises
        a MotionError if no path is found within ``iterations``, at once if :data:`SEARCHES` have found none from here.
        """
        question = (arm.name, touches, iterations, still, *(one.tobytes() for one in (goal, *others)))
        in_vain = self._in_vain.of(self._control.scene.content(), dict).setdefault(question, [])
        if len(in_vain) == SEARCHES:
            raise in_vain[-1].with_traceback(None)
        try:
            return self._path(arm, goal, touches, iterations, others, still=still)
        except NoPath as problem:
            in_vain.append(problem)
            raise

    def _path(
        self, arm: ArmModel, goal: Array, touches: str | None, iterations: int, others: Sequence[Array], *, still: bool
    ) -> Trajectory:
        control = self._control
        chain, base, start = arm.chain, control.base(), control.arm_joints(arm)
        quick = control.scene.collisions.quick_check(arm, touches)

        def touching(q: Array, among: Sequence[tuple[str, str]] | None) -> list[tuple[str, str]]:
            # The whole robot is checked at the start; after that, only moving parts can come into contact.
            contacts = control.scene.collisions.contacts(base, arm, q, touches, among=among)
            return [(contact.part, contact.body) for contact in contacts]

        def waypoints_in(space: JointSpace) -> Array:
            def moments(path: Array) -> Array:
                """Sample joint rows to check exactly: at the checking resolution, and in time along the timed path."""
                rows = control.timed(arm.joints, path).positions[1:]
                return np.concatenate([space.points(path), rows[_apart(rows, CLOSE * arm.resolution)]])

            return plan_path(
                start,
                goal,
                space,
                quick,
                touching,
                self._rng,
                moments=moments,
                others=others,
                constraint=upright,
                iterations=iterations,
            )

        upright = self.upright(arm, goal)
        waypoints = self._first(arm, [start, goal, *others], waypoints_in, still=still)
        if upright is not None and len(waypoints) > 2:  # such paths have many waypoints; a curve does not stop at each
            curve = control.timed(arm.joints, waypoints, time_curve)
            rows = curve.positions[1:]
            holds = chain.within(rows, 1e-6).all() and upright.holds(rows).all()
            if holds and not any(map(touching, rows, quick.doubtful(rows))):
                return curve
        return control.timed(arm.joints, waypoints)

    @staticmethod
    def _first(arm: ArmModel, ends: Sequence[Array], plan: Callable[[JointSpace], Array], *, still: bool) -> Array:
        """Plan with a slow torso between the heights of a path's ends (d,) and, unless it is ``still``, then at all."""
        space = JointSpace.of(arm.lower, arm.upper, continuous=arm.chain.continuous, resolution=arm.resolution)
        if arm.lift is not None and arm.standing is not None:
            column, low, high = arm.lift.column, space.lower.copy(), space.upper.copy()
            low[column], high[column] = np.min(ends, axis=0)[column], np.max(ends, axis=0)[column]
            narrow = replace(space, lower=low, upper=high)
            if still:
                return plan(narrow)
            with suppress(NoPath):
                return plan(narrow)
        return plan(space)

    def upright(self, arm: ArmModel, goal: Array) -> Upright | None:
        """Build the tilt constraint for the held object on a path to joint positions (d,); None if it needs none.

        The limit is never below the tilt at the start, as after pouring, or at the goal.
        """
        held = self._control.scene.arms.held(arm.name)
        if held is None or held.largest_tilt is None:
            return None
        usual = Upright(arm.chain, held.up, SHARE * held.largest_tilt)
        ends = usual.tilts(np.stack([self._control.arm_joints(arm), goal]))
        return replace(usual, limit=max(usual.limit, float(ends.max()) + HAIR))

    def drawn(self, arm: ArmModel, offsets: Iterable[Array], touches: str | None) -> Trajectory | None:
        """Plan a straight motion of the tip by the first feasible offset (3,) [m] in the map; None if none is."""
        for offset in offsets:
            pose = self._control.scene.arms.tip(arm).copy()
            pose[:3, 3] += offset
            with suppress(MotionError):
                return self.straight_path(arm, pose, touches)
        return None

    def straight_path(self, arm: ArmModel, pose: Array, touches: str | None) -> Trajectory:
        """Plan a timed straight-line motion of the tip to a map pose (4, 4).

        ``touches``: the body that the hand may touch. Raises a MotionError with the reason.
        """
        control = self._control
        start, base = control.arm_joints(arm), control.base()
        quick = control.scene.collisions.quick_check(arm, touches)

        def is_free(row: Array) -> bool:
            return all_free(row[None])

        def all_free(rows: Array) -> bool:
            contacts = control.scene.collisions.contacts
            return not any(
                contacts(base, arm, row, touches, among=pairs)
                for row, pairs in zip(rows, quick.doubtful(rows), strict=True)
                if pairs is None or pairs
            )

        chain = arm.chain
        begin, end = chain.fk(start)[0], matrices.product(Pose.planar(*base).inverse().matrix(), pose)
        line = cartesian_path(arm.chain, start, begin, end, is_free, solve=arm.solve)
        if line.waypoints is None:
            raise MotionError(line.reason)
        for timing in (time_curve, time_path):  # a curve is faster, but may leave the line or the joint limits
            trajectory = control.timed(arm.joints, line.waypoints, timing)
            rows = trajectory.positions[1:]
            straight = keeps_line(chain.fk(trajectory.positions), begin, end)
            if straight and chain.within(rows, 1e-6).all() and all_free(rows):
                return trajectory
        raise MotionError("in collision or off the line between two waypoints")
