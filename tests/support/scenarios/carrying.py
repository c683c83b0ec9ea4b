"""Things that are fetched, transported and brought to people by the recipes of the library."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from sim.truth import held_by
from tests.support.scenarios import Goal, Scenario, Watched


def resting(name: str) -> Callable[[Watched], None]:
    """Return a watcher that notes on what a thing was put, one after the other; somebody may have their hand on it."""

    def watch(watched: Watched) -> None:
        places = watched.notes.setdefault("places", [])
        assert isinstance(places, list)
        world = watched.world
        if held_by(world, name) == "robot" or world.falling(name) or world.height_above_support(name) > STANDS:
            return
        if places[-1:] != [support := world.support(name)]:
            places.append(support)

    return watch


def carried(name: str, *places: str, holder: str | None = None) -> Goal:
    """Return the goal that a thing was on these one after the other, is with its holder at last, and was level."""

    def goal(watched: Watched) -> Iterator[str]:
        if watched.notes["places"] != [*places]:
            yield f"{name} was on {watched.notes['places']}"
        if (last := held_by(watched.world, name)) != holder:
            yield f"{name} is held by {last}"
        if watched.tilts.get(name, 0.0) > LEVEL:
            yield f"{name} leaned by {watched.tilts[name]:.2f} rad"

    return goal


def standing(on: str, *names: str) -> Goal:
    """Return the goal that things stand on another one, where nobody holds them, and were carried level."""

    def goal(watched: Watched) -> Iterator[str]:
        for name in names:
            if watched.world.support(name) != on or watched.world.height_above_support(name) > STANDS:
                yield f"{name} is over {watched.world.support(name)}"
            if (holder := held_by(watched.world, name)) is not None:
                yield f"{name} is held by {holder}"
            if not 0.0 < watched.tilts.get(name, 0.0) <= LEVEL:
                yield f"{name} leaned by {watched.tilts.get(name)} rad"

    return goal


STANDS = 0.005
"""Largest height of what stands on something over that [m]."""
LEVEL = 0.262
"""Largest lean of what is carried, 15 degrees [rad]."""
IAI = ("--environment", "corpus/environments/IAI_kitchen@iai_maps.urdf", "--environment", "iai_kitchen_milk")

SCENARIOS = [
    *(
        Scenario(
            f"move_the_bottle with {robot}",
            ("docs/examples/move_the_bottle.omn", "--robot", robot, "--environment", "hospital_room"),
            carried("bottle1", "cabinet1", "cabinet2", "bed1", holder="patient1"),
            (resting("bottle1"),),
            seconds=12.0,
        )
        for robot in ("amigo", "pr2")
    ),
    Scenario(
        "serve_the_milk",
        ("docs/examples/serve_the_milk.omn", "--robot", "pr2", *IAI),
        carried("milk1", "iai_fridge_main", "kitchen_island", "sink_area"),
        (resting("milk1"),),
        seconds=15.0,
    ),
    *(
        Scenario(
            f"clear_the_stove with {robot}",
            ("docs/examples/clear_the_stove.omn", "--robot", robot, "--environment", "stove_with_pans"),
            standing("table1", "pan1", "kettle1", "pot1"),
            seconds=seconds,
        )
        for robot, seconds in (("amigo", 7.0), ("pr2", 12.0))
    ),
]
