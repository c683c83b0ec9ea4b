"""The base of a platform: paths through the planning scene, and room to tuck the arms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product

from executive.belief.free_floor import BasePose
from executive.modules.control import Control
from executive.motion import Grid, NoPath, clearance_at, clearance_field, plan_base_path, time_path
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.protocols import Trajectory

CHECKS = 0.08
"""Distance of the poses at which a path of the base is checked at first [m]; the timed path is checked again."""
FINER = (1.0, 0.5, 0.25)
"""Factors of that distance: a timed path that touches something between checks is planned again with closer ones."""
ROOMY = 0.01
"""A pose with this much room around the robot's outline, taken for round, touches nothing and is not checked [m]."""
BACK_OFF = (0.1, 0.2, 0.3, 0.45, 0.6)
"""Distances at which room for the carrying posture is looked for [m]; the base is to stay near its work."""
BACKWARDS = (math.pi, 0.75 * math.pi, -0.75 * math.pi, 0.5 * math.pi, -0.5 * math.pi)
"""Directions in which the base backs off, relative to its heading [rad]: straight back first, never ahead."""


class Drive:
    """Plans motions of the base."""

    def __init__(self, control: Control) -> None:
        self._control = control

    def path(self, goal: BasePose) -> Trajectory:
        """Return a timed path of the base through the planning scene; raises a MotionError."""
        control = self._control
        control.sync()
        scene, limits, start = control.scene, control.robot.base, control.base()
        x_min, y_min, x_max, y_max = scene.world.scene.bounds
        grid = Grid.over((x_min, y_min), (x_max, y_max))
        obstacles, silhouette = scene.collisions.obstacles(), scene.collisions.silhouette()
        room = clearance_field(grid, obstacles, silhouette)

        def touching(x: float, y: float, yaw: float) -> list[tuple[str, str]]:
            return [(contact.part, contact.body) for contact in scene.collisions.contacts((x, y, yaw))]

        for factor in FINER:
            trajectory = time_path(
                ("x", "y", "yaw"),
                plan_base_path(start, goal, grid, room, touching, resolution=CHECKS * factor),
                velocity=(limits.speed, limits.speed, limits.turn_speed),
                acceleration=(limits.acceleration, limits.acceleration, limits.turn_acceleration),
                jerk=limits.jerk,
                rate=control.world.rate,
            )
            rows = trajectory.positions[1:]
            doubtful = rows[clearance_at(rows[:, :2], obstacles, silhouette) < ROOMY]
            if not any(touching(*row) for row in doubtful.tolist()):
                return trajectory
        raise NoPath(start, goal, {"finer checks": len(FINER)})

    def room_for(self, postures: Sequence[tuple[ArmModel, Array]]) -> BasePose | None:
        """Return the nearest base pose, here or behind, where arms can go to postures (d,); None if there is none."""
        x, y, yaw = self._control.base()
        scene = self._control.scene
        for step, turn in [(0.0, 0.0), *product(BACK_OFF, BACKWARDS)]:
            pose = (x + step * math.cos(yaw + turn), y + step * math.sin(yaw + turn), yaw)
            if step and scene.collisions.contacts(pose):
                continue
            if not any(scene.collisions.contacts(pose, arm, posture) for arm, posture in postures):
                return pose
        return None

    def moved(self) -> None:
        """Record that the base has moved: things have to be looked at again before they are handled."""
        self._control.belief.base_moved()
        self._control.sync()
