"""Tasks in flats: things, people and tables in other rooms than that in which the robot begins."""

from __future__ import annotations

import contextlib

from tests.benchmarks.homes import goals
from tests.benchmarks.homes.flats import Flat, flat, person_in_hall
from tests.benchmarks.homes.furnishing import Home, NoRoom
from tests.benchmarks.homes.goals import all_of
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

SMALL = ("kitchen_table", "sideboard", "desk", "side_table")
"""Tables that most rooms have room for."""


def _flat(home: Home, *, hall: bool | None = None) -> Flat:
    """Build a flat of two to five rooms, with or without a hall."""
    rooms = int(home.rng.integers(2, 6))
    with_hall = home.chance(0.6) if hall is None else hall
    return flat(home, max(rooms, 3) if with_hall else rooms, hall=with_hall)


def _ways(made: Flat, room: str) -> list[Need]:
    """Return that the robot gets to a room."""
    return [Need("pass", doorway) for doorway in made.ways(room)]


@template
def fetch_from_another_room(home: Home) -> Task:
    """Bring a thing from a table in the farthest room to one in the room where the robot begins."""
    made = _flat(home)
    table = some_table(home, SMALL)
    home.enter(made.farthest)
    other = some_table(home, SMALL)
    thing = home.thing(something(home), other, where=somewhere(home))
    home.clutter(other, 3)
    needs = [*_ways(made, made.farthest), *takes_and_puts([thing], table)]
    steps = moves([thing], place("on-Physical", table))
    return task_of(home, "fetch_from_another_room", steps, goals.on(thing, table), [thing], needs)


@template
def bring_to_another_room(home: Home) -> Task:
    """Bring a thing to a person, who stands or sits, in the farthest room."""
    made = _flat(home)
    table = some_table(home)
    thing = home.thing(home.one_of(("cup", "glass", "bottle", "can", "phone", "book")), table, where=somewhere(home))
    home.clutter(table, 3)
    home.enter(made.farthest)
    person = home.person_standing() if home.chance(0.5) else home.person_seated()
    needs = [Need("grasp", thing), *_ways(made, made.farthest), Need("hand over", thing, person)]
    steps = [step("TransportingAnObject", what=thing, who=person)]
    return task_of(home, "bring_to_another_room", steps, goals.held(thing, person), [thing], needs)


@template
def past_a_person(home: Home) -> Task:
    """Fetch a thing from another room past a person who stands in the hall."""
    made = _flat(home, hall=True)
    table = some_table(home, SMALL)
    room = made.beyond(made.halls[0])
    person_in_hall(home, made.halls[0])
    home.enter(room)
    other = some_table(home, SMALL)
    thing = home.thing(something(home), other, where=somewhere(home))
    needs = [*_ways(made, room), *takes_and_puts([thing], table)]
    steps = moves([thing], place("on-Physical", table))
    return task_of(home, "past_a_person", steps, goals.on(thing, table), [thing], needs)


@template
def look_in_all_rooms(home: Home) -> Task:
    """Look for keys that lie in some room, and take them."""
    made = _flat(home)
    tables = {}
    for room in made.rooms:
        if room in made.halls:
            continue
        home.enter(room)
        tables[some_table(home, SMALL)] = room
        with contextlib.suppress(NoRoom):
            tables[home.furniture(home.one_of(("bedside_table", "coffee_table")))] = room
    for table in tables:
        home.clutter(table, 2)
    at = home.one_of(tuple(tables))
    keys = home.thing("keys", at, where=somewhere(home))
    needs = [*_ways(made, tables[at]), Need("see", keys), Need("grasp", keys)]
    steps = [step("FetchingAnObject", what=keys)]
    return task_of(home, "look_in_all_rooms", steps, goals.held(keys), [keys], needs, unknown=[keys])


@template
def lay_a_table_elsewhere(home: Home) -> Task:
    """Bring a cup and a can from the kitchen to the table of another room, one after the other."""
    made = _flat(home)
    counter = home.furniture("counter", wall=True)
    things = [home.thing(kind, counter, where=somewhere(home)) for kind in ("cup", "can")]
    home.clutter(counter, 2)
    home.enter(made.farthest)
    table = some_table(home, SMALL)
    wanted = all_of(*(goals.on(one, table) for one in things))
    needs = [Need("pass", door) for door in made.ways(made.farthest)] + takes_and_puts(things, table)
    return task_of(home, "lay_a_table_elsewhere", moves(things, place("on-Physical", table)), wanted, things, needs)
