"""What is between two things: on their common support, outside of both, whichever is named first."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import pytest

from executive.locations.demands import LocationMeaningless, hand_demand
from planlang.designators import Location, a_location, an_object, located
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from planlang.relations.demands import ReachKind
from tests.executive.conftest import BED, BOTTLE, CABINET, THE_BOTTLE, WARD, MakeStage, Stage, hold_bottle, stand
from tests.support.locations.predicates import is_between

THE_BED, THE_CABINET = an_object(BED.type), an_object(CABINET.type)
CUP = replace(BOTTLE, name="cup", type="Cup", pose=Pose((1.6, 0.3, 0.85)), size=(0.08, 0.08, 0.1))
GLASS = replace(CUP, name="glass", type="DrinkingGlass", pose=Pose((1.55, -0.25, 0.85)))
THE_CUP, THE_GLASS = an_object(CUP.type), an_object(GLASS.type)


@pytest.mark.parametrize("things", [(THE_BED, THE_CABINET), (THE_CABINET, THE_BED)], ids=str)
def test_a_base_stands_between_two_things_whichever_is_named_first(things: tuple[object, object], ward: Stage) -> None:
    location = a_location(between=things)  # type: ignore[arg-type]
    bases = [one.base for one in islice(ward.resolver.bases(location), 4)]
    assert len(bases) == 4
    for base in bases:
        assert is_between(base[:2], BED, CABINET)
        assert ward.resolver.satisfies(a_location(not_=location, near=THE_BED), base) is None
    stand(ward, bases[0])
    assert ward.executive.holds(located(location))
    stand(ward, (-2.5, 2.0, 0.0))
    assert not ward.executive.holds(located(location))


def test_the_middle_between_two_things_comes_first(ward: Stage) -> None:
    base = next(ward.resolver.bases(a_location(between=(THE_BED, THE_CABINET)))).base
    left, right = BED.pose.position[0] + BED.size[0] / 2, CABINET.pose.position[0] - CABINET.size[0] / 2
    assert base[0] == pytest.approx((left + right) / 2, abs=0.4)


def test_a_thing_between_two_others_is_on_what_both_stand_on(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, CUP, GLASS)
    poses = list(islice(stage.resolver.things(a_location(between=(THE_CUP, THE_GLASS)), THE_BOTTLE), 20))
    assert poses
    for pose in poses:
        assert is_between(pose.position[:2], CUP, GLASS)
        assert pose.position[2] - BOTTLE.size[2] / 2 == pytest.approx(CABINET.size[2], abs=0.01)


def test_what_is_in_a_hand_is_put_between_two_things(make_stage: MakeStage) -> None:
    stage, between = make_stage(*WARD, CUP, GLASS), a_location(between=(THE_GLASS, THE_CUP))
    with pytest.raises(LocationMeaningless, match="does not state what the hand is at"):
        hand_demand(between, stage.platform.scene, (0.0, 0.0))
    hold_bottle(stage)
    reach = hand_demand(between, stage.platform.scene, (0.0, 0.0))
    assert (reach.kind, reach.body, reach.bodies()) == (ReachKind.PLACE, "cabinet", ("cabinet", "glass", "cup"))


def test_between_things_on_different_supports_a_thing_needs_one_that_is_named(make_stage: MakeStage) -> None:
    stage, between = make_stage(*WARD, CUP), a_location(between=(THE_CUP, THE_BED))
    with pytest.raises(LocationMeaningless, match="does not state where bottle rests"):
        next(stage.resolver.things(between, THE_BOTTLE))
    assert next(stage.resolver.things(between & a_location(on=THE_CABINET), THE_BOTTLE))


@pytest.mark.parametrize(
    ("location", "why"),
    [
        (a_location(between=(THE_CABINET, THE_CABINET)), "relates cabinet to itself"),
        (a_location(between=(THE_BOTTLE, THE_CABINET)), "one of bottle and cabinet is within the other"),
        (a_location(between=(THE_BED, a_location(near=THE_BED))), "takes a thing or a person"),
        (
            a_location(between=(THE_BED, THE_CABINET), not_=a_location(between=(THE_CABINET, THE_BED))),
            "contradicts itself",
        ),
    ],
    ids=str,
)
def test_what_is_no_place_between_two_things_is_said(location: Location, why: str, ward: Stage) -> None:
    with pytest.raises(LocationMeaningless, match=why):
        next(ward.resolver.bases(location))


def test_nothing_is_on_one_of_two_things_and_between_them(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, CUP)
    with pytest.raises(LocationMeaningless, match="outside of both"):
        next(stage.resolver.things(a_location(on=THE_CABINET, between=(THE_CABINET, THE_BED)), THE_CUP))


def test_without_room_between_two_things_the_failure_says_how_much_is_lacking(make_stage: MakeStage) -> None:
    near = replace(CABINET, pose=Pose((BED.pose.position[0] + BED.size[0] / 2 + 0.45, 0.0, CABINET.pose.position[2])))
    stage = make_stage(BED, near)
    with pytest.raises(LocationUnresolvable) as caught:
        next(stage.resolver.bases(a_location(between=(THE_BED, THE_CABINET))))
    assert {"not between bed and cabinet", "no room for the base"} <= caught.value.counts.keys()
    assert "the robot needs 0.21 m more" in caught.value.figures, "it is 0.67 m wide, and they are 0.25 m apart"
