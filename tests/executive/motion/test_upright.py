"""Facts about paths that keep an axis of the hand upright."""

import itertools
import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest
from examples import examples
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from executive.motion import Chain, JointSpace, plan_path
from executive.motion.errors import NoPath
from executive.motion.upright import Upright
from planlang.geometry import Array
from tests.executive.motion.test_arm_path import Rough, touching

LIMIT = math.radians(12.0)
SEEDS = st.integers(0, 10_000)


def upright(chain: Chain, seed: int) -> tuple[Upright, np.random.Generator]:
    """An axis of the tip, any one, that is to stay upright."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    return Upright(chain, axis / np.linalg.norm(axis), LIMIT), rng


@pytest.mark.parametrize("robot", ["amigo", "panda"])
@given(seed=SEEDS)
def test_projection_leaves_what_is_upright_and_mostly_rights_what_is_not(
    chain_of: Callable[[str], Chain], robot: str, seed: int
) -> None:
    constraint, rng = upright(chain_of(robot), seed)
    q = constraint.chain.sample(rng, 200)
    projected = constraint.projected(q)
    assert constraint.chain.within(projected, 1e-9).all()
    assert constraint.holds(projected)[constraint.tilts(q) < math.radians(60)].mean() > 0.5
    assert np.array_equal(
        constraint.projected(projected)[constraint.holds(projected)], projected[constraint.holds(projected)]
    )


@pytest.mark.long
@pytest.mark.parametrize("robot", ["amigo", "panda"])
@settings(max_examples=examples(100))
@given(seed=SEEDS)
def test_a_path_that_is_found_between_upright_postures_keeps_upright_all_the_way(
    chain_of: Callable[[str], Chain], robot: str, seed: int
) -> None:
    constraint, start, goal, path = a_path(chain_of(robot), seed)
    assume(path is not None)  # the search is bounded, and not any two postures have a way
    assert np.array_equal(path[0], start)
    assert np.abs(path[-1] - goal).max() < 1e-9
    fine = np.concatenate([a + (b - a) * np.linspace(0, 1, 60)[:, None] for a, b in itertools.pairwise(path)])
    assert constraint.tilts(fine).max() < math.radians(15.0)


@pytest.mark.long
@pytest.mark.parametrize("robot", ["amigo", "panda"])
def test_between_nearly_any_two_upright_postures_a_path_is_found(chain_of: Callable[[str], Chain], robot: str) -> None:
    found = [a_path(chain_of(robot), seed)[-1] is not None for seed in range(50)]
    assert sum(found) >= 49


def a_path(chain: Chain, seed: int) -> tuple[Upright, Array, Array, Array | None]:
    """A constraint, two random postures that keep it, and a path between them, None if none was found."""
    constraint, rng = upright(chain, seed)
    q = constraint.projected(chain.sample(rng, 100))
    start, goal = q[constraint.holds(q)][:2]
    free = touching(lambda q: True)
    with suppress(NoPath):
        path = plan_path(start, goal, space(chain), Rough(), free, rng, constraint=constraint, iterations=3000)
        return constraint, start, goal, path
    return constraint, start, goal, None


def space(chain: Chain) -> JointSpace:
    """The joint space of a chain."""
    resolution: Array = np.where(chain.prismatic, 0.02, 0.08)
    return JointSpace.of(chain.lower, chain.upper, continuous=chain.continuous, resolution=resolution)
