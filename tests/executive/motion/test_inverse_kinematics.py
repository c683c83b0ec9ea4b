"""Facts about inverse kinematics: every solution is verified by forward kinematics and the limits."""

from collections.abc import Callable

import numpy as np
import pytest

from executive.motion.kinematics import ANGLE_TOLERANCE, POSITION_TOLERANCE, Chain, InverseKinematics
from planlang.protocols import Array

ROBOTS = ["amigo", "pr2", "panda"]


def position_error(reached: Array, wanted: Array) -> Array:
    """Distances (m,) of tips [m]."""
    return np.asarray(np.linalg.norm(reached[:, :3, 3] - wanted[:, :3, 3], axis=1))


def angle_between(a: Array, b: Array) -> Array:
    """Angles (m,) of rotations (m, 3, 3) [rad]; exact for small ones."""
    return np.asarray(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=(1, 2)) / np.sqrt(8), 0, 1)))


@pytest.mark.parametrize("robot", ROBOTS)
def test_reachable_targets_are_reached_within_limits(robot: str, chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of(robot)
    rng = np.random.default_rng(0)
    targets = chain.fk(chain.sample(rng, 300))
    q, ok = InverseKinematics(chain).solve(targets, chain.sample(rng, (300, 20)))
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
    q, ok = InverseKinematics(chain).solve(target[None], chain.sample(rng, (1, 10)))
    assert not ok.any()
    assert chain.within(q).all()
    assert 2.0 < position_error(chain.fk(q), target[None])[0] < 2.4


def test_solution_does_not_depend_on_the_other_targets(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    rng = np.random.default_rng(5)
    targets, seeds = chain.fk(chain.sample(rng, 40)), chain.sample(rng, (40, 10))
    together, ok = InverseKinematics(chain).solve(targets, seeds)
    solver = InverseKinematics(chain)
    for i in reversed(range(40)):
        alone, alone_ok = solver.solve(targets[i : i + 1], seeds[i : i + 1])
        assert np.array_equal(alone[0], together[i])
        assert alone_ok[0] == ok[i]


def test_seed_that_is_a_solution_is_returned_unchanged(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    q = chain.sample(np.random.default_rng(6), 1)
    found, ok = InverseKinematics(chain).solve(chain.fk(q), q[None])
    assert ok.all()
    np.testing.assert_allclose(found, q, atol=1e-12)


def test_near_target_is_solved_near_its_seed(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("amigo")
    ik = InverseKinematics(chain)
    q = np.array([0.2, -0.6, 0.3, 0.2, 1.2, 0.1, 0.1, 0.1])
    target = chain.fk(q)[0]
    target[:3, 3] += 0.0, 0.0, 0.02
    found = ik.solve_one(target, q)
    assert found is not None
    assert np.abs(found - q).max() < 0.1


def test_random_restarts_come_from_the_generator_passed_in(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("panda")
    ik = InverseKinematics(chain)
    rng = np.random.default_rng(7)
    targets = chain.fk(chain.sample(rng, 30))
    found = [ik.solve_one(target, chain.lower, np.random.default_rng(1)) for target in targets]
    again = [ik.solve_one(target, chain.lower, np.random.default_rng(1)) for target in targets]
    assert sum(q is not None for q in found) >= 29
    assert all(np.array_equal(a, b) for a, b in zip(found, again, strict=True) if a is not None and b is not None)


@pytest.mark.parametrize("robot", ROBOTS)
def test_free_axis_points_as_wanted_and_the_rest_is_left_open(robot: str, chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of(robot)
    rng = np.random.default_rng(8)
    targets = chain.fk(chain.sample(rng, 100))
    turned = targets.copy()
    angle = 1.3
    turned[:, :3, :3] = targets[:, :3, :3] @ np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    q, ok = InverseKinematics(chain, free_axis=(0, 0, 1)).solve(turned, chain.sample(rng, (100, 20)))
    assert ok.mean() >= 0.99
    reached = chain.fk(q[ok])
    assert position_error(reached, turned[ok]).max() <= POSITION_TOLERANCE
    assert np.linalg.norm(reached[:, :3, 2] - turned[ok][:, :3, 2], axis=1).max() <= ANGLE_TOLERANCE


def test_continuous_joints_stay_within_half_a_turn_of_the_first_seed(chain_of: Callable[[str], Chain]) -> None:
    chain = chain_of("pr2")
    rng = np.random.default_rng(9)
    targets, seeds = chain.fk(chain.sample(rng, 50)), chain.sample(rng, (50, 10))
    q, _ = InverseKinematics(chain).solve(targets, seeds)
    assert chain.continuous.sum() == 2
    assert np.abs(q - seeds[:, 0])[:, chain.continuous].max() <= np.pi + 1e-9


def test_arrays_of_the_wrong_shape_are_refused(chain_of: Callable[[str], Chain]) -> None:
    ik = InverseKinematics(chain_of("panda"))
    with pytest.raises(ValueError, match=r"seeds \(m, s, 7\)"):
        ik.solve(np.eye(4)[None], np.zeros((1, 7)))
    with pytest.raises(ValueError, match="at least one seed"):
        ik.solve(np.eye(4)[None], np.zeros((1, 0, 7)))
    with pytest.raises(ValueError, match="free_axis"):
        InverseKinematics(chain_of("panda"), free_axis=(0, 0, 0))
