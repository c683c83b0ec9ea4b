"""Somebody moves a thing, or takes it away, while the robot drives: it finds out when it looks."""

from __future__ import annotations

from contextlib import ExitStack

import pytest

from planlang import perform
from planlang.designators import action
from planlang.failures import ObjectNotFound
from planlang.geometry import Pose
from tests.support.leaves import Room, room, thing

TABLE = thing("table", "KitchenTable", Pose((0.8, 0.0, 0.37)), (0.6, 1.2, 0.74))
BOTTLE = thing("bottle", "DrinkingBottle", Pose((0.75, 0.0, 0.84)), (0.065, 0.065, 0.2))


def driven(stack: ExitStack, fault: str) -> Room:
    """Drive a little, and let a fault happen meanwhile."""
    stage = room(stack, (TABLE, BOTTLE), faults=(fault,))
    stage.run(lambda: perform(action("Translation-LocationChange", x=-1.1, y=0.1, yaw=0.0)))
    return stage


def look(stage: Room) -> None:
    what = stage.designator("bottle")
    stage.run(lambda: perform(action("LookingForSomething", object_acted_on=what)))


@pytest.mark.parametrize(("fault", "least", "most"), [("thing:moves", 0.1, 0.3), ("thing:moves=0.2", 0.199, 0.201)])
def test_a_thing_that_somebody_moves_stays_on_its_table_and_is_seen_there(
    stack: ExitStack, fault: str, least: float, most: float
) -> None:
    stage = driven(stack, fault)
    there, before = stage.truth.pose("bottle"), BOTTLE.pose
    assert before is not None
    assert least <= there.distance(before) <= most
    assert stage.truth.support("bottle") == "table"
    assert stage.platform.belief.pose("bottle").distance(before) == 0.0, "nobody has told the robot"
    look(stage)
    assert stage.platform.belief.pose("bottle").distance(there) < 1e-6


def test_a_thing_that_somebody_takes_away_is_not_found(stack: ExitStack) -> None:
    stage = driven(stack, "thing.bottle:is_gone")
    assert "bottle" not in stage.truth.names()
    with pytest.raises(ObjectNotFound):
        look(stage)
