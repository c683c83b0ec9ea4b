"""Bundled environments, and the choice of one for runs without ``--environment``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path

from executive.maps.semantic_map import SemanticMap, read_map
from planlang.diagnostics import Diagnostic, note
from planlang.files import Bundled
from planlang.ontology import load
from planlang.words import Option, Text

DEFAULT_ENVIRONMENT = "hospital_room"
"""Environment of bundled recipes unless their objects belong to another one."""


def environments_with(things: Iterable[str]) -> tuple[str, ...]:
    """List the bundled environments in which all these objects (local names or IRIs) have a pose, sorted.

    Maps without a room are skipped: they extend environments that do not come with planlang.
    """
    names = tuple(things)
    return environments_for(lambda one: all(_has(one, name) for name in names))


def environments_for(fits: Callable[[SemanticMap], bool]) -> tuple[str, ...]:
    """List the bundled environments with a room whose map satisfies a predicate, sorted."""
    maps = {name: _map(name) for name in Bundled.ENVIRONMENT.names()}
    return tuple(name for name, one in maps.items() if _has_room(one) and fits(one))


def default_environment(recipe: Path, things: Iterable[str], notes: list[Diagnostic]) -> str:
    """Choose the bundled environment for a run of a bundled recipe with these objects.

    The environment in the recipe's prefixes is the default; the only one that has all the objects replaces it, with a
    note.
    """
    text = recipe.read_text(encoding="utf-8")
    in_prefixes = (name for name in Bundled.ENVIRONMENT.names() if f"/{name}.owl#>" in text)
    usual = next(in_prefixes, DEFAULT_ENVIRONMENT)
    names = tuple(things)
    fitting = environments_with(names) if names else ()
    if len(fitting) != 1 or fitting[0] == usual:
        return usual
    lacking = ", ".join(name for name in names if not _has(_map(usual), name))
    message = f"the environment {fitting[0]} is chosen, as {usual} has no {lacking}"
    notes.append(note("X010", message, help=Text(Option("environment"), " names one")))
    return fitting[0]


@cache
def _map(name: str) -> SemanticMap:
    return read_map(load(Bundled.ENVIRONMENT.find(name)))


def _has(semantic_map: SemanticMap, name: str) -> bool:
    thing = semantic_map.find(name)
    return thing is not None and thing.pose is not None


def _has_room(semantic_map: SemanticMap) -> bool:
    return any(semantic_map.is_a(thing, "RoomInAConstruction") for thing in semantic_map.objects)
