"""What hands carry: a thing with its contents, and with all that stands on it, in one hand and in two."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest

from planlang import perform
from planlang.changes import Poured
from planlang.designators import Object, a_location, action, an_object
from planlang.failures import TooHeavy
from planlang.geometry import Pose
from planlang.state.matter import Portion
from sim import Body
from tests.executive.conftest import BOTTLE, CABINET, PLACE, MakeStage, Stage, hold_bottle

WATER = Portion("Water", 1200.0, ("water",))
JUG = replace(BOTTLE, name="jug", content=(WATER,), capacity=2000.0, mass=0.5)
THE_JUG = an_object("DrinkingBottle", PLACE + "jug")
POT = Body(
    "pot", Pose((1.5, 0.0, 0.88)), (0.3, 0.3, 0.15), type="StoveTopCookingPot", movable=True, hands=2, wall=0.006,
    mass=2.4, capacity=6000.0,
)  # fmt: skip
THE_POT = an_object("StoveTopCookingPot", PLACE + "pot")


def refused(stage: Stage, what: Object) -> TooHeavy:
    """The refusal to search for a base pose, or to take a thing with two hands."""
    grasp = action("PickingUpAnObject", object_acted_on=what)
    search = partial(next, stage.resolver.bases(a_location(in_reach_of=what))) if what is not THE_POT else None
    with pytest.raises(TooHeavy) as caught:
        search() if search is not None else stage.run(lambda: perform(grasp))
    return caught.value


def test_the_water_in_a_jug_counts_for_one_hand(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, JUG)
    assert refused(stage, THE_JUG).mass == pytest.approx(1.7)
    state = stage.belief.state
    poured = Poured("jug", "the floor", 1000.0)
    stage.belief.happened(replace(state, matter=state.matter.take("jug", 1000.0)[0]), poured)
    next(stage.resolver.bases(a_location(in_reach_of=THE_JUG)))


def test_what_stands_on_a_thing_counts_for_one_hand(make_stage: MakeStage) -> None:
    box = Body("box", Pose((1.5, 0.0, 0.85)), (0.1, 0.1, 0.1), type="Box-Container", movable=True, mass=0.8)
    brick = Body("brick", Pose((1.5, 0.0, 0.925)), (0.08, 0.08, 0.05), type="Brick", movable=True, mass=0.9)
    stage = make_stage(CABINET, box, brick)
    assert refused(stage, an_object("Box-Container", PLACE + "box")).mass == pytest.approx(1.7)


@pytest.mark.parametrize(("amount", "mass"), [(4000.0, 6.4), (1500.0, 3.9)])
def test_the_water_in_a_pot_counts_for_two_hands(make_stage: MakeStage, amount: float, mass: float) -> None:
    stage = make_stage(CABINET, replace(POT, content=(Portion("Water", amount, ("water",)),)))
    failure = refused(stage, THE_POT)
    assert (failure.mass, failure.hands) == (pytest.approx(mass), 2)
    assert f"pot weighs {mass:g} kg with the {amount / 1000:g} kg in it or on it, both hands carry" in failure.because()


def test_the_water_in_what_stands_on_a_tray_counts_for_two_hands(make_stage: MakeStage) -> None:
    tray = replace(POT, name="tray", pose=Pose((1.5, 0.0, 0.815)), size=(0.4, 0.5, 0.03), wall=0.0, content=())
    on_it = replace(JUG, pose=Pose((1.5, 0.0, 0.93)), size=(0.07, 0.07, 0.2))
    stage = make_stage(CABINET, tray, on_it)
    assert stage.platform.scene.bodies.mass("tray") == pytest.approx(2.4 + 1.7)


def test_a_hand_holds_no_more_than_its_payload_when_something_is_poured_in(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, replace(JUG, content=(), capacity=5000.0))
    hold_bottle(stage, "left", name="jug")
    assert stage.platform.scene.spare_payload("jug") == pytest.approx(1.0)
    assert stage.platform.scene.spare_payload("cabinet") == float("inf")
