"""Phrases about a map: its nouns, and the locations that phrases describe."""

from __future__ import annotations

from collections.abc import Iterable

from executive.maps import SemanticMap
from planlang.designators import Location, Object, Person
from planlang.diagnostics import BadInput, Span, error
from planlang.ontology import shorten
from planlang.phrases import Lexicon, read_location, write_thing


def lexicon_of(semantic_map: SemanticMap, substances: Iterable[str] = ()) -> Lexicon:
    """Make the lexicon of a map: its things by name, the classes of its ontology by their words.

    ``substances`` are further classes, of what is in vessels.
    """
    ontology = semantic_map.ontology
    things: dict[str, Object] = {}
    for thing in semantic_map.objects:
        if thing.pose is not None:
            cls = next((cls for cls in thing.types if not cls.endswith("#NamedIndividual")), "Thing")
            kind = Person if semantic_map.is_a(thing, "Person") else Object
            things[thing.name] = kind(shorten(cls), thing.iri)
    return Lexicon.of(ontology, things, substances)


def read_phrase(phrase: str, semantic_map: SemanticMap, file: str) -> Location:
    """Parse a phrase to a location, as ``planlang locate`` does. Raises BadInput, also if the map lacks a thing of it.

    ``file`` names the source of the phrase in messages.
    """
    lexicon = lexicon_of(semantic_map)
    location = read_location(phrase, lexicon, file=file)
    placed = [thing for thing in semantic_map.objects if thing.pose is not None]
    problems = []
    for what in location.things():
        if what.iri is None and not any(semantic_map.is_a(one, what.type) for one in placed):
            message = f"the map has no {write_thing(what, lexicon).removeprefix('the ')}"
            problems.append(error("P008", message, Span(file), f"it has {', '.join(one.name for one in placed)}"))
    if problems:
        raise BadInput(problems)
    return location
