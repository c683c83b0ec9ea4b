"""The bundled environments: which of them have the things that the user names."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache

from executive.belief import SemanticMap, read_map
from executive.cli.inputs import find, names
from planlang.diagnostics import Diagnostic, note
from planlang.ontology import load
from planlang.resources import bundled

DEFAULT = "hospital_room"
"""The environment in which bundled recipes are run if nothing else is said."""


def environments_with(things: Iterable[str]) -> tuple[str, ...]:
    """The bundled environments in which all these things (local names or IRIs) have a place, sorted."""
    wanted = tuple(things)
    folder = bundled("ontologies") / "environments"
    return tuple(name for name in names(folder) if all(_has(_map(name), thing) for thing in wanted))


def default_environment(things: Iterable[str], notes: list[Diagnostic]) -> str:
    """The bundled environment for a run of a bundled recipe with these things.

    If the default lacks one of them and a single other has all, it is that other, with a note.
    """
    wanted = tuple(things)
    fitting = environments_with(wanted) if wanted else ()
    if len(fitting) != 1 or fitting[0] == DEFAULT:
        return DEFAULT
    lacking = ", ".join(thing for thing in wanted if not _has(_map(DEFAULT), thing))
    message = f"the environment is {fitting[0]}, as {DEFAULT} has no {lacking}"
    notes.append(note("X010", message, help=f"name another one by --environment, or this one: {fitting[0]}"))
    return fitting[0]


@cache
def _map(name: str) -> SemanticMap:
    return read_map(load(find("environment", name, bundled("ontologies") / "environments")))


def _has(semantic_map: SemanticMap, name: str) -> bool:
    thing = semantic_map.find(name)
    return thing is not None and thing.pose is not None
