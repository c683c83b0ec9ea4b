"""Drinks that are served: to a person, or onto a bed."""

from __future__ import annotations

import math
from collections.abc import Iterator

from sim.truth import at_rest_on, held_by, tilt
from tests.support.scenarios import Goal, Scenario, Watched

AMIGO = ("--robot", "corpus/robots/amigo@hydro.owl")


def held(name: str, person: str) -> Goal:
    """Return the goal that a person holds a thing."""

    def goal(watched: Watched) -> Iterator[str]:
        if (holder := held_by(watched.world, name)) != person:
            yield f"{name} is held by {holder}"

    return goal


UPRIGHT = math.radians(15.0)
"""Largest angle between up and the axis of a drink that was served [rad]."""
OPENED = math.radians(60.0)
"""Least angle by which a door that was in the way was opened [rad]."""


def on(name: str, support: str) -> Goal:
    """Return the goal that a thing is at rest on another, upright."""

    def goal(watched: Watched) -> Iterator[str]:
        if (found := at_rest_on(watched.world, name)) != support:
            yield f"{name} is at rest on {found}"
        if (angle := tilt(watched.world.pose(name))) > UPRIGHT:
            yield f"{name} is tilted by {math.degrees(angle):.0f} degrees"

    return goal


def leading(watched: Watched) -> None:
    """Note the largest angle of each door while a hand led it."""
    for leaf in watched.world.led():
        widest = watched.notes.setdefault("led", {})
        assert isinstance(widest, dict)
        widest[leaf] = max(widest.get(leaf, 0.0), watched.world.joint(leaf))


def on_from_behind(name: str, support: str, door: str) -> Goal:
    """Return the goal that a thing is at rest on another, after a hand opened a door by its handle."""

    def goal(watched: Watched) -> Iterator[str]:
        yield from on(name, support)(watched)
        led = watched.notes.get("led", {})
        assert isinstance(led, dict)
        if led.get(door, 0.0) < OPENED:
            yield f"a hand opened {door} by {math.degrees(led.get(door, 0.0)):.0f} degrees"

    return goal


def _served(recipe: str, room: str, goal: Goal, *more: str, called: str = "") -> Scenario:
    """Return the scenario in which Amigo serves a drink in a room of the corpus."""
    file, name, orders = RECIPES[recipe]
    environment = ("--environment", f"corpus/environments/{room}@re_stack.owl.in")
    arguments = (file, *AMIGO, *environment, *orders, *more)
    seconds = 20.0 if recipe == "new" and "ias" in room else 5.0  # the suite has those of the older recipe
    return Scenario(f"{name} in {room}{called}", arguments, goal, (leading,), seconds=seconds)


RECIPES = {
    "hydro": ("corpus/recipes/serve_drink@knowrob_hydro_2014-11.owl", "serve_drink", ()),
    "new": ("corpus/recipes/serve_drink_new@re_stack.owl", "serve_drink_new", ("--accept", "R042")),
}
SCENARIOS = [
    Scenario("serve_a_drink", ("serve_a_drink",), held("bottle1", "patient1")),
    *(
        scenario
        for recipe in RECIPES
        for scenario in (
            _served(recipe, "map_hospital_room", on("bottle1", "bed1")),
            _served(recipe, "ias_hospital_room", on_from_behind("bottle1", "bed1", "door1")),
            _served(recipe, "ias_hospital_room_with_objects", on("bottle1", "bed1"), called=", bottle1"),
            _served(
                recipe,
                "ias_hospital_room_with_objects",
                on("coke1", "bed1"),
                "--set",
                "bottle=coke1",
                called=", coke1",
            ),
        )
    ),
]
