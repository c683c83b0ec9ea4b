"""Motions of the base through the planning scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.belief.scene_floor import SLACKS
from executive.locations.standing import Standing
from executive.modules.commanding import Control
from executive.motion import Grid, MotionError, NoPath, clearance_field, plan_base_path, time_path
from executive.motion.base_path import plan_tight_path, poses_along
from executive.motion.floods import SPARE
from planlang.geometry import Array
from planlang.protocols import Trajectory

CHECKS = 0.08
"""Initial spacing of collision checks along a base path [m]; the timed path is checked again."""
FINER = (1.0, 0.5, 0.25)
"""Factors of CHECKS: a timed path that collides between checks is planned again with closer checks."""
AROUND = 10.0
"""Distance from the base and its goal within which to search for a path on a large map first [m]."""
BACK_OFF = (0.15, 0.3, 0.45)
"""Lengths of straight ways out of where the cells leave none: an arm still reaches around an open door [m]."""
BACKED_OFF = 3
"""Ends of such ways from which a path is planned."""
ROOMY = 0.01
"""Clearance around the robot's circular outline above which a pose needs no exact check [m]."""


class Drive:
    """Plans motions of the base."""

    def __init__(self, control: Control) -> None:
        self._control = control

    def path(self, goal: BasePose) -> Trajectory:
        """Plan a timed path of the base through the planning scene. Raises a MotionError.

        During exploration, prefers floor that has been seen, since unseen space may be occupied. Where the robot has
        no room to turn freely, searches headings too (:func:`plan_tight_path`).
        """
        *nearby, whole = self._grids(goal)
        for grid in nearby:
            with suppress(NoPath):
                return self._path(goal, grid)
        return self._path(goal, whole)

    def _grids(self, goal: BasePose) -> Iterator[Grid]:
        """Yield the grid around the base and a goal on a large map, then that of the whole map.

        A path that leaves the first one is at least twice :data:`AROUND` long, and seldom needed.
        """
        bounds, ends = self._control.scene.world.scene.bounds, np.array([self._control.base()[:2], goal[:2]])
        least, most = np.array(bounds[:2]), np.array(bounds[2:])
        if ((ends > least) & (ends < most)).all():
            # whole metres, so that the cells are those of the whole map
            low = least + np.maximum(np.floor(ends.min(axis=0) - AROUND - least), 0.0)
            high = np.minimum(ends.max(axis=0) + AROUND, most)
            if (low > least).any() or (high < most).any():
                yield Grid.over((float(low[0]), float(low[1])), (float(high[0]), float(high[1])))
        yield Grid.over(bounds[:2], bounds[2:])

    def _path(self, goal: BasePose, grid: Grid) -> Trajectory:
        """Plan a path on a grid, as :meth:`path`."""
        control = self._control
        scene, radius, start = control.scene, control.robot.base.radius, control.base()
        silhouette, floor = scene.world.silhouette(), scene.collisions.whole()
        room = clearance_field(grid, scene.collisions.obstacles(), silhouette)

        def touching(x: float, y: float, yaw: float) -> Sequence[tuple[str, str]]:
            if (x, y, yaw) in (start, goal):
                return self._touching(x, y, yaw)
            cell = grid.cell(x, y)
            is_roomy = cell is not None and room[cell] > ROOMY + grid.resolution
            return () if is_roomy or floor.surely_holds(np.array([[x, y, yaw]]))[0] else self._touching(x, y, yaw)

        def roomy(room: Array, checks: float, begin: BasePose = start) -> Array:
            return plan_base_path(begin, goal, grid, room, touching, resolution=checks)

        def check_reach() -> None:
            if not scene.collisions.may_reach(goal):
                raise NoPath(start, goal, {"exact checks": 0, "attempts": 0})

        def tight(slack: float, cells: Grid, checks: float, begin: BasePose = start) -> Array:
            check_reach()
            free = scene.collisions.free(scene.collisions.whole(), cells)[SLACKS.index(slack)]
            return plan_tight_path(begin, goal, cells, free, touching, checks, floor.surely_holds)

        def backed_off(checks: float) -> Array:
            check_reach()
            tried = checked = 0
            for aside in Standing(scene).beside(start[2], BACK_OFF):
                if tried == BACKED_OFF:
                    break
                line = np.array([start, aside])
                poses = list(poses_along(line, checks))
                checked += len(poses)
                if not any(touching(*pose) for pose in poses):
                    tried += 1
                    for plan in (partial(roomy, room), partial(tight, 0.0, grid)):
                        with suppress(NoPath):
                            return np.concatenate([line[:1], plan(checks, begin=aside)])
            raise NoPath(start, goal, {"exact checks": checked, "attempts": tried})

        # where the only row of cells through a gap touches something, the one between may not
        grids = [(-SPARE, grid), (0.0, grid), (0.0, grid.between())]
        plans: list[Callable[[float], Array]] = [partial(roomy, room), *(partial(tight, *one) for one in grids)]
        plans.append(backed_off)
        if scene.space is not None:
            seen = scene.space.room(grid, max(high for _, high, _ in silhouette), radius)
            plans.insert(0, partial(roomy, np.where(seen, room, np.minimum(room, -radius))))
        for plan in plans[:-1]:
            with suppress(NoPath):
                return self._timed(goal, plan)
        return self._timed(goal, plans[-1])

    def _touching(self, x: float, y: float, yaw: float) -> list[tuple[str, str]]:
        return [(contact.part, contact.body) for contact in self._control.scene.collisions.contacts((x, y, yaw))]

    def _timed(self, goal: BasePose, plan: Callable[[float], Array]) -> Trajectory:
        """Time the path that ``plan`` finds for a spacing of checks [m]; refine until it is free between checks too."""
        control, scene = self._control, self._control.scene
        floor = scene.collisions.whole()
        for factor in FINER:
            trajectory = self.timed(plan(CHECKS * factor))
            rows = trajectory.positions[1:]
            close = rows[~floor.surely_holds(rows)]
            if not any(self._touching(*row) for row in close.tolist()):
                return trajectory
        raise NoPath(control.base(), goal, {"finer checks": len(FINER)})

    def timed(self, poses: Array) -> Trajectory:
        """Time a path of the base (n, 3) within its limits of speed, acceleration and jerk."""
        limits = self._control.robot.base
        return time_path(
            ("x", "y", "yaw"),
            poses,
            velocity=(limits.speed, limits.speed, limits.turn_speed),
            acceleration=(limits.acceleration, limits.acceleration, limits.turn_acceleration),
            jerk=limits.jerk,
            rate=self._control.world.rate,
        )

    def seconds(self, goal: BasePose) -> float | None:
        """Compute the time to drive to a base pose [s]; None if no path is found."""
        try:
            return (len(self.path(goal).positions) - 1) / self._control.world.rate
        except MotionError:
            return None

    def moved(self) -> None:
        """Record that the base has moved, so that objects must be looked at again before they are handled."""
        self._control.belief.base_moved()
