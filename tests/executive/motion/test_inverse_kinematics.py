"""Facts about inverse kinematics: every solution is verified by forward kinematics and the limits."""

from collections.abc import Callable

import numpy as np
import pytest

from executive.motion.kinematics import ANGLE_TOLERANCE, POSITION_TOLERANCE, Chain
from executive.motion.symbolic import WORTH, RowFunction
from planlang.geometry import Array

ROBOTS = ["amigo", "pr2", "panda"]
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "xyz": (3**-0.5, 3**-0.5, 3**-0.5)}


def position_error(reached: Array, wanted: Array) -> Array:
    """Distances (m,) of tips [m]."""
    return np.asarray(np.linalg.norm(reached[:, :3, 3] - wanted[:, :3, 3], axis=1))


def angle_between(a: Array, b: Array) -> Array:
    """Angles (m,) of rotations (m, 3, 3) [rad]; exact for small ones."""
    return np.asarray(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=(1, 2)) / np.sqrt(8), 0, 1)))


def half_turn(axis: tuple[float, float, float]) -> Array:
    """The pose (4, 4) that is turned by exactly half a turn about an axis (3,) of length 1."""
    turn = np.eye(4)
    turn[:3, :3] = 2 * np.outer(axis, axis) - np.eye(3)
    return turn


@pytest.mark.parametrize("robot", ROBOTS)
def test_reachable_targets_are_reached_within_limits(robot: str, chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of(robot)
    rng = np.random.default_rng(0)
    targets = chain.fk(chain.sample(rng, 300))
    q, ok = chain.solve(targets, chain.sample(rng, (300, 20)))
    assert ok.mean() >= 0.99
    reached = chain.fk(q[ok])
    assert position_error(reached, targets[ok]).max() <= POSITION_TOLERANCE
    assert angle_between(reached[:, :3, :3], targets[ok][:, :3, :3]).max() <= ANGLE_TOLERANCE
    assert chain.within(q[ok]).all()


def test_unreachable_targets_are_not_ok_and_come_as_near_as_can_be(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("panda")
    rng = np.random.default_rng(0)
    target = np.eye(4)
    target[:3, 3] = 3.0, 0.0, 0.5
    q, ok = chain.solve(target[None], chain.sample(rng, (1, 10)))
    assert not ok.any()
    assert chain.within(q).all()
    assert 2.0 < position_error(chain.fk(q), target[None])[0] < 2.4


def test_solution_does_not_depend_on_the_other_targets(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    rng = np.random.default_rng(5)
    targets, seeds = chain.fk(chain.sample(rng, 40)), chain.sample(rng, (40, 10))
    together, ok = chain.solve(targets, seeds)
    for i in reversed(range(40)):
        alone, alone_ok = chain.solve(targets[i : i + 1], seeds[i : i + 1])
        assert np.array_equal(alone[0], together[i])
        assert alone_ok[0] == ok[i]


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_step_on_many_rows_at_once_rounds_as_on_each_alone(robot: str, chain_of: Callable[[str], Chain]) -> None:
    """So that a solution does not depend on how much was solved before, and a resumed run goes on as the whole one."""
    chain = chain_of(robot)
    rng = np.random.default_rng(0)
    q, poses = chain.sample(rng, 600).T, chain.fk(chain.sample(rng, 600))
    targets = np.concatenate([poses[:, :3, :3].reshape(-1, 9), poses[:, :3, 3]], axis=1).T
    function = chain.functions.step_function()
    together, alone = RowFunction(function)(q, targets), RowFunction(function)
    each = [alone(q[:, [k]], targets[:, [k]]) for k in range(WORTH)]  # those after them would be on vectors
    for number, results in enumerate(together):
        assert np.array_equal(results[:, :WORTH], np.concatenate([one[number] for one in each], axis=1))


def test_seed_that_is_a_solution_is_returned_unchanged(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    q = chain.sample(np.random.default_rng(6), 1)
    found, ok = chain.solve(chain.fk(q), q[None])
    assert ok.all()
    np.testing.assert_allclose(found, q, atol=1e-12)


def test_near_target_is_solved_near_its_seed(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    ik = chain
    q = np.array([0.2, -0.6, 0.3, 0.2, 1.2, 0.1, 0.1, 0.1])
    target = chain.fk(q)[0]
    target[:3, 3] += 0.0, 0.0, 0.02
    found, ok = ik.solve(target[None], q[None, None])
    assert ok.all()
    assert np.abs(found - q).max() < 0.1


def test_continuous_joints_stay_within_half_a_turn_of_the_first_seed(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("pr2")
    rng = np.random.default_rng(9)
    targets, seeds = chain.fk(chain.sample(rng, 50)), chain.sample(rng, (50, 10))
    q, _ = chain.solve(targets, seeds)
    assert chain.continuous.sum() == 2
    assert np.abs(q - seeds[:, 0])[:, chain.continuous].max() <= np.pi + 1e-9


@pytest.mark.parametrize("axis", AXES)
def test_a_tip_turned_by_half_a_turn_is_not_at_its_target(axis: str, chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    q = chain.sample(np.random.default_rng(10), 50)
    targets = chain.fk(q) @ half_turn(AXES[axis])
    found, ok = chain.solve(targets, q[:, None])
    reached = chain.fk(found[ok])
    assert np.abs(reached - targets[ok]).max(initial=0.0) <= ANGLE_TOLERANCE


def test_from_a_seed_that_is_half_a_turn_away_the_tip_is_turned_to_the_target(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("panda")
    q = chain.sample(np.random.default_rng(11), 50)
    q[:, -1] = np.where(np.arange(50) % 2, 1.5, -1.5)  # the last joint turns the hand about its own axis
    seeds = q.copy()
    seeds[:, -1] += np.where(np.arange(50) % 2, -np.pi, np.pi)
    targets = chain.fk(q)
    found, ok = chain.solve(targets, seeds[:, None])
    assert ok.mean() > 0.3, "one way around it cannot turn"
    assert angle_between(chain.fk(found[ok])[:, :3, :3], targets[ok][:, :3, :3]).max() <= ANGLE_TOLERANCE


@pytest.mark.parametrize(
    ("spoiled", "said"),
    [
        (np.diag([-1.0, 1.0, 1.0, 1.0]), "reflection"),
        (np.diag([2.0, 2.0, 2.0, 1.0]), r"R R\^T .* differs from 1 by 3"),
        (np.array([[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), "differs from 1 by"),
        (np.diag([0.0, 0.0, 0.0, 1.0]), "differs from 1 by 1"),
        (np.diag([np.nan, 1.0, 1.0, 1.0]), "not finite"),
        (np.array([[1, 0, 0, np.inf], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), "not finite"),
        (np.diag([1e200, 1e200, 1e200, 1.0]), "differs from 1 by inf"),
    ],
)
def test_targets_that_are_no_poses_are_refused(spoiled: Array, said: str, chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    q = chain.sample(np.random.default_rng(14), 5)
    targets = chain.fk(q)
    targets[3] = spoiled
    with pytest.raises(ValueError, match=f"target 3 .*{said}"):
        chain.solve(targets, q[:, None])


def test_a_rotation_that_is_not_quite_one_means_the_nearest(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    rng = np.random.default_rng(15)
    targets = chain.fk(chain.sample(rng, 100))
    rough = targets.copy()
    rough[:, :3, :3] += rng.uniform(-1.5e-3, 1.5e-3, (100, 3, 3))
    q, ok = chain.solve(rough, chain.sample(rng, (100, 20)))
    assert ok.mean() >= 0.99
    left, _, right = np.linalg.svd(rough[:, :3, :3])
    assert angle_between(chain.fk(q[ok])[:, :3, :3], (left @ right)[ok]).max() <= 1.01 * ANGLE_TOLERANCE


def test_arrays_of_the_wrong_shape_are_refused(chain_of: Callable[[str], Chain]) -> None:
    ik = chain_of("panda")
    with pytest.raises(ValueError, match=r"seeds \(m, s, 7\)"):
        ik.solve(np.eye(4)[None], np.zeros((1, 7)))
    with pytest.raises(ValueError, match="at least one seed"):
        ik.solve(np.eye(4)[None], np.zeros((1, 0, 7)))
