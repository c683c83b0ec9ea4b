"""Trays that two hands carry, with what stands on them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from sim.truth import held_by
from tests.support.scenarios import Goal, Scenario, Watched
from tests.support.scenarios.carrying import LEVEL, STANDS

SHIFTED = 0.005
"""Largest distance of what stands on a tray from where it stood on it [m]."""


def hands_on(name: str) -> Callable[[Watched], None]:
    """Return a watcher that notes the numbers of hands that had a thing while nothing else bore it."""

    def watch(watched: Watched) -> None:
        world, numbers = watched.world, watched.notes.setdefault("hands", set())
        assert isinstance(numbers, set)
        if not world.falling(name) and world.height_above_support(name) > STANDS:
            numbers.add(len(world.holders(name)))

    return watch


def served(tray: str, table: str, *things: str) -> Goal:
    """Return the goal that a tray stands on a table, things on it where they stood, and both hands carried it level."""

    def goal(watched: Watched) -> Iterator[str]:
        world = watched.world
        for name, on in ((tray, table), *((one, tray) for one in things)):
            if held_by(world, name) is not None or world.support(name) != on or world.height_above_support(name) > 0.02:
                yield f"{name} is over {world.support(name)}, held by {held_by(world, name)}"
            if not 0.0 <= watched.tilts.get(name, math.pi) <= LEVEL:
                yield f"{name} leaned by {watched.tilts.get(name)} rad"
        for name in things:
            before = watched.start[tray].inverse() @ watched.start[name]
            if (away := before.distance(world.pose(tray).inverse() @ world.pose(name))) > SHIFTED:
                yield f"{name} was shifted on {tray} by {away:.3f} m"
        if watched.notes.get("hands") != {2}:
            yield f"{tray} was in the air with {watched.notes.get('hands')} hands on it"

    return goal


SCENARIOS = [
    Scenario(
        "carry_the_tray",
        ("carry_the_tray", "--robot", "pr2", "--environment", "tea_room"),
        served("tray1", "tea_table1", "cup1", "cup2"),
        (hands_on("tray1"),),
        seconds=8.0,
    ),
    Scenario(
        "carry_the_tray with amigo",
        ("carry_the_tray", "--robot", "amigo", "--environment", "tea_room", "--set", "tray=tray2"),
        served("tray2", "tea_table1", "cup3"),
        (hands_on("tray2"),),
        seconds=7.0,
    ),
]
