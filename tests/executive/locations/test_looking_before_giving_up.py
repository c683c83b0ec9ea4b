"""A thing that is out of reach where the map alone has it is looked at before a plan gives up."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planlang import at_location
from planlang.designators import a_location
from planlang.failures import LocationUnresolvable, ObjectNotFound, ObjectUnreachable
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import BOTTLE, THE_BOTTLE, MakeStage

TABLE = Body("table", Pose((2.0, 0.0, 0.4)), (2.4, 2.4, 0.8), type="KitchenTable")
FAR_BACK = replace(BOTTLE, pose=Pose((2.1, 0.1, 0.9)))
NEAR = replace(BOTTLE, pose=Pose((1.0, 0.1, 0.9)))
TO_GRASP = a_location(in_reach_of=THE_BOTTLE)


async def reach() -> str:
    """Go where the bottle is in reach."""

    async def there() -> str:
        return "there"

    return await at_location(TO_GRASP, there)


def test_a_thing_that_stands_nearer_than_in_the_map_is_reached_after_a_look(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, FAR_BACK, truth=[TABLE, NEAR])
    assert stage.run(reach) == "there"
    assert stage.belief.pose("bottle").position[0] == pytest.approx(1.0, abs=0.02)


def test_a_thing_that_is_where_the_map_has_it_is_out_of_reach_after_a_look(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, FAR_BACK)
    with pytest.raises(ObjectUnreachable) as caught:
        stage.run(reach)
    assert isinstance(caught.value.__cause__, LocationUnresolvable)
    assert stage.belief.remembers("bottle")


def test_a_thing_that_the_look_does_not_show_is_not_found(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, FAR_BACK, truth=[TABLE, replace(BOTTLE, pose=Pose((-3.0, 3.0, 0.1)))])
    with pytest.raises(ObjectNotFound):
        stage.run(reach)
