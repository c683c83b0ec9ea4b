"""Tasks of everyday, each with the home that it needs, drawn by a seed: what a user would write, and when it is done.

A template draws a home and says the steps, the goal in the simulator's truth, and what has to be possible for it (for
the witness). Homes hold more than a task needs: other furniture, other things on it, other doors beside the one meant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from tests.benchmarks.homes import goals
from tests.benchmarks.homes.closed import Closed, chest, cupboard, open_shelf, refrigerator
from tests.benchmarks.homes.furnishing import Home, NoRoom
from tests.benchmarks.homes.goals import Goal, all_of
from tests.benchmarks.homes.written import Step, place
from tests.support.scenarios import Watched
from tests.support.scenarios.wiping import wiped, wiping

REDRAWN = 40
"""Homes that are drawn for one task before its seed is given up."""


@dataclass(frozen=True)
class Need:
    """Something that has to be possible: "grasp", "place", "open", "hand over", "press", "wipe", "see", "pour"."""

    kind: str
    thing: str
    at: str = ""


@dataclass(frozen=True)
class Task:
    """A task in a home."""

    template: str
    home: Home
    steps: tuple[Step, ...]
    goal: Goal
    needs: tuple[Need, ...]
    unknown: tuple[str, ...] = ()
    """Things of which the robot does not know where they are."""
    watchers: tuple[Callable[[Watched], None], ...] = field(default=())


Template = Callable[[Home], Task]
TEMPLATES: dict[str, Template] = {}


def template(draw: Template) -> Template:
    """Register a template by the name of its function."""
    TEMPLATES[draw.__name__] = draw
    return draw


def drawn(name: str, seed: int) -> Task:
    """Return the task of a template and a seed; homes that are too full are drawn anew."""
    number = sorted(TEMPLATES).index(name)
    for again in range(REDRAWN):
        home = Home(np.random.default_rng([seed, number, again]))
        try:
            task = TEMPLATES[name](home)
            _others(home)
        except NoRoom:
            continue
        return task
    raise NoRoom(f"{name} {seed}: {REDRAWN} homes are too full")


def _others(home: Home) -> None:
    """Add furniture and things that the task does not need, as far as there is room."""
    for _ in range(int(home.rng.integers(0, 3))):
        kind = home.one_of(("side_table", "sideboard", "sofa", "bedside_table", "desk"))
        try:
            home.clutter(home.furniture(kind, corner=home.chance(0.5)), 3)
        except NoRoom:
            continue


def _task(
    home: Home,
    name: str,
    steps: Sequence[Step],
    wanted: Goal,
    moved: Sequence[str],
    needs: Sequence[Need],
    *,
    poured: Sequence[str] = (),
    unknown: Sequence[str] = (),
    watchers: Sequence[Callable[[Watched], None]] = (),
) -> Task:
    """Return a task; beside its goal, nothing else may have been moved, dropped or spilled."""
    whole = all_of(wanted, goals.undisturbed(*moved), goals.level(*poured))
    return Task(name, home, tuple(steps), whole, tuple(needs), tuple(unknown), tuple(watchers))


def _step(cls: str, **facts: str) -> Step:
    names = {"what": "objectActedOn", "to": "toLocation", "who": "recipient", "device": "deviceUsed", "amount": "amount"}
    return Step(cls, tuple((names[key], value) for key, value in facts.items()))


def _table(home: Home, kinds: Sequence[str] = ("kitchen_table", "dining_table", "counter", "sideboard")) -> str:
    """Put a table or worktop somewhere, cluttered or not."""
    kind = home.one_of(kinds)
    wall = True if kind in ("counter", "sideboard") else None
    return home.furniture(kind, wall=wall, corner=home.chance(0.3))


def _where(home: Home) -> str:
    return home.one_of(("front", "anywhere", "anywhere", "back"))


def _carried(home: Home) -> str:
    return home.one_of(("cup", "mug", "glass", "bottle", "can", "box", "book"))


def _moved(things: Sequence[str], to: str) -> tuple[Step, ...]:
    return tuple(_step("TransportingAnObject", what=one, to=to) for one in things)


def _needs(things: Sequence[str], at: str) -> list[Need]:
    return [need for one in things for need in (Need("grasp", one), Need("place", one, at))]


# Fetching and bringing


@template
def fetch(home: Home) -> Task:
    """Take a thing from a table."""
    home.room("LivingRoom")
    table = _table(home)
    thing = home.thing(_carried(home), table, where=_where(home))
    home.clutter(table, 4)
    return _task(
        home, "fetch", [_step("FetchingAnObject", what=thing)], goals.held(thing), [thing], [Need("grasp", thing)]
    )


def _bring(home: Home, name: str, person: str) -> Task:
    table = _table(home)
    thing = home.thing(home.one_of(("cup", "glass", "bottle", "can", "phone", "book")), table, where=_where(home))
    home.clutter(table, 3)
    return _task(
        home,
        name,
        [_step("TransportingAnObject", what=thing, who=person)],
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
    table = _table(home)
    thing = home.thing(home.one_of(("cup", "can", "book", "box", "glass")), table, where=_where(home))
    for one in shelves:
        home.clutter(one, 1)
    to = place("in-ContGeneric", shelf)
    return _task(
        home, "onto_open_shelf", _moved([thing], to), goals.inside(thing, shelf), [thing], _needs([thing], shelf)
    )


@template
def beside(home: Home) -> Task:
    """Put one thing beside another."""
    home.room("Kitchen")
    table, other = _table(home), _table(home)
    one = home.thing(_carried(home), table, where=_where(home))
    two = home.thing(_carried(home), other)
    home.clutter(other, 2)
    return _task(
        home,
        "beside",
        _moved([one], place("toTheSideOf", two)),
        goals.beside(one, two),
        [one],
        [Need("grasp", one), Need("place", one, other)],
    )


@template
def three_to_tray(home: Home) -> Task:
    """Put three things onto a tray."""
    home.room("Kitchen")
    table, other = _table(home), _table(home, ("kitchen_table", "dining_table", "counter"))
    size = (home.between((0.28, 0.36)), home.between((0.4, 0.5)), home.between((0.02, 0.05)))
    home.put("tray1", "Tray", size, other, "front", None, faces_front=True)
    things = [home.thing(home.one_of(("cup", "glass", "can", "mug")), table, where=_where(home)) for _ in range(3)]
    to = place("on-Physical", "tray1")
    wanted = all_of(*(goals.on(one, "tray1") for one in things))
    return _task(home, "three_to_tray", _moved(things, to), wanted, things, _needs(things, "tray1"))


@template
def clear_table(home: Home) -> Task:
    """Bring what stands on a table to the worktop."""
    home.room("Kitchen")
    table, counter = home.furniture("dining_table"), home.furniture("counter", wall=True)
    things = [home.thing(home.one_of(("cup", "glass", "bowl", "mug", "bottle")), table) for _ in range(3)]
    to = place("on-Physical", counter)
    wanted = all_of(*(goals.on(one, counter) for one in things))
    return _task(home, "clear_table", _moved(things, to), wanted, things, _needs(things, counter))


@template
def set_table(home: Home) -> Task:
    """Bring a plate, a cup and cutlery from the worktop to the table."""
    home.room("Kitchen")
    counter, table = home.furniture("counter", wall=True), home.furniture(home.one_of(("kitchen_table", "dining_table")))
    things = [home.thing(kind, counter) for kind in ("plate", "cup", "spoon")]
    to = place("on-Physical", table)
    wanted = all_of(*(goals.on(one, table) for one in things))
    return _task(home, "set_table", _moved(things, to), wanted, things, _needs(things, table))


@template
def sort_by_class(home: Home) -> Task:
    """Bring cups to one table and bottles to another."""
    home.room("Kitchen")
    table, left, right = _table(home), home.furniture("side_table"), home.furniture("counter", wall=True)
    cups = [home.thing("cup", table) for _ in range(2)]
    bottles = [home.thing("bottle", table) for _ in range(2)]
    steps = (*_moved(cups, place("on-Physical", left)), *_moved(bottles, place("on-Physical", right)))
    wanted = all_of(*(goals.on(one, left) for one in cups), *(goals.on(one, right) for one in bottles))
    needs = [*_needs(cups, left), *_needs(bottles, right)]
    return _task(home, "sort_by_class", steps, wanted, [*cups, *bottles], needs)


# Behind doors and in drawers


def _cupboard(home: Home, *, filled: bool) -> tuple[Closed, str]:
    """Put a cupboard, alone or with two doors, somewhere; return it and the door that is meant."""
    kind = home.one_of(("base", "base", "tall", "wall"))
    closed = cupboard(home, kind, doors=1 + int(home.chance(0.4)), corner=home.chance(0.3))
    leaf = home.one_of(closed.leaves)
    if filled:
        for one in closed.leaves:
            home.clutter(one, 2)
    return closed, leaf


@template
def tidy_cups(home: Home) -> Task:
    """Put two cups into a cupboard."""
    home.room("Kitchen")
    closed, _ = _cupboard(home, filled=home.chance(0.5))
    table = _table(home)
    cups = [home.thing("cup", table, where=_where(home)) for _ in range(2)]
    wanted = all_of(*(goals.inside(one, closed.name) for one in cups))
    needs = [Need("open", closed.leaves[0], closed.name), *_needs(cups, closed.leaves[0])]
    return _task(home, "tidy_cups", _moved(cups, place("in-ContGeneric", closed.name)), wanted, cups, needs)


@template
def put_away_behind_door(home: Home) -> Task:
    """Put a thing behind a door and close the door."""
    home.room("Kitchen")
    closed, _ = _cupboard(home, filled=home.chance(0.5))
    table = _table(home)
    thing = home.thing(home.one_of(("cup", "glass", "can", "mug", "box")), table, where=_where(home))
    steps = (
        *_moved([thing], place("in-ContGeneric", closed.name)),
        _step("ClosingAContainerArtifact", what=closed.name),
    )
    wanted = all_of(goals.inside(thing, closed.name), goals.shut(*closed.leaves))
    needs = [Need("open", closed.leaves[0], closed.name), *_needs([thing], closed.leaves[0])]
    return _task(home, "put_away_behind_door", steps, wanted, [thing], needs)


@template
def out_of_drawer(home: Home) -> Task:
    """Take a thing out of a drawer and put it on a table."""
    home.room("Kitchen")
    closed = chest(home, corner=home.chance(0.3))
    leaf = home.one_of(closed.leaves)
    thing = home.thing(home.one_of(("bowl", "spoon", "keys", "phone", "can", "sponge")), leaf)
    table = _table(home)
    home.clutter(table, 2)
    wanted = goals.on(thing, table)
    needs = [Need("open", leaf, closed.name), *_needs([thing], table)]
    return _task(home, "out_of_drawer", _moved([thing], place("on-Physical", table)), wanted, [thing], needs)


@template
def bowl_from_drawer(home: Home) -> Task:
    """Take a bowl out of a drawer, bring it to the table, and close the drawer."""
    home.room("Kitchen")
    closed = chest(home, corner=home.chance(0.3))
    leaf = home.one_of(closed.leaves)
    bowl = home.thing("bowl", leaf)
    table = _table(home)
    steps = (*_moved([bowl], place("on-Physical", table)), _step("ClosingAContainerArtifact", what=leaf))
    wanted = all_of(goals.on(bowl, table), goals.shut(leaf))
    needs = [Need("open", leaf, closed.name), *_needs([bowl], table)]
    return _task(home, "bowl_from_drawer", steps, wanted, [bowl], needs)


@template
def milk_from_refrigerator(home: Home) -> Task:
    """Take the milk out of the refrigerator, and close the refrigerator."""
    home.room("Kitchen")
    closed = refrigerator(home, corner=home.chance(0.5))
    milk = home.thing("milk", closed.leaves[0], where=_where(home))
    home.clutter(closed.leaves[0], 2)
    table = _table(home)
    steps = (
        *_moved([milk], place("on-Physical", table)),
        _step("ClosingAContainerArtifact", what=closed.name),
    )
    wanted = all_of(goals.on(milk, table), goals.shut(*closed.leaves))
    needs = [Need("open", closed.leaves[0], closed.name), *_needs([milk], table)]
    return _task(home, "milk_from_refrigerator", steps, wanted, [milk], needs)


@template
def open_and_close(home: Home) -> Task:
    """Open a door or drawer, and leave it closed again."""
    home.room("Kitchen")
    kind = home.one_of(("door", "drawer", "refrigerator"))
    if kind == "door":
        closed, leaf = _cupboard(home, filled=home.chance(0.5))
    else:
        closed = chest(home, corner=home.chance(0.3)) if kind == "drawer" else refrigerator(home, corner=home.chance(0.5))
        leaf = home.one_of(closed.leaves)
    wanted, watch = goals.was_open(leaf)
    steps = (_step("OpeningAContainerArtifact", what=leaf), _step("ClosingAContainerArtifact", what=leaf))
    needs = [Need("open", leaf, closed.name)]
    return _task(
        home, "open_and_close", steps, all_of(wanted, goals.shut(*closed.leaves)), [], needs, watchers=[watch]
    )


# Looking for things


@template
def look_for_keys(home: Home) -> Task:
    """Look for keys that lie on some piece of furniture, and take them."""
    home.room("LivingRoom")
    tables = [_table(home), home.furniture(home.one_of(("side_table", "bedside_table", "coffee_table")))]
    try:
        tables.append(_table(home))
    except NoRoom:
        pass
    for one in tables:
        home.clutter(one, 2)
    keys = home.thing("keys", home.one_of(tables), where=_where(home))
    return _task(
        home,
        "look_for_keys",
        [_step("FetchingAnObject", what=keys)],
        goals.held(keys),
        [keys],
        [Need("see", keys), Need("grasp", keys)],
        unknown=[keys],
    )


@template
def find_in_closed_place(home: Home) -> Task:
    """Take a thing that is in a closed place nobody told of, and leave everything closed."""
    home.room("Kitchen")
    one, two = _cupboard(home, filled=False)[0], chest(home)
    leaves = (*one.leaves, *two.leaves)
    kind = home.one_of(("cup", "can", "glass", "keys"))
    leaf = home.one_of(leaves)
    thing = home.thing(kind, leaf)
    holder = one.name if leaf in one.leaves else two.name
    return _task(
        home,
        "find_in_closed_place",
        [_step("FetchingAnObject", what=thing)],
        all_of(goals.held(thing), goals.shut(*(other for other in leaves if other != leaf))),
        [thing],
        [Need("open", leaf, holder), Need("grasp", thing)],
        unknown=[thing],
    )


# Liquids


def _poured(home: Home) -> tuple[str, str, float]:
    """Put a bottle with something in it and a glass on one or two tables."""
    table = _table(home)
    bottle = home.thing("bottle", table, where=_where(home))
    other = table if home.chance(0.6) else _table(home)
    glass = home.thing(home.one_of(("glass", "cup", "mug")), other, where=_where(home))
    home.filled(bottle, "Water", home.between((300.0, 500.0)))
    return bottle, glass, float(int(home.rng.integers(5, 16)) * 10)


@template
def pour_and_bring(home: Home) -> Task:
    """Pour a drink and bring the glass to somebody."""
    home.room("Kitchen")
    person = home.one_of(("standing", "seated"))
    who = home.person_standing() if person == "standing" else home.person_seated()
    bottle, glass, amount = _poured(home)
    steps = (
        _step("FluidFlow-Translation", what=bottle, to=glass, amount=repr(amount)),
        _step("TransportingAnObject", what=glass, who=who),
    )
    wanted = all_of(goals.held(glass, who), goals.contains(glass, amount))
    needs = [Need("grasp", bottle), Need("pour", bottle, glass), Need("grasp", glass), Need("hand over", glass, who)]
    return _task(home, "pour_and_bring", steps, wanted, [bottle, glass], needs, poured=[bottle])


@template
def refill_glass(home: Home) -> Task:
    """Fill a glass up in which something is left."""
    home.room("Kitchen")
    bottle, glass, amount = _poured(home)
    left = float(int(home.rng.integers(1, 5)) * 10)
    home.filled(glass, "Water", left)
    steps = (_step("FluidFlow-Translation", what=bottle, to=glass, amount=repr(amount)),)
    wanted = goals.contains(glass, left + amount)
    return _task(
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
    steps = (_step("TurningOnPoweredDevice", what=device),)
    return _task(home, "press_button", steps, goals.switched(device, on=True), [], [Need("press", button)])


@template
def devices_off(home: Home) -> Task:
    """Turn two devices off that are on."""
    home.room("Kitchen")
    counter = home.furniture("counter", wall=True)
    table = _table(home)
    devices = [home.device("toaster", counter), home.device(home.one_of(("lamp", "microwave")), table)]
    for device, _ in devices:
        one = home.things[device]
        home.things[device] = type(one)(
            one.name, one.cls, one.pose, one.size, one.parts, (*one.facts, "knowrob:stateOfObject knowrob:DeviceStateOn")
        )
    steps = tuple(_step("TurningOffPoweredDevice", what=device) for device, _ in devices)
    wanted = all_of(*(goals.switched(device, on=False) for device, _ in devices))
    return _task(home, "devices_off", steps, wanted, [], [Need("press", button) for _, button in devices])


@template
def wipe_table(home: Home) -> Task:
    """Wipe a table, at a wall or not, around what stands on it, with a sponge that lies elsewhere."""
    home.room("Kitchen")
    table = home.furniture(home.one_of(("kitchen_table", "side_table", "coffee_table", "dining_table")))
    home.clutter(table, 3)
    sponge = home.thing("sponge", home.furniture("counter", wall=True), where="front")
    steps = (_step("WipingASurface", what=table, device=sponge),)
    needs = [Need("grasp", sponge), Need("wipe", sponge, table)]
    return _task(home, "wipe_table", steps, wiped(table, sponge), [sponge], needs, watchers=[wiping(table, sponge)])


@template
def several_in_a_row(home: Home) -> Task:
    """Bring a drink, put a book onto a shelf, and turn a lamp off."""
    home.room("LivingRoom")
    shelves = open_shelf(home)
    who = home.person_seated()
    table = _table(home)
    cup, book = home.thing("cup", table), home.thing("book", table)
    shelf = home.one_of(shelves)
    steps = (
        *_moved([book], place("in-ContGeneric", shelf)),
        _step("TransportingAnObject", what=cup, who=who),
    )
    wanted = all_of(goals.inside(book, shelf), goals.held(cup, who))
    needs = [*_needs([book], shelf), Need("grasp", cup), Need("hand over", cup, who)]
    return _task(home, "several_in_a_row", steps, wanted, [cup, book], needs)


def all_tasks(seeds: Sequence[int]) -> Iterator[tuple[str, int]]:
    """Yield template and seed of each task, templates in turn."""
    for seed in seeds:
        for name in sorted(TEMPLATES):
            yield name, seed
