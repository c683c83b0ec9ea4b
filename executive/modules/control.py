"""Commanding the true world, while the planning scene is kept equal to what is believed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from executive.belief import Belief
from executive.belief.free_floor import BasePose
from executive.belief.planning_scene import PlanningScene
from executive.motion import time_path
from executive.robots import Robot
from executive.robots.arms import ArmModel
from planlang import Fluent, wait_for
from planlang.geometry import Array
from planlang.protocols import Motion, MotionState, Trajectory, World


@dataclass
class Control:
    """A robot in a true world, with a belief about it and the scene in which its motions are planned."""

    world: World
    """The true one: commanded, and known only by what can be sensed of it."""
    robot: Robot
    belief: Belief
    scene: PlanningScene

    def base(self) -> BasePose:
        """Return the pose of the base, by odometry."""
        return self.world.configuration().base

    def joints(self, names: Sequence[str]) -> Array:
        """Return the positions (d,) of joints, by encoders [rad, m]."""
        now = self.world.configuration().joints
        return np.array([now[name] for name in names])

    def arm_joints(self, arm: ArmModel) -> Array:
        """Return the positions (d,) of the joints of an arm and of what carries it [rad, m]."""
        return self.joints(arm.joints)

    def sync(self) -> None:
        """Make the planning scene equal to what is believed."""
        self.belief.sync(self.scene.world, self.world.configuration())

    async def follow(self, group: str, trajectory: Trajectory) -> Motion:
        """Command a motion and wait for its end; it is halted when the caller is evaporated or suspended."""
        self.world.start(group, trajectory)
        try:
            await wait_for(
                Fluent(read=lambda: self.world.motion(group).state is not MotionState.MOVING, name=f"{group} at rest")
            )
            return self.world.motion(group)
        finally:
            self.world.halt(group)
            self.sync()

    def timed(self, joints: Sequence[str], path: Array, timing: Callable[..., Trajectory] = time_path) -> Trajectory:
        """Return a path (n, d) of joints with times, within their limits of speed, acceleration and jerk."""
        limits = [self.robot.limits[name] for name in joints]
        return timing(
            tuple(joints),
            path,
            velocity=[limit.speed for limit in limits],
            acceleration=[limit.acceleration for limit in limits],
            jerk=[limit.jerk for limit in limits],
            rate=self.world.rate,
        )
