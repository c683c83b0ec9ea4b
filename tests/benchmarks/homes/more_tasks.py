"""Further tasks: doors that stand side by side, things at the edge and far back, drawers that are filled."""

from __future__ import annotations

from tests.benchmarks.homes import goals
from tests.benchmarks.homes.closed import chest, cupboard
from tests.benchmarks.homes.furnishing import Home
from tests.benchmarks.homes.goals import all_of
from tests.benchmarks.homes.tasks import (
    Need,
    Task,
    moves,
    some_table,
    something,
    step,
    takes_and_puts,
    task_of,
    template,
)
from tests.benchmarks.homes.written import place


@template
def from_double_cupboard(home: Home) -> Task:
    """Take a thing from behind one of two doors that are side by side, and close what was opened."""
    home.room("Kitchen")
    closed = cupboard(home, home.one_of(("base", "tall", "wall")), doors=2, corner=home.chance(0.3))
    leaf = home.one_of(closed.leaves)
    thing = home.thing(home.one_of(("cup", "glass", "can", "mug", "bottle")), leaf)
    table = some_table(home)
    steps = (*moves([thing], place("on-Physical", table)), step("ClosingAContainerArtifact", what=leaf))
    wanted = all_of(goals.on(thing, table), goals.shut(*closed.leaves))
    needs = [Need("open", leaf, closed.name), *takes_and_puts([thing], table), Need("close", leaf, closed.name)]
    return task_of(home, "from_double_cupboard", steps, wanted, [thing], needs)


@template
def edge_and_back(home: Home) -> Task:
    """Bring a thing that stands at the edge of a worktop and one that stands far back to a table."""
    home.room("Kitchen")
    counter = home.furniture("counter", wall=True, corner=home.chance(0.3))
    things = [home.thing(something(home), counter, where=where) for where in ("back", "front")]
    home.clutter(counter, 4)
    table = some_table(home, ("kitchen_table", "dining_table", "sideboard"))
    wanted = all_of(*(goals.on(one, table) for one in things))
    steps = moves(things, place("on-Physical", table))
    return task_of(home, "edge_and_back", steps, wanted, things, takes_and_puts(things, table))


@template
def cutlery_into_drawer(home: Home) -> Task:
    """Put a fork and a spoon into a drawer, and close it."""
    home.room("Kitchen")
    closed = chest(home, corner=home.chance(0.3))
    leaf = home.one_of(closed.leaves)
    table = some_table(home)
    things = [home.thing(kind, table) for kind in ("fork", "spoon")]
    steps = (*moves(things, place("in-ContGeneric", leaf)), step("ClosingAContainerArtifact", what=leaf))
    wanted = all_of(*(goals.inside(one, leaf) for one in things), goals.shut(leaf))
    needs = [Need("open", leaf, closed.name), *takes_and_puts(things, leaf), Need("close", leaf, closed.name)]
    return task_of(home, "cutlery_into_drawer", steps, wanted, things, needs)
