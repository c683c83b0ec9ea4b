"""Dishes that are cooked: what went into them, where they are, and how long they were over or in the heat."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from planlang.state.questions import amount_of, came_to_be
from sim.leaves import inside
from tests.support.scenarios import Scenario, Watched

PR2 = ("--robot", "pr2")
COOK = ("--modules", "docs/examples/cooking.py")
BOWL = ("--modules", "docs/examples/pouring.py")


def watch_turns(watched: Watched) -> None:
    """Count how often each thing that came into being has been turned over."""
    world = watched.world
    for name in world.matter.origins:
        if name in world.names():
            up = bool(world.pose(name).rotation[2, 2] > 0)
            before, turns = watched.notes.get(name, (up, 0))  # type: ignore[misc]
            watched.notes[name] = (up, turns + (up != before))


def only(watched: Watched, cls: str) -> Iterator[str]:
    """Yield the thing of a class that came into being, if there is exactly one."""
    found = came_to_be(watched.world.world_state(), cls, watched.world.queries)
    if len(found) == 1:
        yield found[0]


def lies_turned_once(watched: Watched, name: str, support: str) -> Iterator[str]:
    """Yield what is wrong with where a pancake lies, and how often it was turned."""
    if (below := watched.world.gravity.under(name)) != support:
        yield f"{name} lies on {below}"
    watch_turns(watched)  # the last effect comes after the last step
    _, turns = watched.notes.get(name, (True, 0))  # type: ignore[misc]
    if turns != 1:
        yield f"{name} was turned {turns} times"


def heated(watched: Watched, name: str, seconds: Iterable[float]) -> Iterator[str]:
    """Yield which sides, the first one first, were over the heat for less than they should [s]."""
    sides = watched.world.matter.heated.get(name, (0.0, 0.0))
    for real, wanted in zip(sides, seconds, strict=True):
        if real < wanted - 1e-6:
            yield f"a side of {name} was heated for {real:.0f} s"


def pancake_in_the_pan(watched: Watched) -> Iterator[str]:
    """In the pan, turned once, each side over heat for 180 s, and made of at least 80 % of the mix."""
    mix = sum(portion.amount for portion in watched.world.scene.body("cup1").content)
    pancakes = list(only(watched, "Pancake"))
    for name in pancakes:
        yield from lies_turned_once(watched, name, "pan1")
        yield from heated(watched, name, (180.0, 180.0))
        if (amount := amount_of(watched.world.world_state(), name, "Pancake", watched.world.queries)) < 0.8 * mix:
            yield f"{amount:.0f} ml of {mix:.0f} were poured"
    if not pancakes:
        yield "there is not one pancake"


def pancake_on_the_maker(watched: Watched) -> Iterator[str]:
    """From egg, milk and flour, on the maker that is on, turned once when its lower side was baked."""
    matter = watched.world.matter
    pancakes = list(only(watched, "Dough"))
    for name in pancakes:
        parts = matter.went_into(name)
        yield from (f"{one} is not in it" for one in ("egg1", "flour1", "milk1") if one not in parts)
        if not any(watched.world.scene.body(one).type == "EggYolk-Food" for one in parts):
            yield "no yolk is in it"
        yield from lies_turned_once(watched, name, "maker1")
        yield from heated(watched, name, (60.0, 0.0))
    if not pancakes:
        yield "there is not one dough"
    if "egg1" not in matter.gone:
        yield "the egg is whole"
    if not list(only(watched, "Eggshell")):
        yield "there is no eggshell"
    if not matter.is_on("maker1"):
        yield "the maker is off"


INGREDIENTS = ("butter1", "egg1", "sugar1", "soda1", "cocoa1", "salt1", "flour1", "milk1", "vanilla1", "water1")


def watch_the_oven(watched: Watched) -> None:
    """Count how long the pan is in the oven while that is on [s]."""
    world = watched.world
    if world.matter.is_on("oven1"):
        place = np.array([world.pose("pan1").position])
        if inside(world.pose("oven1"), world.size("oven1"), place)[0]:
            watched.notes["in the oven"] = _baked(watched) + 1 / world.rate


def _baked(watched: Watched) -> float:
    return float(str(watched.notes.get("in the oven", 0.0)))


def frosted_cake(watched: Watched) -> Iterator[str]:
    """From all ingredients, baked in the oven for half an hour, and frosted."""
    matter = watched.world.matter
    cakes = list(only(watched, "FrostedCake"))
    for name in cakes:
        parts = matter.went_into(name)
        yield from (f"{one} is not in it" for one in (*INGREDIENTS, "frosting1") if one not in parts)
    if not cakes:
        yield "there is no frosted cake"
    yield from (f"{one} is still there" for one in ("egg1", "frosting1") if one not in matter.gone)
    if _baked(watched) < 1800.0 - 1.0:
        yield f"it was in the oven for {_baked(watched):.0f} s while that was on"


SCENARIOS = [
    Scenario(
        "ChocolateCakeBaking",
        (
            "corpus/recipes/ChocolateCakeBaking@2011-03.owl",
            "--accept",
            "R042",
            "--set",
            "@docs/examples/chocolate_cake.set",
            *PR2,
            "--environment",
            "cake_kitchen",
            *COOK,
            *BOWL,
        ),
        frosted_cake,
        (watch_the_oven,),
        seconds=60.0,
    ),
    Scenario(
        "make_pancakes",
        ("corpus/recipes/make_pancakes@hydro.owl", *PR2, "--environment", "stove_kitchen", *COOK),
        pancake_in_the_pan,
        (watch_turns,),
    ),
    Scenario(
        "pancake@kinetic",
        ("corpus/recipes/pancake@kinetic.owl", *PR2, "--environment", "pancake_kitchen", *COOK, *BOWL),
        pancake_on_the_maker,
        (watch_turns,),
    ),
    Scenario(
        "pancake-making",
        ("corpus/recipes/pancake-making@hydro.owl", *PR2, "--environment", "warm_pancake_kitchen", *COOK, *BOWL),
        pancake_on_the_maker,
        (watch_turns,),
    ),
]
