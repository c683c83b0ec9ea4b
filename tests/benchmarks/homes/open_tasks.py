"""Tasks with things that stand in the open: fetching, bringing, setting and clearing, pouring, devices, wiping."""

from __future__ import annotations

import math
from dataclasses import replace

from tests.benchmarks.homes import goals
from tests.benchmarks.homes.closed import open_shelf
from tests.benchmarks.homes.furnishing import Home
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
from tests.support.scenarios.wiping import wiped, wiping

# Fetching and bringing


@template
def fetch(home: Home) -> Task:
    """Take a thing from a table."""
    home.room("LivingRoom")
    table = some_table(home)
    thing = home.thing(something(home), table, where=somewhere(home))
    home.clutter(table, 4)
    return task_of(
        home, "fetch", [step("FetchingAnObject", what=thing)], goals.held(thing), [thing], [Need("grasp", thing)]
    )


def _bring(home: Home, name: str, person: str) -> Task:
    table = some_table(home)
    thing = home.thing(home.one_of(("cup", "glass", "bottle", "can", "phone", "book")), table, where=somewhere(home))
    home.clutter(table, 3)
    return task_of(
        home,
        name,
        [step("TransportingAnObject", what=thing, who=person)],
        goals.held(thing, person),
        [thing],
        [Need("grasp", thing), Need("hand over", thing, person)],
    )


@template
def bring_to_standing(home: Home) -> Task:
    """Bring a thing to a person who stands."""
    home.room("LivingRoom")
    return _bring(home, "bring_to_standing", home.person_standing())


@template
def bring_to_seated(home: Home) -> Task:
    """Bring a thing to a person who sits."""
    home.room("LivingRoom")
    return _bring(home, "bring_to_seated", home.person_seated())


@template
def bring_to_lying(home: Home) -> Task:
    """Bring a thing to a person in bed."""
    home.room("BedRoom")
    return _bring(home, "bring_to_lying", home.person_lying())


# Putting down


@template
def onto_open_shelf(home: Home) -> Task:
    """Put a thing from a table onto a compartment of an open bookcase."""
    home.room("LivingRoom")
    shelves = open_shelf(home, corner=home.chance(0.3))
    shelf = shelves[int(home.rng.integers(len(shelves)))]
    table = some_table(home)
    thing = home.thing(home.one_of(("cup", "can", "book", "box", "glass")), table, where=somewhere(home))
    for one in shelves:
        home.clutter(one, 1)
    to = place("in-ContGeneric", shelf)
    return task_of(
        home, "onto_open_shelf", moves([thing], to), goals.inside(thing, shelf), [thing], takes_and_puts([thing], shelf)
    )


@template
def beside(home: Home) -> Task:
    """Put one thing beside another."""
    home.room("Kitchen")
    table, other = some_table(home), some_table(home)
    one = home.thing(something(home), table, where=somewhere(home))
    two = home.thing(something(home), other)
    home.clutter(other, 2)
    return task_of(
        home,
        "beside",
        moves([one], place("toTheSideOf", two)),
        goals.beside(one, two),
        [one],
        [Need("grasp", one), Need("place", one, other)],
    )


@template
def three_to_tray(home: Home) -> Task:
    """Put three things onto a tray."""
    home.room("Kitchen")
    table, other = some_table(home), some_table(home, ("kitchen_table", "dining_table", "counter"))
    size = (home.between((0.28, 0.36)), home.between((0.4, 0.5)), home.between((0.02, 0.05)))
    home.put("tray1", "Tray", size, other, "front", None, faces_front=True)
    things = [home.thing(home.one_of(("cup", "glass", "can", "mug")), table, where=somewhere(home)) for _ in range(3)]
    to = place("on-Physical", "tray1")
    wanted = all_of(*(goals.on(one, "tray1") for one in things))
    return task_of(home, "three_to_tray", moves(things, to), wanted, things, takes_and_puts(things, "tray1"))


@template
def clear_table(home: Home) -> Task:
    """Bring what stands on a table to the worktop."""
    home.room("Kitchen")
    table, counter = home.furniture("dining_table"), home.furniture("counter", wall=True)
    things = [home.thing(home.one_of(("cup", "glass", "bowl", "mug", "bottle")), table) for _ in range(3)]
    to = place("on-Physical", counter)
    wanted = all_of(*(goals.on(one, counter) for one in things))
    return task_of(home, "clear_table", moves(things, to), wanted, things, takes_and_puts(things, counter))


@template
def set_table(home: Home) -> Task:
    """Bring a plate, a cup and cutlery from the worktop to the table."""
    home.room("Kitchen")
    counter, table = (
        home.furniture("counter", wall=True),
        home.furniture(home.one_of(("kitchen_table", "dining_table"))),
    )
    things = [home.thing(kind, counter) for kind in ("plate", "cup", "spoon")]
    to = place("on-Physical", table)
    wanted = all_of(*(goals.on(one, table) for one in things))
    return task_of(home, "set_table", moves(things, to), wanted, things, takes_and_puts(things, table))


@template
def sort_by_class(home: Home) -> Task:
    """Bring cups to one table and bottles to another."""
    home.room("Kitchen")
    table, left, right = some_table(home), home.furniture("side_table"), home.furniture("counter", wall=True)
    cups = [home.thing("cup", table) for _ in range(2)]
    bottles = [home.thing("bottle", table) for _ in range(2)]
    steps = (*moves(cups, place("on-Physical", left)), *moves(bottles, place("on-Physical", right)))
    wanted = all_of(*(goals.on(one, left) for one in cups), *(goals.on(one, right) for one in bottles))
    needs = [*takes_and_puts(cups, left), *takes_and_puts(bottles, right)]
    return task_of(home, "sort_by_class", steps, wanted, [*cups, *bottles], needs)


# Liquids

FULL = 0.7
"""Share of a vessel's outline that may be full: walls, neck and rim take the rest."""
LEFT = (10.0, 40.0)
"""Amount that is left in a glass that is filled up [ml]."""


def _poured(home: Home) -> tuple[str, str, float]:
    """Put a bottle with something in it and a glass on one or two tables."""
    table = some_table(home)
    bottle = home.thing("bottle", table, where=somewhere(home))
    other = table if home.chance(0.6) else some_table(home)
    glass = home.thing(home.one_of(("glass", "cup", "mug")), other, where=somewhere(home))
    amount = float(int(home.rng.integers(5, 16)) * 10)
    home.filled(bottle, "Water", round(min(home.between((300.0, 500.0)), FULL * volume(home, bottle)), 1))
    return bottle, glass, min(amount, 10.0 * int(FULL * volume(home, glass) / 10) - LEFT[1])


def volume(home: Home, vessel: str) -> float:
    """Return what is inside the outline of something round [ml]."""
    size = home.things[vessel].size
    assert size is not None
    return math.pi / 4 * size[0] ** 2 * size[2] * 1e6


@template
def pour_and_bring(home: Home) -> Task:
    """Pour a drink and bring the glass to somebody."""
    home.room("Kitchen")
    person = home.one_of(("standing", "seated"))
    who = home.person_standing() if person == "standing" else home.person_seated()
    bottle, glass, amount = _poured(home)
    steps = (
        step("FluidFlow-Translation", what=bottle, to=glass, amount=repr(amount)),
        step("TransportingAnObject", what=glass, who=who),
    )
    wanted = all_of(goals.held(glass, who), goals.contains(glass, amount))
    needs = [Need("grasp", bottle), Need("pour", bottle, glass), Need("grasp", glass), Need("hand over", glass, who)]
    return task_of(home, "pour_and_bring", steps, wanted, [bottle, glass], needs, poured=[bottle])


@template
def refill_glass(home: Home) -> Task:
    """Fill a glass up in which something is left."""
    home.room("Kitchen")
    bottle, glass, amount = _poured(home)
    left = 10.0 * int(home.rng.integers(LEFT[0] / 10, LEFT[1] / 10 + 1))
    home.filled(glass, "Water", left)
    steps = (step("FluidFlow-Translation", what=bottle, to=glass, amount=repr(amount)),)
    wanted = goals.contains(glass, left + amount)
    return task_of(
        home,
        "refill_glass",
        steps,
        wanted,
        [bottle],
        [Need("grasp", bottle), Need("pour", bottle, glass)],
        poured=[bottle],
    )


# Devices and surfaces


@template
def press_button(home: Home) -> Task:
    """Turn the coffee machine on."""
    home.room("Kitchen")
    counter = home.furniture("counter", wall=True, corner=home.chance(0.3))
    device, button = home.device("coffee_machine", counter)
    home.clutter(counter, 3)
    steps = (step("TurningOnPoweredDevice", what=device),)
    return task_of(home, "press_button", steps, goals.switched(device, on=True), [], [Need("press", button)])


def is_on(home: Home, device: str) -> None:
    """Let a device be on at the beginning."""
    one = home.things[device]
    home.things[device] = replace(one, facts=(*one.facts, "knowrob:stateOfObject knowrob:DeviceStateOn"))


@template
def devices_off(home: Home) -> Task:
    """Turn two devices off that are on."""
    home.room("Kitchen")
    counter = home.furniture("counter", wall=True)
    table = some_table(home)
    devices = [home.device("toaster", counter), home.device(home.one_of(("lamp", "microwave")), table)]
    for device, _ in devices:
        is_on(home, device)
    steps = tuple(step("TurningOffPoweredDevice", what=device) for device, _ in devices)
    wanted = all_of(*(goals.switched(device, on=False) for device, _ in devices))
    return task_of(home, "devices_off", steps, wanted, [], [Need("press", button) for _, button in devices])


@template
def wipe_table(home: Home) -> Task:
    """Wipe a table, at a wall or not, around what stands on it, with a sponge that lies elsewhere."""
    home.room("Kitchen")
    table = home.furniture(home.one_of(("kitchen_table", "side_table", "coffee_table", "dining_table")))
    home.clutter(table, 3)
    sponge = home.thing("sponge", home.furniture("counter", wall=True), where="front")
    steps = (step("WipingASurface", what=table, device=sponge),)
    needs = [Need("grasp", sponge), Need("wipe", sponge, table)]
    return task_of(home, "wipe_table", steps, wiped(table, sponge), [sponge], needs, watchers=[wiping(table, sponge)])


@template
def several_in_a_row(home: Home) -> Task:
    """Put a box onto a shelf, bring a drink, and turn a lamp off."""
    home.room("LivingRoom")
    shelves = open_shelf(home)
    who = home.person_seated()
    table = some_table(home)
    cup, box = home.thing("cup", table), home.thing("box", table)
    lamp, button = home.device("lamp", some_table(home, ("sideboard", "desk", "counter")))
    is_on(home, lamp)
    shelf = home.one_of(shelves)
    steps = (
        *moves([box], place("in-ContGeneric", shelf)),
        step("TransportingAnObject", what=cup, who=who),
        step("TurningOffPoweredDevice", what=lamp),
    )
    wanted = all_of(goals.inside(box, shelf), goals.held(cup, who), goals.switched(lamp, on=False))
    needs = [*takes_and_puts([box], shelf), Need("grasp", cup), Need("hand over", cup, who), Need("press", button)]
    return task_of(home, "several_in_a_row", steps, wanted, [cup, box], needs)
