"""A run takes any robot interface: a decorator with exactly the members of the protocol is enough."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from executive.runs.options import RunOptions
from planlang.geometry import Pose
from planlang.protocols import Detection, RobotInterface
from tests.support.extras import skip_without_pr2
from tests.support.scenarios import at_home, judged_run, parsed, scenarios

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


def test_what_is_stirred_is_mixed_in_truth_though_the_camera_is_decorated() -> None:
    skip_without_pr2("--robot pr2")
    scenario, made = scenarios()["stir_soup"], list[NoisyCamera]()

    def decorated(robot: RobotInterface) -> RobotInterface:
        made.append(NoisyCamera(robot))
        return made[-1]

    options = RunOptions.of(parsed([*map(at_home, scenario.arguments), "--json"]))
    ended = judged_run(scenario, replace(options, interface=decorated))
    assert (ended.result.message, ended.unmet) == ("done", ())
    own = {name for one in (NoisyCamera, made[0]) for name in vars(one) if not name.startswith("_")}
    members = {*vars(RobotInterface), *RobotInterface.__annotations__}
    assert own == {name for name in members if not name.startswith("_")}
