"""Robots in scenes that are supposed: they plan there, and from where the scene has them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import MakeStage

CRATE = Body("crate", Pose((1.1, 0.0, 0.4)), (0.3, 1.3, 0.8), type="CardboardBox", movable=True)
DEAD_END = [
    Body("left", Pose((2.0, 0.75, 0.5)), (2.2, 0.1, 1.0)),
    Body("right", Pose((2.0, -0.75, 0.5)), (2.2, 0.1, 1.0)),
    Body("end", Pose((3.1, 0.0, 0.5)), (0.1, 1.6, 1.0)),
]
GOAL = (2.3, 0.0, 0.0)


def test_a_base_has_a_way_once_what_closes_it_is_supposed_away(make_stage: MakeStage) -> None:
    platform = make_stage(CRATE, *DEAD_END).platform
    assert platform.drive.seconds(GOAL) is None
    without = platform.scene.supposing(platform.belief.state.placed({"crate": None}))
    assert platform.supposing(without).drive.seconds(GOAL) is not None
    assert platform.drive.seconds(GOAL) is None, "nothing has changed for the robot itself"


def test_arms_plan_from_where_a_scene_supposes_the_robot(make_stage: MakeStage) -> None:
    platform = make_stage(CRATE).platform
    arm, robot, now = platform.scene.arms.all[0], platform.belief.robot, platform.base()
    joints = platform.belief.state.robots[robot].joints
    there = replace(platform.belief.state.robots[robot], base=(-1.0, 0.5, math.pi / 2), joints=joints)
    supposed = platform.supposing(platform.scene.supposing(platform.belief.state.with_robot(robot, there)))
    assert supposed.base() == (-1.0, 0.5, math.pi / 2)
    path = supposed.arms.path(arm, np.clip(supposed.arm_joints(arm) + 0.01, arm.lower, arm.upper))
    assert np.allclose(path.positions[0], supposed.arm_joints(arm))
    assert platform.base() == now
