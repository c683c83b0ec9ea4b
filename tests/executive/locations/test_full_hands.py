"""What robots reach with a hand full: things with a free one, people and places with what is held."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planlang import at_location, perform
from planlang.designators import Location, a_device, a_location, a_person, action, an_object
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import CABINET, PLACE, WARD, MakeStage, Stage, hold_bottle, stand
from tests.executive.locations.conftest import MakeJudge

CUP = Body("cup", Pose((1.5, 0.3, 0.85)), (0.07, 0.07, 0.1), "cylinder", type="Cup", movable=True)
THE_CUP, THE_BED = an_object("Cup", PLACE + "cup"), an_object("Bed-PieceOfFurniture")
BEFORE, GRASPED = a_location(in_front_of=THE_CUP), a_location(in_center_of=THE_CUP)
OFFERED = a_location(in_reach_of=a_person("Patient"))
RIGHT = a_device("RightArm")


def arm_for(stage: Stage, location: Location) -> str:
    """The arm with which the first place was found."""
    return str(next(stage.resolver.bases(location)).detail["arm"])


@pytest.mark.parametrize(("full", "free", "y"), [("right", "left", 0.9), ("left", "right", -0.9)])
def test_a_thing_is_taken_with_the_free_hand_while_what_is_held_is_offered_and_put_down(
    full: str, free: str, y: float, make_stage: MakeStage, judge_of: MakeJudge
) -> None:
    beside = replace(CABINET, name="beside", pose=Pose((-1.7, y, 0.4)), size=(0.3, 0.3, 0.8))
    stage = make_stage(*WARD, beside, replace(CUP, pose=Pose((-1.7, y, 0.85))))
    hold_bottle(stage, full)
    for wanted in (THE_CUP, BEFORE, GRASPED):
        assert arm_for(stage, a_location(in_reach_of=wanted)) == free
    for wanted in (THE_BED, OFFERED, a_location(on=THE_BED)):
        assert arm_for(stage, a_location(in_reach_of=wanted)) == full
    both = next(stage.resolver.bases(a_location(in_reach_of=(OFFERED, GRASPED)))).base
    stand(stage, both)
    for name, hand in ((free, GRASPED), (full, OFFERED)):
        arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == name)
        way = next(stage.resolver.hands(hand, arm, stage.platform.arm_joints(arm)))
        assert way.arm.name == name
        judge_of(stage).assert_possible(way, both, stage)


def test_a_full_hand_that_is_asked_to_grasp_is_the_reason_for_the_failure(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, CUP)
    hold_bottle(stage, "right")
    said = "no free hand to grasp cup: right holds bottle"
    location = a_location(in_reach_of=THE_CUP, using=RIGHT)
    with pytest.raises(LocationUnresolvable, match=said):
        next(stage.resolver.bases(location))
    assert not stage.resolver.holds(location)
    arm = stage.platform.scene.arms.of(RIGHT)[0]
    with pytest.raises(LocationUnresolvable, match=said):
        next(stage.resolver.hands(BEFORE, arm, stage.platform.arm_joints(arm)))


def test_a_plan_takes_a_second_thing_with_its_free_hand(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD, CUP)
    hold_bottle(stage, "right")

    async def take() -> None:
        await perform(action("Reaching", to_location=BEFORE))
        await perform(action("OpeningAGripper", object_acted_on=THE_CUP))
        await perform(action("Reaching", to_location=GRASPED))
        await perform(action("ClosingAGripper", object_acted_on=THE_CUP))

    async def plan() -> None:
        await at_location(a_location(in_reach_of=(THE_CUP, BEFORE, GRASPED)), take)

    stage.run(plan)
    assert {name: grip.arm for name, grip in stage.belief.held.items()} == {"bottle": "right", "cup": "left"}
