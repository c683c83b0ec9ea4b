"""Facts about straight lines of the tip."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from executive.motion.kinematics import Chain, InverseKinematics
from executive.motion.tip_line import LARGEST_STRAY, cartesian_path, keeps_line
from planlang.geometry import Array


@pytest.fixture(scope="module")
def panda_ik(chain_of: Callable[[str], Chain]) -> InverseKinematics:
    """Inverse kinematics of the Panda."""
    return InverseKinematics(chain_of("panda"))


READY = np.array([0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8])


@pytest.mark.parametrize("turn", [0.0, 1e-7, 0.4, -1.9, -3.1, -np.pi + 1e-4, -np.pi + 1e-6])
def test_tip_moves_on_a_straight_line_and_turns_evenly(panda_ik: InverseKinematics, turn: float) -> None:
    chain = panda_ik.chain
    start = chain.fk(READY)[0]
    goal = start.copy()
    goal[:3, 3] += 0.1, 0.05, -0.12
    goal[:3, :3] = goal[:3, :3] @ np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    line = cartesian_path(panda_ik, READY, start, goal, lambda q: True, steps=10)
    assert line.waypoints is not None
    assert line.waypoints.shape == (11, 7)
    poses = chain.fk(line.waypoints)
    share = np.linspace(0, 1, 11)[:, None]
    np.testing.assert_allclose(poses[:, :3, 3], start[:3, 3] + share * (goal[:3, 3] - start[:3, 3]), atol=1.1e-4)
    turned = np.arccos(np.clip((np.trace(start[:3, :3].T @ poses[:, :3, :3], axis1=1, axis2=2) - 1) / 2, -1, 1))
    np.testing.assert_allclose(turned, share[:, 0] * abs(turn), atol=3e-3)


@pytest.mark.parametrize(
    ("move", "is_free", "said"),
    [
        ((1.0, 0.0, 0.0), lambda q: True, "the tip does not reach step 4 of 9"),
        ((0.1, 0.0, 0.0), lambda q: False, "in collision at step 1 of 9"),
    ],
)
def test_line_that_breaks_says_why(
    panda_ik: InverseKinematics, move: tuple[float, float, float], is_free: Callable[[Array], bool], said: str
) -> None:
    start = panda_ik.chain.fk(READY)[0]
    goal = start.copy()
    goal[:3, 3] += move
    line = cartesian_path(panda_ik, READY, start, goal, is_free, largest_step=7.0)
    assert line.waypoints is None
    assert said in line.reason


def test_jump_of_a_joint_breaks_the_line(panda_ik: InverseKinematics) -> None:
    start = panda_ik.chain.fk(READY)[0]
    goal = start.copy()
    goal[:3, 3] += 0.0, 0.3, 0.0
    line = cartesian_path(panda_ik, READY, start, goal, lambda q: True, steps=2, largest_step=0.05)
    assert line.waypoints is None
    assert "would jump by" in line.reason


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_steps_are_halved_until_the_tip_keeps_its_line_between_them(panda_ik: InverseKinematics, steps: int) -> None:
    chain = panda_ik.chain
    start = chain.fk(READY)[0]
    goal = start.copy()
    goal[:3, 3] += 0.1, 0.25, -0.1
    line = cartesian_path(panda_ik, READY, start, goal, lambda q: True, steps=steps, largest_step=7.0)
    assert line.waypoints is not None
    assert len(line.waypoints) > steps + 1
    shares = np.linspace(0, 1, 9)[:, None]
    rows = np.concatenate([a + shares * (b - a) for a, b in pairwise(line.waypoints)])
    off = np.cross(chain.fk(rows)[:, :3, 3] - start[:3, 3], goal[:3, 3] - start[:3, 3])
    assert np.linalg.norm(off, axis=1).max() / np.linalg.norm(goal[:3, 3] - start[:3, 3]) < 1.1 * LARGEST_STRAY


def turned(angle: float) -> Array:
    """A pose 0.2 m ahead, turned about the vertical."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0.2], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.mark.parametrize("turn", [0.0, 0.5, -3.0, np.pi])
@pytest.mark.parametrize(
    ("moved", "tilt", "kept"),
    [
        ((0.1, 0, 0), 0.0, True),
        ((0.1, 0.0009, 0), 0.009, True),
        ((0.1, 0.0011, 0), 0.0, False),
        ((0.1, 0, 0), 0.011, False),
        ((0.202, 0, 0), 0.0, False),
        ((-0.002, 0, 0), 0.0, False),
    ],
)
def test_a_pose_keeps_a_line_that_is_near_it_and_is_turned_about_its_axis(
    turn: float, moved: tuple[float, float, float], tilt: float, kept: bool
) -> None:
    pose = turned(turn / 2)
    pose[:3, 3] = moved
    pose[:3, :3] = [[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]] @ pose[:3, :3]
    assert keeps_line(pose[None], np.eye(4), turned(turn)) is kept
