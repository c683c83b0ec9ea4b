"""Phases of constrained motions: what their constraints are about, and what a resumed run knows of them again."""

import pytest

from executive.modules.constrained_motions import constraints_of
from executive.modules.phases import Phases
from planlang.designators import a_location, action, an_object
from planlang.failures import ActionUnresolvable
from planlang.geometry import Pose
from planlang.motion_constraints import MotionConstraint, a_constraint, a_feature

CUP, PAN = an_object("Cup"), an_object("FryingPan")
MOUTH = a_feature(of=an_object("ObjectActedOn"), path=("MouthOfVessel",))
TOP = a_feature(of=an_object("TargetOfMotion"), path=("TopSide",))
ABOVE = a_constraint("HEIGHT", MOUTH, TOP, lower=0.1)


@pytest.mark.parametrize("target", [PAN, a_location(on=PAN)])
def test_features_are_those_of_what_the_action_acts_on_and_goes_to(target: object) -> None:
    (found,) = constraints_of(action("PouringMotion", object_acted_on=CUP, to_location=target, constrained_by=(ABOVE,)))
    assert (found.tool.of, found.world.of) == (CUP, PAN)


def test_a_motion_that_does_not_say_what_it_is_about_is_refused() -> None:
    with pytest.raises(ActionUnresolvable, match="needs to_location"):
        constraints_of(action("PouringMotion", object_acted_on=CUP, constrained_by=(ABOVE,)))


def test_a_resumed_run_knows_where_things_were_and_what_held_before() -> None:
    phases, again = Phases(), Phases()
    phase = phases.current()
    before: tuple[MotionConstraint, ...] = (ABOVE,)
    phase.things["pan1"], phase.tools["Cup None"], phase.before = Pose((1.0, 2.0, 0.5)), "cup1", before
    phase.poured["Tilt cup1"] = 41.5
    again.restore(phases.snapshot())
    assert again.current() == phase
