"""A camera with noise, by a decorator that has exactly the members of a robot's interface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from planlang.geometry import Pose
from planlang.protocols import Detection, RobotInterface

NOISE = 0.001
"""Standard deviation of the places that the camera tells [m]."""


class NoisyCamera:
    """Decorates a robot's interface: the camera tells where things are with some noise."""

    def __init__(self, robot: RobotInterface) -> None:
        self.rate, self._random = robot.rate, np.random.default_rng(0)
        self.configuration, self.link_pose = robot.configuration, robot.link_pose
        self.start, self.motion, self.halt = robot.start, robot.motion, robot.halt
        self.scan, self.touches, self._detect = robot.scan, robot.touches, robot.detect
        self.grip, self.loosen, self.feels, self.pulled = robot.grip, robot.loosen, robot.feels, robot.pulled

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        return tuple(replace(one, pose=self._blurred(one.pose)) for one in self._detect(camera_link))

    def _blurred(self, pose: Pose) -> Pose:
        x, y, z = (pose.position + self._random.normal(0.0, (NOISE, NOISE, 0.0))).tolist()
        return Pose((x, y, z), pose.orientation)
