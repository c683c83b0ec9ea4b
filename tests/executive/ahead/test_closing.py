"""Whether later steps need the base on the side of a door between rooms from which it has come."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from executive.ahead.closing import leads_back
from planlang.designators import Action, Object, a_location, action
from tests.support.room_doors import RoomDoor, flat

BEYOND = (0.8, 0.0, 0.0)
"""A base pose behind the door that faces away from it."""
CUPS = """
Individual: cup_here
    Types: knowrob:Cup
    Facts: knowrob:translation "-3 0 0.8", knowrob:boundingBoxSize "0.07 0.07 0.1"

Individual: cup_there
    Types: knowrob:Cup
    Facts: knowrob:translation "3 0 0.8", knowrob:boundingBoxSize "0.07 0.07 0.1"
"""


def test_later_steps_lead_back_to_what_is_before_the_door_to_its_room_and_to_what_is_not_known(
    stack: ExitStack, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = flat(stack, RoomDoor(more=CUPS), tmp_path)
    scene, door = stage.platform.scene, stage.designator("door")
    cup_here, cup_there, here, there = map(stage.designator, ("cup_here", "cup_there", "here", "there"))

    def back(*steps: Action) -> bool:
        monkeypatch.setattr("executive.ahead.closing.remaining_actions", lambda: iter(steps))
        return leads_back(scene, door, BEYOND)

    def drive(**where: object) -> Action:
        return action("Translation-LocationChange", **where)

    assert not back()
    assert not back(action("Lifting", object_acted_on=cup_there), drive(x=2.0, y=1.0, yaw=0.0))
    assert back(action("Lifting", object_acted_on=cup_here))
    assert back(drive(x=-2.0, y=1.0, yaw=0.0))
    assert back(action("Lifting", object_acted_on=Object("Spoon")))
    assert not back(drive(to_location=a_location(in_=there)))
    assert back(drive(to_location=a_location(in_=here)))
    monkeypatch.setattr("executive.ahead.closing.actions_around", lambda: iter([drive(to_location=cup_here)]))
    assert back(), "the step in progress goes on there"
