"""Tasks that robots fell short of in homes of strangers: two hands, cups, bowls, lying bottles, pots, edges; bins."""

from __future__ import annotations

import contextlib
from dataclasses import replace

from tests.benchmarks.homes import goals
from tests.benchmarks.homes.closed import chest, cupboard
from tests.benchmarks.homes.flats import flat
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
from tests.benchmarks.homes.written import place, while_seen_text
from tests.support.scenarios.wiping import wiped, wiping

TABLES = ("kitchen_table", "dining_table", "sideboard")


def _two_things(home: Home, on: str) -> list[str]:
    kinds = ("cup", "mug", "glass", "can", "bottle")
    return [home.thing(home.one_of(kinds), on, where=somewhere(home)) for _ in range(2)]


@template
def two_in_two_hands(home: Home) -> Task:
    """Take two things, then bring both to a table, the first or the second first."""
    home.room("Kitchen")
    counter, table = home.furniture("counter", wall=True), some_table(home, TABLES)
    things = _two_things(home, counter)
    home.clutter(counter, 2)
    order = things if home.chance(0.5) else things[::-1]
    to = place("on-Physical", table)
    steps = [step("FetchingAnObject", what=one) for one in things]
    steps += [step("DeliveringAnObject", what=one, to=to) for one in order]
    needs = [*takes_and_puts(things, table), Need("hold", things[1])]
    wanted = all_of(*(goals.on(one, table) for one in things))
    return task_of(home, "two_in_two_hands", steps, wanted, things, needs)


@template
def two_hands_through_a_door(home: Home) -> Task:
    """Carry two things at once from one room to the table of the next."""
    made = flat(home, 2, hall=False)
    counter = home.furniture("counter", wall=True)
    things = _two_things(home, counter)
    room = made.rooms[1]
    home.enter(room)
    table = some_table(home, TABLES)
    to = place("on-Physical", table)
    steps = [step("FetchingAnObject", what=one) for one in things]
    steps += [step("DeliveringAnObject", what=one, to=to) for one in things]
    passed = [Need("pass", doorway) for doorway in made.ways(room)]
    needs = [*passed, *takes_and_puts(things, table), Need("hold", things[1])]
    wanted = all_of(*(goals.on(one, table) for one in things))
    return task_of(home, "two_hands_through_a_door", steps, wanted, things, needs)


@template
def while_a_cup_is_seen(home: Home) -> Task:
    """Bring one cup after the other to another room, as long as one is seen on the table."""
    home.unwanted = ("cup",)
    made = flat(home, 2, hall=False)
    table = some_table(home, TABLES)
    cups = [home.thing("cup", table) for _ in range(int(home.rng.integers(2, 4)))]
    home.clutter(table, 2)
    room = made.rooms[1]
    home.enter(room)
    other = some_table(home, TABLES)
    passed = [Need("pass", doorway) for doorway in made.ways(room)]
    wanted = all_of(*(goals.on(one, other) for one in cups))
    task = task_of(
        home,
        "while_a_cup_is_seen",
        (),
        wanted,
        cups,
        [*passed, *(Need("see", one) for one in cups), *takes_and_puts(cups, other)],
    )
    return replace(task, recipe=while_seen_text("Cup", table, other, home))


@template
def radio_at_the_edge(home: Home) -> Task:
    """Turn a radio on that stands at the edge of a table or worktop."""
    home.room("LivingRoom")
    table = some_table(home, ("kitchen_table", "sideboard", "desk", "side_table", "counter"))
    radio, button = home.device("radio", table, where="front")
    home.clutter(table, 3)
    steps = [step("TurningOnPoweredDevice", what=radio)]
    wanted = goals.switched(radio, on=True)
    return task_of(home, "radio_at_the_edge", steps, wanted, [], [Need("press", button)])


@template
def bowl_from_the_counter(home: Home) -> Task:
    """Bring a bowl of 10 to 30 cm from a worktop, or from something lower, to a table."""
    home.room("Kitchen")
    begin = some_table(home, ("counter", "counter", "sideboard", "side_table", "coffee_table"))
    bowl = home.thing("large_bowl", begin, where=somewhere(home))
    home.clutter(begin, 2)
    table = some_table(home, TABLES)
    steps = moves([bowl], place("on-Physical", table))
    return task_of(home, "bowl_from_the_counter", steps, goals.on(bowl, table), [bowl], takes_and_puts([bowl], table))


@template
def lying_bottle(home: Home) -> Task:
    """Bring a bottle that lies on a table to another."""
    home.room("Kitchen")
    begin = some_table(home)
    bottle = home.lying("bottle", begin, where=somewhere(home))
    home.clutter(begin, 2)
    table = some_table(home, TABLES)
    steps, wanted = moves([bottle], place("on-Physical", table)), goals.on(bottle, table)
    needs = takes_and_puts([bottle], table)
    return task_of(home, "lying_bottle", steps, wanted, [bottle], needs, poured=[bottle])  # it lies, and may be tilted


@template
def wipe_side_table(home: Home) -> Task:
    """Wipe a side table, on which things may stand, with a sponge from elsewhere."""
    home.room("LivingRoom")
    table = home.furniture(home.one_of(("side_table", "bedside_table")))
    home.clutter(table, 1)
    sponge = home.thing("sponge", some_table(home), where="front")
    steps = [step("WipingASurface", what=table, device=sponge)]
    needs = [Need("grasp", sponge), Need("wipe", sponge, table)]
    watchers = [wiping(table, sponge)]
    return task_of(home, "wipe_side_table", steps, wiped(table, sponge), [sponge], needs, watchers=watchers)


@template
def from_drawer_to_cupboard(home: Home) -> Task:
    """Put a thing from a drawer into the cupboard beside it, and close both."""
    home.room("Kitchen")
    drawers = chest(home)
    cupboards = cupboard(home, home.one_of(("base", "tall")), beside=drawers.name)
    drawer, door = home.one_of(drawers.leaves), cupboards.leaves[0]
    thing = home.thing(home.one_of(("bowl", "spoon", "keys", "phone", "can")), drawer)
    steps = [
        *moves([thing], place("in-ContGeneric", cupboards.name)),
        step("ClosingAContainerArtifact", what=drawer),
        step("ClosingAContainerArtifact", what=cupboards.name),
    ]
    needs = [
        Need("open", drawer, drawers.name),
        Need("open", door, cupboards.name),
        *takes_and_puts([thing], door),
        Need("close", drawer, drawers.name),
        Need("close", door, cupboards.name),
    ]
    wanted = all_of(goals.inside(thing, cupboards.name), goals.shut(drawer, door))
    return task_of(home, "from_drawer_to_cupboard", steps, wanted, [thing], needs)


@template
def drawer_in_the_corner(home: Home) -> Task:
    """Bring a thing from a drawer, beside which a cupboard or sideboard stands, to a table, and close the drawer."""
    home.room("Kitchen")
    drawers = chest(home, corner=True)
    with contextlib.suppress(NoRoom):
        cupboard(home, "base", beside=drawers.name)
    drawer = home.one_of(drawers.leaves)
    thing = home.thing(home.one_of(("spoon", "keys", "phone", "can", "bowl")), drawer)
    table = some_table(home, TABLES)
    steps = [*moves([thing], place("on-Physical", table)), step("ClosingAContainerArtifact", what=drawer)]
    wanted = all_of(goals.on(thing, table), goals.shut(drawer))
    needs = [
        Need("open", drawer, drawers.name),
        *takes_and_puts([thing], table),
        Need("close", drawer, drawers.name),
    ]
    return task_of(home, "drawer_in_the_corner", steps, wanted, [thing], needs)


@template
def pot_with_water(home: Home) -> Task:
    """Carry a pot with water in it from one worktop or table to another with both hands."""
    home.room("Kitchen")
    counter, table = home.furniture("counter", wall=True), some_table(home, ("counter", *TABLES))
    pot = home.pot(counter)
    amount = 100.0 * int(home.rng.integers(3, 16))
    home.filled(pot, "Water", amount)
    steps = moves([pot], place("on-Physical", table))
    wanted = all_of(goals.on(pot, table), goals.contains(pot, amount))
    return task_of(home, "pot_with_water", steps, wanted, [pot], takes_and_puts([pot], table))


@template
def into_the_bin(home: Home) -> Task:
    """Throw something small into a waste basket at a wall."""
    home.room("Kitchen")
    begin = some_table(home)
    thing = home.thing(home.one_of(("can", "sponge")), begin, where=somewhere(home))
    home.clutter(begin, 2)
    basket = home.furniture("waste_basket", wall=True)
    steps, wanted = moves([thing], place("in-ContGeneric", basket)), goals.inside(thing, basket)
    return task_of(home, "into_the_bin", steps, wanted, [thing], takes_and_puts([thing], basket))
