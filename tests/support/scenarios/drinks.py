"""Drinks that are served: to a person, or onto a bed."""

from __future__ import annotations

from collections.abc import Iterator

from sim.world import at_rest_on, held_by
from tests.support.scenarios import Goal, Scenario, Watched

HYDRO = "corpus/recipes/serve_drink@knowrob_hydro_2014-11.owl"
ROOMS = "corpus/environments/"
AMIGO = ("--robot", "corpus/robots/amigo@hydro.owl")


def held(name: str, person: str) -> Goal:
    """Return the goal that a person holds a thing."""

    def goal(watched: Watched) -> Iterator[str]:
        if (holder := held_by(watched.world, name)) != person:
            yield f"{name} is held by {holder}"

    return goal


def on(name: str, support: str) -> Goal:
    """Return the goal that a thing is at rest on another."""

    def goal(watched: Watched) -> Iterator[str]:
        if (found := at_rest_on(watched.world, name)) != support:
            yield f"{name} is at rest on {found}"

    return goal


SCENARIOS = [
    Scenario("serve_a_drink", ("serve_a_drink",), held("bottle1", "patient1")),
    Scenario(
        "serve_drink in map_hospital_room",
        (HYDRO, *AMIGO, "--environment", f"{ROOMS}map_hospital_room@re_stack.owl.in"),
        on("bottle1", "bed1"),
    ),
]
