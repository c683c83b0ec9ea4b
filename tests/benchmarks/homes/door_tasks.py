"""Tasks in flats whose doors are closed: hinged ones, and ones that slide."""

from __future__ import annotations

from tests.benchmarks.homes import goals
from tests.benchmarks.homes.flats import Flat, flat
from tests.benchmarks.homes.furnishing import Home
from tests.benchmarks.homes.goals import all_of
from tests.benchmarks.homes.room_doors import RoomDoor, room_door
from tests.benchmarks.homes.tasks import (
    Need,
    Task,
    moves,
    some_table,
    something,
    somewhere,
    step,
    takes_and_puts,
    task_of,
    template,
)
from tests.benchmarks.homes.written import place

TABLES = ("kitchen_table", "sideboard", "desk", "side_table")
SLIDING = 0.3
"""Share of doors that slide."""


def _with_doors(home: Home, rooms: int) -> tuple[Flat, list[RoomDoor]]:
    """Build a flat without a hall, or with one, whose doors are closed on the way to the farthest room."""
    made = flat(home, rooms, hall=rooms > 2 and home.chance(0.5))
    doors = [room_door(made, one, sliding=home.chance(SLIDING)) for one in made.ways(made.farthest)]
    return made, doors


def _opened(doors: list[RoomDoor]) -> list[Need]:
    return [need for one in doors for need in (Need("open", one.name), Need("pass", one.doorway))]


@template
def open_a_door_and_fetch(home: Home) -> Task:
    """Open the door to the next room, bring a thing from there, and close the door."""
    made, (door,) = _with_doors(home, 2)
    table = some_table(home, TABLES)
    home.enter(made.farthest)
    other = some_table(home, TABLES)
    thing = home.thing(something(home), other, where=somewhere(home))
    steps = [
        step("OpeningADoor", what=door.name),
        *moves([thing], place("on-Physical", table)),
        step("ClosingADoor", what=door.name),
    ]
    needs = [*_opened([door]), *takes_and_puts([thing], table), Need("close", door.name)]
    wanted = all_of(goals.on(thing, table), goals.shut(door.name))
    return task_of(home, "open_a_door_and_fetch", steps, wanted, [thing], needs)


@template
def through_closed_doors(home: Home) -> Task:
    """Bring a thing from a room behind closed doors, of which the recipe says nothing; they are closed at the end."""
    made, doors = _with_doors(home, int(home.rng.integers(2, 5)))
    table = some_table(home, TABLES)
    home.enter(made.farthest)
    other = some_table(home, TABLES)
    thing = home.thing(something(home), other, where=somewhere(home))
    steps = moves([thing], place("on-Physical", table))
    needs = [*_opened(doors), *takes_and_puts([thing], table)]
    wanted = all_of(goals.on(thing, table), goals.shut(*(one.name for one in doors)))
    return task_of(home, "through_closed_doors", steps, wanted, [thing], needs)


@template
def to_a_room_behind_doors(home: Home) -> Task:
    """Drive to where a table behind closed doors is in reach, of which the recipe says nothing."""
    made, doors = _with_doors(home, int(home.rng.integers(2, 5)))
    home.enter(made.farthest)
    table = some_table(home, TABLES)
    steps = [step("Translation-LocationChange", to=place("inReachOf", table))]
    return task_of(home, "to_a_room_behind_doors", steps, goals.in_room(made.farthest), [], _opened(doors))
