"""A torso that takes long from end to end stays where it is as long as the arm gets there alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from executive.robots import CARRYING
from executive.robots.arms import RobotModel
from planlang import perform
from planlang.designators import a_posture, action
from planlang.ontology import Ontology
from planlang.protocols import Configuration
from tests.executive.conftest import MakeStage, Stage, furnisher, model_of

TORSO, RAISED = "spindle_joint", 0.38
CARRY = action("Reaching", to_location=a_posture(CARRYING))


def raise_torso(stage: Stage) -> None:
    """Raise the torso, and bend an elbow, so that the arm has somewhere to go."""
    now = stage.truth.configuration()
    joints = {**now.joints, TORSO: RAISED, "elbow_pitch_joint_right": 1.8}
    stage.truth.set_configuration(Configuration(now.base, joints))
    stage.platform.observe()


@pytest.fixture
def make_slow(model: RobotModel, vocabulary: Ontology) -> Iterator[MakeStage]:
    """Furnishes rooms for a robot whose torso takes 20 s from end to end."""
    robot = model.robot
    slow = replace(robot, limits={**robot.limits, TORSO: replace(robot.limits[TORSO], speed=0.02)})
    yield from furnisher(model_of(slow), vocabulary)


def test_an_arm_is_brought_to_its_posture_without_a_slow_torso(make_slow: MakeStage) -> None:
    stage = make_slow()
    raise_torso(stage)
    stage.run(lambda: perform(CARRY))
    assert stage.truth.configuration().joints[TORSO] == pytest.approx(RAISED)
    assert not stage.platform.arms.untucked()


def test_a_quick_torso_goes_to_its_height_in_the_posture(make_stage: MakeStage) -> None:
    stage = make_stage()
    raise_torso(stage)
    stage.run(lambda: perform(CARRY))
    there = stage.platform.robot.postures[CARRYING][TORSO]
    assert stage.truth.configuration().joints[TORSO] == pytest.approx(there, abs=1e-3)


def test_inverse_kinematics_moves_a_slow_torso_only_where_the_arm_alone_does_not_get(make_slow: MakeStage) -> None:
    stage = make_slow()
    arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == "right")
    assert arm.lift is not None
    now, column = stage.platform.arm_joints(arm), arm.lift.column
    raised = now.copy()
    raised[column] = arm.lift.highest
    near, far = arm.chain.fk(np.stack([now, raised])).copy()
    near[2, 3] += 0.02
    far[2, 3] += 0.05
    q, solved = arm.solve(np.stack([near]), now[None, None])
    assert solved.all()
    assert q[0, column] == now[column]
    assert arm.chain.fk(q[0])[0] == pytest.approx(near, abs=1e-3)
    both, _ = arm.solve(np.stack([near, far]), np.broadcast_to(now, (2, 1, len(now))))
    assert np.array_equal(both[0], q[0]), "a target's result does not depend on the others"


def test_a_path_between_two_heights_keeps_a_slow_torso_between_them(make_slow: MakeStage) -> None:
    stage = make_slow()
    arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == "right")
    assert arm.lift is not None
    start = stage.platform.arm_joints(arm)
    goal = start.copy()
    goal[1:] = arm.seeds[1][1:]
    goal[arm.lift.column] = start[arm.lift.column]
    heights = stage.platform.arms.path(arm, goal).positions[:, arm.lift.column]
    assert np.ptp(heights) == pytest.approx(0.0, abs=1e-9)
