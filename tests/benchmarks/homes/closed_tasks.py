"""Tasks with doors and drawers, and with things that have to be looked for."""

from __future__ import annotations

import contextlib

from tests.benchmarks.homes import goals
from tests.benchmarks.homes.closed import Closed, chest, cupboard, refrigerator
from tests.benchmarks.homes.furnishing import Home, NoRoom
from tests.benchmarks.homes.goals import all_of
from tests.benchmarks.homes.tasks import (
    Need,
    Task,
    moves,
    some_table,
    somewhere,
    step,
    takes_and_puts,
    task_of,
    template,
)
from tests.benchmarks.homes.written import place

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
    table = some_table(home)
    cups = [home.thing("cup", table, where=somewhere(home)) for _ in range(2)]
    wanted = all_of(*(goals.inside(one, closed.name) for one in cups))
    needs = [Need("open", closed.leaves[0], closed.name, either=True), *takes_and_puts(cups, closed.leaves[0])]
    return task_of(home, "tidy_cups", moves(cups, place("in-ContGeneric", closed.name)), wanted, cups, needs)


@template
def put_away_behind_door(home: Home) -> Task:
    """Put a thing behind a door and close the door."""
    home.room("Kitchen")
    closed, _ = _cupboard(home, filled=home.chance(0.5))
    table = some_table(home)
    thing = home.thing(home.one_of(("cup", "glass", "can", "mug", "box")), table, where=somewhere(home))
    steps = (
        *moves([thing], place("in-ContGeneric", closed.name)),
        step("ClosingAContainerArtifact", what=closed.name),
    )
    wanted = all_of(goals.inside(thing, closed.name), goals.shut(*closed.leaves))
    leaf = closed.leaves[0]
    needs = [
        Need("open", leaf, closed.name, either=True),
        *takes_and_puts([thing], leaf),
        Need("close", leaf, closed.name, either=True),
    ]
    return task_of(home, "put_away_behind_door", steps, wanted, [thing], needs)


@template
def out_of_drawer(home: Home) -> Task:
    """Take a thing out of a drawer and put it on a table."""
    home.room("Kitchen")
    closed = chest(home, corner=home.chance(0.3))
    leaf = home.one_of(closed.leaves)
    thing = home.thing(home.one_of(("bowl", "spoon", "keys", "phone", "can", "sponge")), leaf)
    table = some_table(home)
    home.clutter(table, 2)
    wanted = goals.on(thing, table)
    needs = [Need("open", leaf, closed.name), *takes_and_puts([thing], table)]
    return task_of(home, "out_of_drawer", moves([thing], place("on-Physical", table)), wanted, [thing], needs)


@template
def bowl_from_drawer(home: Home) -> Task:
    """Take a bowl out of a drawer, bring it to the table, and close the drawer."""
    home.room("Kitchen")
    closed = chest(home, corner=home.chance(0.3))
    leaf = home.one_of(closed.leaves)
    bowl = home.thing("bowl", leaf)
    table = some_table(home)
    steps = (*moves([bowl], place("on-Physical", table)), step("ClosingAContainerArtifact", what=leaf))
    wanted = all_of(goals.on(bowl, table), goals.shut(leaf))
    needs = [Need("open", leaf, closed.name), *takes_and_puts([bowl], table), Need("close", leaf, closed.name)]
    return task_of(home, "bowl_from_drawer", steps, wanted, [bowl], needs)


@template
def milk_from_refrigerator(home: Home) -> Task:
    """Take the milk out of the refrigerator, and close the refrigerator."""
    home.room("Kitchen")
    closed = refrigerator(home, corner=home.chance(0.5))
    milk = home.thing("milk", closed.leaves[0], where=somewhere(home))
    home.clutter(closed.leaves[0], 2)
    table = some_table(home)
    steps = (
        *moves([milk], place("on-Physical", table)),
        step("ClosingAContainerArtifact", what=closed.name),
    )
    wanted = all_of(goals.on(milk, table), goals.shut(*closed.leaves))
    leaf = closed.leaves[0]
    needs = [Need("open", leaf, closed.name), *takes_and_puts([milk], table), Need("close", leaf, closed.name)]
    return task_of(home, "milk_from_refrigerator", steps, wanted, [milk], needs)


@template
def open_and_close(home: Home) -> Task:
    """Open a door or drawer, and leave it closed again."""
    home.room("Kitchen")
    kind = home.one_of(("door", "drawer", "refrigerator"))
    if kind == "door":
        closed, leaf = _cupboard(home, filled=home.chance(0.5))
    else:
        closed = (
            chest(home, corner=home.chance(0.3)) if kind == "drawer" else refrigerator(home, corner=home.chance(0.5))
        )
        leaf = home.one_of(closed.leaves)
    wanted, watch = goals.was_open(leaf)
    steps = (step("OpeningAContainerArtifact", what=leaf), step("ClosingAContainerArtifact", what=leaf))
    needs = [Need("open", leaf, closed.name), Need("close", leaf, closed.name)]
    return task_of(home, "open_and_close", steps, all_of(wanted, goals.shut(leaf)), [], needs, watchers=[watch])


# Looking for things


@template
def look_for_keys(home: Home) -> Task:
    """Look for keys that lie on some piece of furniture, and take them."""
    home.room("LivingRoom")
    tables = [some_table(home), home.furniture(home.one_of(("side_table", "bedside_table", "coffee_table")))]
    with contextlib.suppress(NoRoom):
        tables.append(some_table(home))
    for one in tables:
        home.clutter(one, 2)
    keys = home.thing("keys", home.one_of(tables), where=somewhere(home))
    return task_of(
        home,
        "look_for_keys",
        [step("FetchingAnObject", what=keys)],
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
    return task_of(
        home,
        "find_in_closed_place",
        [step("FetchingAnObject", what=thing)],
        all_of(goals.held(thing), goals.shut(*(other for other in leaves if other != leaf))),
        [thing],
        [Need("open", leaf, holder), Need("see", thing), Need("grasp", thing)],
        unknown=[thing],
    )
