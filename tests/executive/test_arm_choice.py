"""Facts about the arm that a plan uses where it leaves the choice."""

from __future__ import annotations

import pytest

from executive.modules.arms import ArmChoices
from executive.modules.grasping import Grasping
from planlang import VirtualHost, checkpoint, par, perform, run, seq
from planlang.designators import a_device, a_location, action, an_object
from planlang.geometry import Pose
from planlang.protocols import Solution
from sim import Body
from tests.executive.conftest import CABINET, PLACE, MakeStage

CHOICES = "right", "left"


def test_side_by_side_each_strand_keeps_its_own_arm() -> None:
    choices, seen = ArmChoices(), []

    async def one(arm: str) -> None:
        choices.choose(arm)
        await checkpoint()
        seen.append((arm, choices.mine(), choices.others()))
        await checkpoint()

    async def plan() -> None:
        await par(lambda: one("right"), lambda: one("left"))

    run(plan, host=VirtualHost())
    assert seen == [("right", "right", {"left"}), ("left", "left", {"right"})]


def test_a_strand_goes_on_with_what_was_chosen_before_it_and_inside_of_it() -> None:
    choices, seen = ArmChoices(), []

    async def look() -> None:
        seen.append(choices.mine())

    async def reach() -> None:
        choices.choose("left")
        await checkpoint()

    async def plan() -> None:
        assert choices.mine() is None
        await par(reach, look)  # reach chooses, and what comes after both goes on with it
        seen.append(choices.mine())
        choices.choose("right")
        await seq(look, lambda: par(look, look))
        assert choices.others() == frozenset()

    run(plan, host=VirtualHost())
    assert seen == [None, "left", "right", "right", "right"]


def test_choices_are_kept_for_a_run_that_is_resumed() -> None:
    choices = ArmChoices()
    choices.choose("left")
    again = ArmChoices.restored(choices.state(), CHOICES)
    assert again.mine() == "left"
    with pytest.raises(KeyError):
        ArmChoices.restored({"plan": "third"}, CHOICES)


def test_where_no_plan_runs_the_last_choice_counts() -> None:
    choices = ArmChoices()
    for arm in CHOICES:
        choices.choose(arm)
        assert (choices.mine(), choices.others()) == (arm, frozenset())


def test_what_is_done_at_a_place_is_done_with_the_arm_it_was_found_for(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET)
    opens = Grasping(stage.executive.platform)
    for arm in CHOICES:
        stage.executive.move_to(Solution((0.0, 0.0, 0.0), stage.executive.revision(), {"arm": arm}))
        assert opens.resources(action("OpeningAGripper", device_used=a_device("HolderGripper"))) == (arm,)
    stage.executive.move_to(Solution((0.0, 0.0, 0.0), stage.executive.revision(), {}))
    assert opens.resources(action("OpeningAGripper")) == (arm,)


def test_two_plans_side_by_side_take_two_things_with_two_arms(make_stage: MakeStage) -> None:
    bottles = [
        Body(name, Pose((1.5, y, 0.9)), (0.065, 0.065, 0.2), "cylinder", type="DrinkingBottle", movable=True)
        for name, y in (("first", -0.2), ("second", 0.2))
    ]
    stage = make_stage(CABINET, *bottles, start=(0.83, 0.0, 0.0))

    async def take(name: str) -> None:
        what = an_object("DrinkingBottle", PLACE + name)
        await perform(action("Reaching", to_location=a_location(in_front_of=what)))
        await perform(action("OpeningAGripper"))
        await perform(action("Reaching", to_location=a_location(in_center_of=what)))
        await perform(action("ClosingAGripper", object_acted_on=what))

    async def plan() -> None:
        await par(lambda: take("first"), lambda: take("second"))

    stage.run(plan)
    held = {name: grip.arm for name, grip in stage.belief.held.items()}
    assert sorted(held) == ["first", "second"]
    assert sorted(held.values()) == ["left", "right"]
