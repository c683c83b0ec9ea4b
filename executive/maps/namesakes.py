"""Things of a map that a recipe means by an individual of another namespace: those of the same name and class."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from executive.maps.classes import is_kind
from executive.maps.semantic_map import MapObject
from planlang.designators import Object, is_called, local_name
from planlang.ontology import Ontology


def namesakes(ontology: Ontology, things: Iterable[MapObject], what: Object) -> list[MapObject]:
    """List the things that the individual of a designator may be; empty if it names none.

    It is the thing of its IRI; else those of its class that have its local name, then those that have it in other case
    or with other separators, then those that are labelled so.
    """
    if what.iri is None:
        return []
    every = list(things)
    if same := [thing for thing in every if thing.iri == what.iri]:
        return same
    written = local_name(what.iri)
    ways: tuple[Callable[[MapObject], bool], ...] = (
        lambda thing: is_called(thing.iri, written),
        lambda thing: _folded(local_name(thing.iri)) == _folded(written),
        lambda thing: _folded(ontology.label(thing.iri) or "") == _folded(written),
    )
    for is_named in ways:
        named = [thing for thing in every if is_named(thing)]
        if fitting := [one for one in named if any(is_kind(ontology, cls, what.type) for cls in one.types)]:
            return fitting
    return []


def _folded(name: str) -> str:
    return "".join(filter(str.isalnum, name.casefold()))
