"""Boxes around links go along with what moves: after any motions they are those that would be read anew."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import PlanningWorld
from tests.sim.conftest import AMIGO, ROOM, grasp

JOINTS = ("spindle_joint", "neck_pan_joint", "elbow_pitch_joint_left", "wrist_yaw_joint_right", "finger1_joint_left")
bases = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-math.pi, math.pi))
moves = st.tuples(st.none() | bases, st.dictionaries(st.sampled_from(JOINTS), st.floats(0.0, 0.2), max_size=3))


@pytest.fixture(scope="module")
def amigo() -> Iterator[PlanningWorld]:
    world = PlanningWorld(ROOM, AMIGO)
    yield world
    world.close()


@given(st.lists(st.tuples(moves, st.booleans()), min_size=1, max_size=6))
def test_boxes_are_the_same_whatever_moved_before_and_whenever_they_were_asked_for(
    amigo: PlanningWorld, steps: list[tuple[tuple[tuple[float, float, float] | None, dict[str, float]], bool]]
) -> None:
    robot = amigo.robot
    for (base, joints), asked in steps:
        robot.show(Configuration(base or robot.base, joints))
        if asked:
            robot.boxes()
    everything = range(len(robot.solid))
    for found, expected in zip(robot.boxes(), robot.boxes_of(everything), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-5)


def test_what_is_held_is_where_the_hand_has_it_whatever_was_looked_at_in_between(world: PlanningWorld) -> None:
    grasp(world)
    before = world.pose("bottle")
    now = world.configuration()
    elsewhere = Configuration((0.0, 0.0, 0.0), {**now.joints, "elbow_pitch_joint_right": 1.0})
    world.contacts(elsewhere)
    assert world.pose("bottle") == before
    world.set_configuration(elsewhere)
    moved = world.pose("bottle")
    assert moved.distance(before) > 0.5
    put = Pose((moved.position[0], moved.position[1], moved.position[2] + 0.1), moved.orientation)
    world.set_pose("bottle", put)
    world.step()
    assert world.pose("bottle").distance(put) < 1e-6
