"""Facts about paths of an arm: they are free at the resolution, and failures say what was wrong."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from executive.motion.arm_path import IsFree, cartesian_path, plan_path
from executive.motion.errors import GoalInCollision, StartInCollision
from executive.motion.kinematics import Chain, InverseKinematics
from planlang.protocols import Array

LOW, HIGH = np.zeros(2), np.ones(2) * 4
START, GOAL = np.array([0.5, 0.5]), np.array([3.5, 3.5])


def maze(rng: np.random.Generator, shaved: float = 0.0) -> IsFree:
    """Three walls 0.3 thick across a square of side 4, each with a gap of 0.6 somewhere, shaved on all sides."""
    gaps = rng.uniform(0.2, 3.2, 3)

    def is_free(q: Array) -> bool:
        return all(
            not (0.9 + i + shaved < q[0] < 1.2 + i - shaved) or gap - shaved < q[1] < gap + 0.6 + shaved
            for i, gap in enumerate(gaps)
        )

    return is_free


def crosses(path: Array, is_free: IsFree) -> bool:
    """Whether any point of a polyline, looked at much finer than it was planned, is not free."""
    return not all(
        is_free(a + share * (b - a))
        for a, b in pairwise(path)
        for share in np.linspace(0, 1, max(2, int(np.abs(b - a).max() / 0.01)))
    )


@pytest.mark.parametrize("seed", range(20))
def test_path_through_a_random_maze_never_crosses_a_wall(seed: int) -> None:
    is_free = maze(np.random.default_rng(seed))
    path = plan_path(START, GOAL, is_free, LOW, HIGH, np.random.default_rng(seed), resolution=0.02, checks=20000)
    assert path is not None
    assert np.array_equal(path[0], START)
    assert np.array_equal(path[-1], GOAL)
    # between two checks, 0.02 apart, a corner may be cut by half of that
    assert not crosses(path, maze(np.random.default_rng(seed), shaved=0.01))


def test_straight_way_is_taken_when_it_is_free() -> None:
    path = plan_path(START, GOAL, lambda q: True, LOW, HIGH, np.random.default_rng(0))
    assert path is not None
    assert path.tolist() == [START.tolist(), GOAL.tolist()]


def test_equal_generators_give_equal_paths() -> None:
    is_free = maze(np.random.default_rng(3))
    paths = [plan_path(START, GOAL, is_free, LOW, HIGH, np.random.default_rng(9)) for _ in range(2)]
    assert paths[0] is not None
    assert paths[1] is not None
    assert np.array_equal(paths[0], paths[1])


def test_no_configuration_is_checked_twice() -> None:
    seen: list[tuple[float, ...]] = []
    free = maze(np.random.default_rng(4))

    def is_free(q: Array) -> bool:
        seen.append(tuple(q))
        return free(q)

    assert plan_path(START, GOAL, is_free, LOW, HIGH, np.random.default_rng(0)) is not None
    assert len(seen) == len(set(seen))


def test_search_ends_without_a_path_after_the_checks_allowed() -> None:
    calls = 0

    def is_free(q: Array) -> bool:
        nonlocal calls
        calls += 1
        return not 1.5 < q[0] < 2.0

    assert plan_path(START, GOAL, is_free, LOW, HIGH, np.random.default_rng(0), checks=500) is None
    assert calls == 500


def test_search_ends_without_a_path_after_its_iterations() -> None:
    wall = lambda q: not 1.5 < q[0] < 2.0  # noqa: E731
    assert plan_path(START, GOAL, wall, LOW, HIGH, np.random.default_rng(0), iterations=20) is None


def test_start_or_goal_in_collision_is_refused_saying_which() -> None:
    with pytest.raises(StartInCollision, match=r"0\.500, 0\.500"):
        plan_path(START, GOAL, lambda q: q[0] > 1, LOW, HIGH, np.random.default_rng(0))
    with pytest.raises(GoalInCollision, match=r"3\.500, 3\.500"):
        plan_path(START, GOAL, lambda q: q[0] < 1, LOW, HIGH, np.random.default_rng(0))


def test_start_outside_the_limits_is_no_obstacle() -> None:
    path = plan_path([-0.1, 0.5], GOAL, maze(np.random.default_rng(3)), LOW, HIGH, np.random.default_rng(0))
    assert path is not None


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="got shapes"):
        plan_path([0.0], GOAL, lambda q: True, LOW, HIGH, np.random.default_rng(0))
    with pytest.raises(ValueError, match="finite"):
        plan_path(START, GOAL, lambda q: True, -np.inf * HIGH, HIGH, np.random.default_rng(0))


@pytest.fixture(scope="module")
def panda_ik(chain_of: Callable[[str], Chain]) -> InverseKinematics:
    """Inverse kinematics of the Panda."""
    return InverseKinematics(chain_of("panda"))


READY = np.array([0.0, -0.6, 0.0, -2.2, 0.0, 1.6, 0.8])


def test_tip_moves_on_a_straight_line_and_turns_evenly(panda_ik: InverseKinematics) -> None:
    chain = panda_ik.chain
    start = chain.fk(READY)[0]
    goal = start.copy()
    goal[:3, 3] += 0.1, 0.05, -0.12
    turn = 0.4
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
    np.testing.assert_allclose(turned, share[:, 0] * turn, atol=3e-3)


@pytest.mark.parametrize(
    ("move", "is_free", "said"),
    [
        ((1.0, 0.0, 0.0), lambda q: True, "the tip does not reach step 4 of 9"),
        ((0.1, 0.0, 0.0), lambda q: False, "in collision at step 1 of 9"),
    ],
)
def test_line_that_breaks_says_why(
    panda_ik: InverseKinematics, move: tuple[float, float, float], is_free: IsFree, said: str
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
