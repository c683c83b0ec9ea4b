"""The place of a map, for the search: room, floor, building, street and city.

Larger places have smaller ones as parts (``properPhysicalParts``). Some maps state it the wrong way round; the classes
of the places decide.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from planlang.designators import local_name
from planlang.ontology import Literal, Ontology, Triple, expand
from planlang.ontology.terms import RDFS

LEVELS = {
    "room": ("RoomInAConstruction", "roomNumber"),
    "floor": ("LevelOfAConstruction", "floorNumber"),
    "building": ("Building", "streetNumber"),
    "street": ("Street", None),
    "city": ("City", None),
}
"""Levels of places, smallest first, each with its class and the property for its number."""
MOST_PLACES = 1000


def places(ontology: Ontology) -> tuple[tuple[str, str], ...]:
    """Collect search texts for the places in the main document, as unique pairs (level, text).

    Texts are numbers, labels in all languages and local names; for a street also addresses (Karlstrasse 45).
    """
    found: dict[tuple[str, str], None] = {}
    levels = levels_of(ontology)
    for place, level in levels.items():
        if ontology.main(place):
            found.update(dict.fromkeys((level, text) for text in _texts(ontology, place, LEVELS[level][1])))
    for building, holder in holders(ontology, levels).items():
        if levels[building] == "building" and levels[holder] == "street" and ontology.main(holder):
            found.update(dict.fromkeys(("street", text) for text in _addresses(ontology, holder, building)))
    return tuple(found)[:MOST_PLACES]


def levels_of(ontology: Ontology) -> dict[str, str]:
    """Map each place to its level, rooms first."""
    return {iri: level for level, (cls, _) in LEVELS.items() for iri in ontology.individuals(expand(cls))}


def holders(ontology: Ontology, levels: Mapping[str, str]) -> dict[str, str]:
    """Map each place to the place that contains it, whichever way round the map states it."""
    found = {}
    for triple, is_inverted in _parts(ontology, levels):
        smaller, larger = (triple.subject, triple.object) if is_inverted else (triple.object, triple.subject)
        found[str(smaller)] = str(larger)
    return found


def inverted(ontology: Ontology) -> tuple[Triple, ...]:
    """Return the statements that are the wrong way round: a larger place as part of a smaller one."""
    return tuple(triple for triple, is_inverted in _parts(ontology, levels_of(ontology)) if is_inverted)


def _parts(ontology: Ontology, levels: Mapping[str, str]) -> Iterator[tuple[Triple, bool]]:
    """Yield the part statements between places of different levels, with True if the wrong way round."""
    ranks = {level: rank for rank, level in enumerate(LEVELS)}
    for triple in ontology.triples(p=expand("properPhysicalParts")):
        if triple.subject in levels and triple.object in levels:
            whole, part = ranks[levels[str(triple.subject)]], ranks[levels[str(triple.object)]]
            if whole != part:
                yield triple, whole < part


def _texts(ontology: Ontology, iri: str, number: str | None) -> Iterator[str]:
    """Yield the number of a place, its labels in all languages, and its local name."""
    for prop in (*((expand(number),) if number else ()), str(RDFS.label)):
        yield from (value.value.strip() for value in ontology.values(iri, prop) if isinstance(value, Literal))
    yield local_name(iri)


def _addresses(ontology: Ontology, street: str, building: str) -> Iterator[str]:
    for name in _texts(ontology, street, None):
        for number in ontology.values(building, expand("streetNumber")):
            if isinstance(number, Literal):
                yield f"{name} {number.value.strip()}"
