"""Facts about straight lines of the tip."""

from collections.abc import Callable

import numpy as np
import pytest

from executive.motion.kinematics import Chain, InverseKinematics
from executive.motion.tip_line import cartesian_path
from planlang.protocols import Array


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
