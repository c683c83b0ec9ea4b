"""Searches go on behind doors between rooms that are shut, and say of those that do not open."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from pathlib import Path

import pytest

from planlang import SimulationHost, perform, run
from planlang.designators import action, an_object
from planlang.failures import ObjectNowhereToBeFound
from planlang.language.tidying import tidied
from tests.support.instant_doors import Doors
from tests.support.leaves import Room
from tests.support.room_doors import RoomDoor, flat

FLAT = "http://example.org/flat.owl#"
KEYS = an_object("Key", FLAT + "keys")
WIDE = 1.57


OPENS, CLOSES, CLOSES_AGAIN = "OpeningAContainerArtifact", "ClosingAContainerArtifact", "ClosingDoorsAgain"


def table(name: str, x: float, y: float) -> str:
    """A table of a map."""
    size = 'knowrob:boundingBoxSize "0.7 1.2 0.74"'
    return (
        f'Individual: {name}\n    Types: knowrob:KitchenTable\n    Facts: knowrob:translation "{x} {y} 0.37", {size}\n'
    )


def home(stack: ExitStack, folder: Path, keys: str, *, sticks: bool = False) -> tuple[Room, Doors]:
    """Two rooms with a table in each and a shut door between them, and keys of which the robot does not know where."""
    facts = f'Facts: knowrob:translation "{keys} 0.75", knowrob:boundingBoxSize "0.1 0.05 0.02"'
    lying = f"Individual: keys\n    Types: knowrob:Key\n    {facts}\n"
    more = "\n".join((table("near_table", -3.4, 1.0), table("far_table", 3.5, -0.8), lying))
    stage = flat(stack, RoomDoor(more=more), folder)
    stage.platform.belief.not_there("keys")
    stage.platform.observe()
    doors = Doors(stage, "door", WIDE, (OPENS, CLOSES, CLOSES_AGAIN), sticks=sticks)
    stage.executive.modules = (doors, *stage.executive.modules)
    return stage, doors


async def look() -> None:
    await perform(action("LookingForSomething", object_acted_on=KEYS))


def search(stage: Room) -> None:
    host = SimulationHost(stage.truth)
    run(partial(tidied, look), host=host, executive=stage.executive, max_steps=60_000)


def test_a_search_goes_on_behind_a_shut_door_between_rooms_which_is_closed_at_the_end(
    stack: ExitStack, tmp_path: Path
) -> None:
    stage, doors = home(stack, tmp_path, "3.4 -0.8")
    search(stage)
    assert doors.asked == [OPENS, CLOSES_AGAIN]
    assert stage.platform.belief.seen("keys")
    assert stage.truth.configuration().base[0] > 0.0


def test_what_is_found_in_this_room_opens_no_door(stack: ExitStack, tmp_path: Path) -> None:
    stage, doors = home(stack, tmp_path, "-3.3 1.0")
    search(stage)
    assert doors.asked == []


def test_a_search_tells_which_place_is_behind_a_door_that_does_not_open(stack: ExitStack, tmp_path: Path) -> None:
    stage, doors = home(stack, tmp_path, "3.4 -0.8", sticks=True)
    with pytest.raises(ObjectNowhereToBeFound, match=r"looked at: near_table; not far_table \(.*handle.*\)$"):
        search(stage)
    assert set(doors.asked) == {OPENS}
