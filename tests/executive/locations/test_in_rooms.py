"""A base that is sent to a room stands wholly inside it, behind the door that is opened on the way."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from executive.locations.demands import LocationMeaningless
from planlang import SimulationHost, perform, run
from planlang.designators import a_location, action
from planlang.failures import BehindClosedDoor
from tests.support.leaves import Room
from tests.support.room_doors import RoomDoor, flat

HALF, HAIR = 2.0, 2e-3
"""Half of the extent of the room at x = 2.1, and what poses are rounded to [m]."""
TABLE = """
Individual: table
    Types: knowrob:KitchenTable
    Facts: knowrob:translation "-3.4 1 0.37", knowrob:boundingBoxSize "0.7 1.2 0.74"
"""


def home(stack: ExitStack, folder: Path, *, wide: bool = True) -> Room:
    """A kitchen with a table, in which the robot is, and a bedroom behind a door."""
    facts = ("knowrob:jointPosition 1.57",) if wide else ()
    return flat(stack, RoomDoor(facts=facts, more=TABLE), folder)


def is_inside(stage: Room, base: tuple[float, ...]) -> bool:
    """Check whether all of a base is in the bedroom."""
    least = HALF - stage.platform.robot.base.radius + HAIR
    return abs(base[0] - 2.1) <= least and abs(base[1]) <= least


def test_a_base_in_a_room_is_wholly_inside_it(stack: ExitStack, tmp_path: Path) -> None:
    stage = home(stack, tmp_path)
    inside = a_location(in_=stage.designator("there"))
    found = next(stage.platform.resolver.bases(inside))
    assert is_inside(stage, found.base)
    outside = a_location(not_=inside, near=stage.designator("table"))
    assert next(stage.platform.resolver.bases(outside)).base[0] < 0.0


def test_a_robot_that_is_sent_to_a_room_drives_into_it(stack: ExitStack, tmp_path: Path) -> None:
    stage = home(stack, tmp_path)

    async def go() -> None:
        await perform(action("Translation-LocationChange", to_location=stage.designator("there")))

    run(go, host=SimulationHost(stage.truth), executive=stage.executive, max_steps=30_000)
    assert is_inside(stage, stage.truth.configuration().base)


def test_a_room_behind_a_shut_door_is_behind_it_and_a_table_is_no_room(stack: ExitStack, tmp_path: Path) -> None:
    stage = home(stack, tmp_path, wide=False)
    with pytest.raises(BehindClosedDoor, match="there is behind door, which is closed"):
        next(stage.platform.resolver.bases(a_location(in_=stage.designator("there"))))
    with pytest.raises(LocationMeaningless, match="it takes a room, and table is not a room"):
        next(stage.platform.resolver.bases(a_location(in_=stage.designator("table"))))
