"""Things that cannot be seen from where they are grasped are looked at from elsewhere before."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from executive.motion import Chain
from planlang import at_location, perform
from planlang.designators import a_location, action
from planlang.failures import ObjectNotFound
from planlang.geometry import Pose
from planlang.protocols import Solution
from sim import Body
from tests.executive.conftest import BOTTLE, THE_BOTTLE, MakeStage, Stage
from tests.support.detections import recognise

BEFORE, GRASPED = a_location(in_front_of=THE_BOTTLE), a_location(in_center_of=THE_BOTTLE)
HEIGHT = 0.3
"""Height of a table before which Amigo's camera does not see what stands on it [m]."""
TABLE = Body("table", Pose((1.6, 0.0, HEIGHT / 2)), (0.6, 1.0, HEIGHT), type="Table-PieceOfFurniture")


def bottle_at(x: float, y: float) -> Body:
    return replace(BOTTLE, pose=Pose((x, y, HEIGHT + 0.1)))


def first_of(stage: Stage) -> Solution:
    stage.platform.observe()
    return next(stage.resolver.bases(a_location(in_reach_of=THE_BOTTLE)))


async def take() -> None:
    async def body() -> None:
        await perform(action("Reaching", to_location=BEFORE))
        await perform(action("OpeningAGripper"))
        await perform(action("Reaching", to_location=GRASPED))
        await perform(action("ClosingAGripper", object_acted_on=THE_BOTTLE))

    await at_location(a_location(in_reach_of=THE_BOTTLE), body, reaching=(BEFORE, GRASPED))


@pytest.fixture
def low(make_stage: MakeStage) -> Stage:
    """A bottle on a low table."""
    return make_stage(TABLE, bottle_at(1.4, 0.0))


def classes(before: Sequence[object]) -> list[str]:
    return [getattr(one, "type", "") for one in before]


@pytest.mark.long
def test_a_bottle_on_a_low_table_is_grasped(low: Stage) -> None:
    low.run(take)
    assert "bottle" in low.truth.attached()


@pytest.mark.long
def test_a_bottle_that_stands_elsewhere_in_truth_is_grasped_where_it_was_seen(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, bottle_at(1.4, 0.0), truth=(TABLE, bottle_at(1.5, 0.25)))
    stage.run(take)
    assert "bottle" in stage.truth.attached()


@pytest.mark.long
def test_what_was_seen_is_not_looked_at_again_until_it_was_touched(low: Stage) -> None:
    recognise(low.belief, "bottle", low.belief.pose("bottle"), 1.0)
    low.belief.base_moved()
    assert low.belief.remembers("bottle")
    assert not first_of(low).before
    low.belief.bump("bottle", low.belief.pose("bottle") @ Pose((0.05, 0.0, 0.0)))
    assert not low.belief.remembers("bottle")
    assert first_of(low).before


@pytest.mark.long
def test_a_bottle_that_is_not_there_is_not_found(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, bottle_at(1.4, 0.0), truth=(TABLE, replace(BOTTLE, pose=Pose((-5.0, 5.0, 0.1)))))
    with pytest.raises(ObjectNotFound):
        stage.run(take)


@pytest.mark.long
def test_a_hand_is_where_the_bottle_is_although_it_is_looked_at_from_elsewhere_before(low: Stage) -> None:
    solution = first_of(low)
    assert classes(solution.before) == ["Translation-LocationChange", "LookingForSomething"]
    assert low.resolver.satisfies(a_location(in_reach_of=THE_BOTTLE), solution.base) is None, "it was never seen"
    recognise(low.belief, "bottle", low.belief.pose("bottle"), 1.0)
    assert low.resolver.satisfies(a_location(in_reach_of=THE_BOTTLE), solution.base) is not None


def test_what_the_robot_itself_hides_is_not_solved_for_one_base_pose_after_another(
    low: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    targets, solve = [0], Chain.solve

    def counted(self, poses, seeds):  # type: ignore[no-untyped-def]
        targets[0] += len(poses)
        return solve(self, poses, seeds)

    monkeypatch.setattr(Chain, "solve", counted)
    assert first_of(low).before
    assert targets[0] < 5_000
