"""Pointing the camera: where the neck allows it the point is in the middle, elsewhere it is told by how much not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.motion import Gaze
from executive.robots import bind_robot
from executive.robots.arms import gaze_of
from planlang.protocols import Configuration
from sim import PlanningWorld, Scene

ROBOT = bind_robot("amigo")


@pytest.fixture(scope="module")
def gaze() -> Gaze:
    """Amigo's."""
    found = gaze_of(ROBOT)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def world() -> PlanningWorld:
    """An empty world with Amigo at the origin, arms carrying."""
    return PlanningWorld(Scene(()), ROBOT.body())


@settings(deadline=None, max_examples=40)
@given(away=st.floats(0.6, 3.0), bearing=st.floats(-1.2, 1.2), height=st.floats(0.0, 1.8))
def test_the_camera_misses_a_point_by_what_is_said(
    gaze: Gaze, world: PlanningWorld, away: float, bearing: float, height: float
) -> None:
    point = np.array([away * math.cos(bearing), away * math.sin(bearing), height])
    neck, beyond, origin = gaze.at(point)
    assert ROBOT.camera is not None
    joints = dict(zip(gaze.joints, map(float, neck), strict=True))
    frame = world.link_pose(ROBOT.camera.link, Configuration((0.0, 0.0, 0.0), joints)).matrix()
    arrow = point - frame[:3, 3]
    missed = math.acos(min(1.0, float(frame[:3, :3] @ ROBOT.camera.forward @ arrow / np.linalg.norm(arrow))))
    assert missed == pytest.approx(beyond, abs=1e-3)
    assert frame[:3, 3] == pytest.approx(origin, abs=1e-3)


def test_what_is_ahead_is_met_within_half_a_step_of_the_table(gaze: Gaze) -> None:
    for point in ((1.5, 0.0, 1.0), (2.0, 0.8, 0.9), (1.0, -0.6, 0.8)):
        assert gaze.at(np.array(point))[1] < 0.05


def test_what_is_behind_is_beyond_the_neck(gaze: Gaze) -> None:
    assert gaze.at(np.array([-2.0, 0.0, 1.0]))[1] > 0.5
