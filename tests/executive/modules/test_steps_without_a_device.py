"""Steps that name no hand while one hand holds something: nothing is dropped, and the right hand acts."""

from __future__ import annotations

from dataclasses import replace

import pytest

from executive.robots import CARRYING
from planlang import perform
from planlang.designators import a_device, a_location, a_posture, action, an_object
from planlang.failures import ActionUnresolvable, GraspMissed
from planlang.geometry import Pose
from planlang.language.process_module import process_module
from sim import Body
from sim.truth import at_rest_on, held_by
from tests.executive.conftest import BOTTLE, CABINET, PLACE, THE_BOTTLE, MakeStage, Stage, hold_bottle

OTHER = replace(BOTTLE, name="other", pose=Pose((1.5, 0.3, 0.9)))
THE_OTHER = an_object("DrinkingBottle", PLACE + "other")
OPEN, PARK = action("OpeningAGripper"), action("Reaching", to_location=a_posture(CARRYING))


@pytest.fixture
def stage(make_stage: MakeStage) -> Stage:
    """Amigo with the bottle in its left hand, in the air, and another bottle on the cabinet ahead of it."""
    stage = make_stage(CABINET, BOTTLE, OTHER)
    hold_bottle(stage, "left")
    return stage


def around(stage: Stage, what: object, *steps: object, device: object = None) -> None:
    """Perform steps inside an action about an object, and with a device."""

    @process_module
    class Doing:
        name = "doing"
        actions = ("PurposefulAction",)
        failures = ()

        def resources(self, action: object) -> tuple[str, ...]:
            return ()

        async def execute(self, action: object) -> None:
            for step in steps:
                await perform(step)  # type: ignore[arg-type]

    stage.executive.modules = (Doing(), *stage.executive.modules)  # type: ignore[assignment, call-arg]
    used = {} if device is None else {"device_used": device}
    stage.run(lambda: perform(action("PurposefulAction", object_acted_on=what, **used)))  # type: ignore[arg-type]


def test_opening_opens_the_empty_hand(stage: Stage) -> None:
    stage.run(lambda: perform(OPEN))
    assert held_by(stage.truth, "bottle") == "robot"
    right = stage.platform.robot.arm("right").gripper
    assert right is not None
    joints = stage.truth.configuration().joints
    assert {name: joints[name] for name in right.joints} == pytest.approx(dict(right.opened), abs=1e-3)


def test_opening_is_refused_while_all_hands_hold_something(stage: Stage) -> None:
    hold_bottle(stage, "right", name="other")
    with pytest.raises(ActionUnresolvable, match="left holds bottle, right holds other; to let go of one, name it"):
        stage.run(lambda: perform(OPEN))
    assert {held_by(stage.truth, name) for name in ("bottle", "other")} == {"robot"}


def test_opening_for_an_action_around_it_opens_the_hand_with_its_object(stage: Stage) -> None:
    hold_bottle(stage, "right", name="other")
    around(stage, THE_OTHER, OPEN)
    assert (held_by(stage.truth, "bottle"), held_by(stage.truth, "other")) == ("robot", None)


def test_opening_to_grasp_a_thing_opens_the_empty_hand(stage: Stage) -> None:
    around(stage, THE_OTHER, OPEN)
    assert held_by(stage.truth, "bottle") == "robot"


def test_opening_lets_go_of_what_stands_already(make_stage: MakeStage) -> None:
    """As after lowering it, in a recipe that names neither hand nor object."""
    empty = make_stage(CABINET, BOTTLE)
    x, y, z = empty.truth.link_pose(empty.platform.robot.arm("left").tip).position
    top = z - BOTTLE.size[2] / 2 - 0.003
    post = Body("post", Pose((x, y, top - 0.05)), (0.05, 0.05, 0.1))
    stage = make_stage(CABINET, BOTTLE, post)
    hold_bottle(stage, "left")
    stage.run(lambda: perform(OPEN))
    assert at_rest_on(stage.truth, "bottle") == "post"


def test_closing_closes_the_empty_hand(stage: Stage) -> None:
    stage.run(lambda: perform(OPEN))
    with pytest.raises(GraspMissed) as caught:
        stage.run(lambda: perform(action("ClosingAGripper")))
    assert caught.value.arm == "right"


def test_parking_in_an_action_about_an_object_moves_the_hand_with_it(stage: Stage) -> None:
    hold_bottle(stage, "right", name="other")
    stage.platform.arms.choices.choose("left")
    modules = {module.name: module for module in stage.executive.modules}
    about = action("Reaching", object_acted_on=THE_OTHER, to_location=a_posture(CARRYING))
    assert modules["arm"].resources(about)[0] == "right"
    assert modules["arm"].resources(PARK)[0] == "left", "without an object, the hand that was used last"


@pytest.mark.parametrize("side", ["left", "right"])
def test_steps_are_done_with_the_hand_of_the_action_around_them(make_stage: MakeStage, side: str) -> None:
    stage = make_stage(CABINET, BOTTLE)
    fingers = {one: dict(stage.platform.robot.arm(one).gripper.opened) for one in ("left", "right")}  # type: ignore[union-attr]
    before = stage.truth.configuration().joints
    around(stage, THE_BOTTLE, OPEN, device=a_device(f"{side.title()}Arm"))
    after = stage.truth.configuration().joints
    moved = [one for one, joints in fingers.items() if any(abs(after[name] - before[name]) > 0.01 for name in joints)]
    assert moved == [side]


def test_a_tool_leaves_open_which_hand_is_used(stage: Stage) -> None:
    around(stage, THE_OTHER, OPEN, device=an_object("Sponge"))
    assert held_by(stage.truth, "bottle") == "robot"


def test_after_its_thing_has_left_the_hand_a_posture_is_taken_by_the_arm_that_had_it(stage: Stage) -> None:
    stage.platform.arms.choices.choose("right")
    modules = {module.name: module for module in stage.executive.modules}
    about = action("Reaching", object_acted_on=THE_OTHER, to_location=a_posture(CARRYING))
    assert modules["arm"].resources(about)[0] == "right", "not by the left one, although that holds the bottle"


def test_of_two_held_things_the_named_one_is_put_down(stage: Stage) -> None:
    hold_bottle(stage, "right", name="other")
    lower = action("LoweringAnObject", object_acted_on=THE_OTHER, to_location=a_location(on=an_object("Cabinet")))
    modules = {module.name: module for module in stage.executive.modules}
    assert modules["lowering"].resources(lower)[0] == "right"
    assert modules["lowering"].resources(replace(lower, properties=(("object_acted_on", THE_BOTTLE),)))[0] == "left"
