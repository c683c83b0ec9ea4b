"""Motions of the base: paths through the planning scene, and places nearby where arms have room."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.locations.base_poses import BasePoses
from executive.modules.commanding import Control
from executive.motion import Grid, MotionError, NoPath, clearance_at, clearance_field, plan_base_path, time_path
from executive.motion.base_path import poses_along
from executive.motion.drivable import SPARE, free_poses
from executive.motion.tight_path import plan_tight_path
from executive.robots.arms import ArmModel
from planlang.geometry import Array, matrices
from planlang.protocols import Trajectory

CHECKS = 0.08
"""Distance of the poses at which a path of the base is checked at first [m]; the timed path is checked again."""
FINER = (1.0, 0.5, 0.25)
"""Factors of that distance: a timed path that touches something between checks is planned again with closer ones."""
ROOMY = 0.01
"""A pose with this much room around the robot's outline, taken for round, touches nothing and is not checked [m]."""
BACK_OFF = (0.1, 0.2, 0.3, 0.45, 0.6)
"""Distances at which room for the carrying posture is looked for [m]; the base is to stay near its work."""
LEVEL = 0.5
"""Level share of the direction of a hand from which on that is a heading."""
STRIDE, HAIR = 0.025, 1e-6
"""Steps in which a straight way of the base is looked at, and what rounding takes from them [m]."""


class Drive:
    """Plans motions of the base."""

    def __init__(self, control: Control) -> None:
        self._control = control

    def path(self, goal: BasePose) -> Trajectory:
        """Return a timed path of the base through the planning scene; raises a MotionError.

        While a room is explored it leads over what was seen, if it can: what nobody has seen may be full. Where the
        robot has no room to turn as it is, it leads past with headings in which it has room.
        """
        control = self._control
        control.sync()
        scene, radius, start = control.scene, control.robot.base.radius, control.base()
        x_min, y_min, x_max, y_max = scene.world.scene.bounds
        grid = Grid.over((x_min, y_min), (x_max, y_max))
        silhouette = scene.collisions.silhouette()
        room = clearance_field(grid, scene.collisions.obstacles(), silhouette)

        def roomy(room: Array, checks: float) -> Array:
            return plan_base_path(start, goal, grid, room, self._touching, resolution=checks)

        def tight(spare: float, checks: float) -> Array:
            floor = scene.collisions.whole()
            free = free_poses(grid, floor.boxes, floor.silhouette, floor.outlines, -spare)
            return plan_tight_path(start, goal, grid, free, self._touching, checks)

        plans: list[Callable[[float], Array]] = [partial(roomy, room), partial(tight, SPARE), partial(tight, 0.0)]
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
        """Return a path, planned with checks at a distance [m], with times: it touches nothing between them either."""
        control, scene = self._control, self._control.scene
        obstacles, silhouette = scene.collisions.obstacles(), scene.collisions.silhouette()
        for factor in FINER:
            trajectory = self.timed(plan(CHECKS * factor))
            rows = trajectory.positions[1:]
            doubtful = rows[clearance_at(rows[:, :2], obstacles, silhouette) < ROOMY]
            if not any(self._touching(*row) for row in doubtful.tolist()):
                return trajectory
        raise NoPath(control.base(), goal, {"finer checks": len(FINER)})

    def timed(self, poses: Array) -> Trajectory:
        """Return a path of the base (n, 3) with times, within its limits of speed, acceleration and jerk."""
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
        """Return the time to drive to a base pose [s], None if no path is found."""
        try:
            return (len(self.path(goal).positions) - 1) / self._control.world.rate
        except MotionError:
            return None

    def room_for(self, postures: Sequence[tuple[ArmModel, Array]], least: float = 0.0) -> BasePose | None:
        """Return the nearest base pose, here or around, where arms can go to postures (d,); None if there is none.

        It is at least so far from here [m]. Poses to which the robot can go straight, as its arms are now, come first,
        and those opposite of where the first arm's hand shows: it gets out of a cabinet, and off a handle, as it came.
        """
        here, contacts, bent = self._control.base(), self._control.scene.collisions.contacts, None
        poses = BasePoses(self._control.scene)
        work = self._heading(postures[0][0]) if postures else here[2]
        around = () if self._control.robot.base.fixed else poses.beside(work, BACK_OFF)
        for pose in chain((here,), around):
            if math.dist(pose[:2], here[:2]) < least - HAIR or (pose != here and not poses.has_room(pose)):
                continue
            if any(contacts(pose, arm, posture) for arm, posture in postures):
                continue
            if all(map(poses.has_room, poses_along(np.array([here, pose]), STRIDE + HAIR))):
                return pose
            bent = bent or pose
        return bent

    def _heading(self, arm: ArmModel) -> float:
        """Return the heading in the map in which a hand approaches things as it is now [rad]."""
        x, y, _ = matrices.rotated(self._control.scene.arms.tip(arm)[:3, :3], np.asarray(arm.frame.approach)).tolist()
        return math.atan2(y, x) if math.hypot(x, y) > LEVEL else self._control.base()[2]

    def moved(self) -> None:
        """Record that the base has moved: things have to be looked at again before they are handled."""
        self._control.belief.base_moved()
        self._control.sync()
