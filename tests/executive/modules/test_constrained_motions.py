"""Phases of constrained motions: what their constraints are about, and what a resumed run knows of them again."""

import pytest

from executive.modules.tools.motion_grounding import Grounding, constraints_of
from planlang import perform
from planlang.designators import Device, a_location, action, an_object
from planlang.failures import ActionUnresolvable
from planlang.geometry import Pose
from planlang.motion_constraints import ConstraintsUnsatisfied, a_constraint, a_feature
from sim import Body
from tests.executive.conftest import PLACE, MakeStage, stand

CUP, PAN = an_object("Cup"), an_object("FryingPan")
MOUTH = a_feature(of=an_object("ObjectActedOn"), path=("MouthOfVessel",))
TOP = a_feature(of=an_object("TargetOfMotion"), path=("TopSide",))
ABOVE = a_constraint("HEIGHT", MOUTH, TOP, lower=0.1)
TABLE = Body("table", Pose((1.3, 0.0, 0.37)), (0.6, 1.4, 0.74), type="KitchenTable")
A_CUP = Body(
    "cup",
    Pose((1.2, 0.0, 0.8)),
    (0.08, 0.08, 0.1),
    "cylinder",
    type="Cup",
    iri=PLACE + "cup",
    movable=True,
    largest_tilt=0.2,
)


@pytest.mark.parametrize("target", [PAN, a_location(on=PAN)])
def test_features_are_those_of_what_the_action_acts_on_and_goes_to(target: object) -> None:
    (found,) = constraints_of(action("PouringMotion", object_acted_on=CUP, to_location=target, constrained_by=(ABOVE,)))
    assert (found.tool.of, found.world.of) == (CUP, PAN)


def test_a_motion_that_does_not_say_what_it_is_about_is_refused() -> None:
    with pytest.raises(ActionUnresolvable, match="to_location"):
        constraints_of(action("PouringMotion", object_acted_on=CUP, constrained_by=(ABOVE,)))


@pytest.mark.long
def test_constraints_that_contradict_each_other_are_named_and_no_others(make_stage: MakeStage) -> None:
    """Not from where the base is, and no place to which it could drive is any better."""
    stage = make_stage(TABLE)
    stand(stage, (-1.5, 0.0, 0.0))
    hand = a_feature(
        "LINE",
        of=Device("Hand", stage.platform.robot.arm("left").iri),
        position=(0.0, 0.0, 0.0),
        direction=(0.0, 0.0, 1.0),
    )
    top = a_feature(
        "PLANE", of=an_object("KitchenTable", PLACE + "table"), position=(0.0, 0.0, 0.37), direction=(0.0, 0.0, 1.0)
    )
    asked = (
        a_constraint("HEIGHT", hand, top, lower=0.2, name="over"),
        a_constraint("HEIGHT", hand, top, upper=0.1, name="low"),
        a_constraint("DISTANCE", hand, top, upper=4.0, name="near"),
        a_constraint("PERPENDICULARITY", hand, top, lower=-1.2, upper=1.2, name="any"),
    )
    with pytest.raises(ConstraintsUnsatisfied, match="contradict") as caught:
        stage.run(lambda: perform(action("ITaSCMotion", constrained_by=asked)))
    assert set(caught.value.constraints) == {"over", "low"}


def test_a_tool_that_may_not_lean_does_not_change_what_its_motion_is_about(make_stage: MakeStage) -> None:
    """Else bases are looked for around the middle between that thing and the map's origin."""
    stage = make_stage(TABLE, A_CUP)
    platform = stage.platform
    stand(stage, (-1.5, 0.0, 0.0))
    platform.belief.grasped("cup", "left", platform.robot.arm("left").tip, Pose((0.0, 0.0, 0.0)))
    cup = an_object("Cup", PLACE + "cup")
    mouth = a_feature("LINE", of=cup, position=(0.0, 0.0, 0.05), direction=(0.0, 0.0, 1.0))
    top = a_feature(
        "PLANE", of=an_object("KitchenTable", PLACE + "table"), position=(0.0, 0.0, 0.37), direction=(0.0, 0.0, 1.0)
    )
    grounding = Grounding(platform, (a_constraint("HEIGHT", mouth, top, lower=0.1, upper=0.3),))
    motion = grounding.grounded()
    assert grounding.uprights(motion), "the cup may not lean"
    assert [str(one) for one in motion.things] == [str(top.of)]
