"""Amigo's two hands take trays; what stops them once they hold one leaves it in their hands."""

from __future__ import annotations

import math

import pytest

from planlang import perform
from planlang.designators import a_location, action, an_object
from planlang.failures import ManipulationGoalInCollision
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import PLACE, MakeStage, Stage

TABLE = Body("table", Pose((1.3, 0.0, 0.37)), (0.6, 1.4, 0.74), type="KitchenTable")
TRAY = Body(
    "tray", Pose((1.2, 0.0, 0.755)), (0.32, 0.45, 0.03), type="Tray", movable=True, wall=0.006, hands=2,
    largest_tilt=math.radians(15), mass=0.8,
)  # fmt: skip
CUP = Body("cup", Pose((1.2, 0.06, 0.791)), (0.07, 0.07, 0.09), "cylinder", type="Cup", movable=True, mass=0.25)
LAMP = Body("lamp", Pose((1.25, 0.0, 0.87)), (0.1, 0.1, 0.02))
THE_TRAY = an_object("Tray", PLACE + "tray")


def taken(stage: Stage) -> None:
    async def take() -> None:
        await perform(action("PickingUpAnObject", object_acted_on=THE_TRAY))

    stage.run(take)


@pytest.mark.long
def test_two_hands_lift_a_tray_with_the_cup_on_it(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, TRAY, CUP)
    taken(stage)
    assert (len(stage.truth.holders("tray")), stage.truth.riders("tray")) == (2, ("cup",))
    assert stage.truth.height_above_support("tray") > 0.05


@pytest.mark.long
def test_a_tray_that_something_stops_when_it_is_lifted_stays_in_the_hands(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, TRAY, CUP, truth=(TABLE, TRAY, CUP, LAMP))
    with pytest.raises(ManipulationGoalInCollision) as caught:
        taken(stage)
    assert str(caught.value.blocked_by).startswith("something unknown at 1.2")
    assert (len(stage.truth.holders("tray")), stage.truth.riders("tray")) == (2, ("cup",))
    assert set(stage.belief.held) == {"tray"}


def test_fewer_places_than_are_asked_for_are_all_found(make_stage: MakeStage) -> None:
    small = Body("small", Pose((1.2, 0.0, 0.37)), (0.36, 0.46, 0.74), type="KitchenTable")
    stage = make_stage(small, CUP)
    there, cup = a_location(on=an_object("KitchenTable", PLACE + "small")), an_object("Cup", PLACE + "cup")
    first = list(stage.resolver.best_things(there, cup, 3))
    assert (len(first), first) == (3, list(stage.resolver.best_things(there, cup, 100_000))[:3])
