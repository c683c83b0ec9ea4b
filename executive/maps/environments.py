"""The bundled environments: which of them a run is in where its user names none."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

from executive.maps.semantic_map import SemanticMap, read_map
from planlang.diagnostics import Diagnostic, note
from planlang.files import Bundled
from planlang.ontology import load

DEFAULT_ENVIRONMENT = "hospital_room"
"""The environment in which bundled recipes are run without ``--environment`` if they name things of no other one."""


def environments_with(things: Iterable[str]) -> tuple[str, ...]:
    """Return the bundled environments in which all these things (local names or IRIs) have a pose, sorted.

    Those without a room are left out: they add things to an environment that does not come with planlang.
    """
    wanted = tuple(things)
    return environments_for(lambda one: all(_has(one, thing) for thing in wanted))


def environments_for(fits: Callable[[SemanticMap], bool]) -> tuple[str, ...]:
    """Return the bundled environments with a room whose map fits, sorted."""
    maps = {name: _map(name) for name in Bundled.ENVIRONMENT.names()}
    return tuple(name for name, one in maps.items() if _has_room(one) and fits(one))


def default_environment(recipe: Path, things: Iterable[str], notes: list[Diagnostic]) -> str:
    """Return the bundled environment for a run of a bundled recipe with these things.

    That whose namespace the recipe's prefixes name is replaced, with a note, if only one other contains the things.
    """
    text = recipe.read_text(encoding="utf-8")
    named = (name for name in Bundled.ENVIRONMENT.names() if f"/{name}.owl#>" in text)
    usual = next(named, DEFAULT_ENVIRONMENT)
    wanted = tuple(things)
    fitting = environments_with(wanted) if wanted else ()
    if len(fitting) != 1 or fitting[0] == usual:
        return usual
    lacking = ", ".join(thing for thing in wanted if not _has(_map(usual), thing))
    message = f"the environment {fitting[0]} is chosen, as {usual} has no {lacking}"
    notes.append(note("X010", message, help="--environment names one"))
    return fitting[0]


@cache
def _map(name: str) -> SemanticMap:
    return read_map(load(Bundled.ENVIRONMENT.find(name)))


def _has(semantic_map: SemanticMap, name: str) -> bool:
    thing = semantic_map.find(name)
    return thing is not None and thing.pose is not None


def _has_room(semantic_map: SemanticMap) -> bool:
    return any(semantic_map.is_a(thing, "RoomInAConstruction") for thing in semantic_map.objects)
