"""Whoever asks on gets all places, also those that only a greater effort finds; what was found first stays so."""

from __future__ import annotations

import math
from itertools import combinations

import pytest

from executive.locations import Resolver
from executive.locations.resolver import APART
from executive.locations.search import BUDGETS
from planlang import at_location
from planlang.designators import a_location
from planlang.failures import LocationUnresolvable, ManipulationPoseUnreachable, ObjectUnreachable
from planlang.geometry import Pose
from planlang.protocols import Solution
from sim import Body
from tests.executive.conftest import BOTTLE, CABINET, THE_BOTTLE, MakeStage, Stage

GANGWAY = (
    CABINET,
    BOTTLE,
    *(Body(f"bench{y}", Pose((0.7, y, 0.25)), (2.4, 1.5, 0.5), type="Cupboard") for y in (-1.12, 1.12)),
    *(Body(f"box{y}", Pose((1.5, y, 0.95)), (0.3, 0.05, 0.3), type="Box") for y in (-0.14, 0.14)),
    Body("behind_it", Pose((2.6, 0.0, 0.25)), (1.5, 4.5, 0.5), type="Cupboard"),
    Body("behind_the_robot", Pose((-0.55, 0.0, 0.25)), (0.3, 0.8, 0.5), type="Cupboard"),
)
"""A bottle between boxes at the end of a gangway: few places have room, and few directions of the hand."""
IN_REACH = a_location(in_reach_of=THE_BOTTLE)


@pytest.fixture
def gangway(make_stage: MakeStage) -> Stage:
    """The robot in it, before the bottle."""
    return make_stage(*GANGWAY, start=(0.6, 0.0, 0.0))


def drained(stage: Stage) -> tuple[list[tuple[float, float, float]], str]:
    """All places, asked for anew, and what is said at the end."""
    found: list[Solution] = []
    with pytest.raises(LocationUnresolvable) as ended:
        found.extend(Resolver(stage.platform.scene).bases(IN_REACH))
    return [solution.base for solution in found], str(ended.value)


def test_the_iterator_goes_on_with_greater_efforts_until_there_are_no_more(
    gangway: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, said = drained(gangway)
    assert said.startswith(f"no more places than {len(found)}: in_reach_of(bottle): ")
    for one, other in combinations(found, 2):
        assert round(math.dist(one[:2], other[:2]), 4) > APART
    monkeypatch.setattr("executive.locations.resolver.BUDGETS", BUDGETS[:1])
    first, _ = drained(gangway)
    assert len(found) > len(first) > 0
    assert found[: len(first)] == first


def test_a_plan_tries_as_many_places_as_it_may(gangway: Stage) -> None:
    tried = []

    async def fail() -> None:
        tried.append(gangway.platform.base()[:2])
        raise ManipulationPoseUnreachable(arm="right", what="bottle")

    async def plan() -> None:
        await at_location(IN_REACH, fail, attempts=8)

    with pytest.raises(ObjectUnreachable) as ended:
        gangway.run(plan)
    assert isinstance(ended.value.__cause__, ManipulationPoseUnreachable), "there are more places than attempts"
    assert len(tried) == 8
    assert len({(round(x, 2), round(y, 2)) for x, y in tried}) == 8
