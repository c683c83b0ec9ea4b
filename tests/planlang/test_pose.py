"""Poses as quaternions and as matrices."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.geometry import Pose

component = st.floats(-1.0, 1.0)
poses = st.builds(Pose, st.tuples(component, component, component), st.tuples(*[component] * 4))


@given(st.tuples(component, component, component, component).filter(lambda q: math.hypot(*q) > 1e-3))
def test_a_pose_survives_becoming_a_matrix_and_back(quaternion: tuple[float, float, float, float]) -> None:
    norm = math.hypot(*quaternion)
    x, y, z, w = (value / norm for value in quaternion)
    pose = Pose((1.0, 2.0, 3.0), (x, y, z, w))
    again = Pose.from_matrix(pose.matrix())
    assert again.position == pose.position
    assert abs(np.dot(again.orientation, pose.orientation)) == pytest.approx(1.0, abs=1e-12)


def test_a_half_turn_about_a_diagonal_keeps_its_axis() -> None:
    half_turn = np.eye(4)
    half_turn[:3, :3] = [[0, -1, 0], [-1, 0, 0], [0, 0, -1]]
    assert np.allclose(Pose.from_matrix(half_turn).matrix(), half_turn, atol=1e-12)


@given(st.lists(poses, max_size=6))
def test_many_matrices_at_once_are_to_the_last_bit_those_of_one_by_one(several: list[Pose]) -> None:
    together = Pose.matrices(several)
    assert together.shape == (len(several), 4, 4)
    for matrix, pose in zip(together, several, strict=True):
        assert (matrix == pose.matrix()).all()
