"""The place that a map is of: room, floor, building, street and city, by the words that people ask for them with.

Places are parts of each other (``properPhysicalParts``), the larger one has the smaller one. Some maps say it the other
way round; the class of a place tells which is the larger.
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
"""Level of the hierarchy of places, the smallest first -> its class, and the property that numbers its members."""
MOST_PLACES = 1000


def places(ontology: Ontology) -> tuple[tuple[str, str], ...]:
    """Return the levels and texts under which the main document's places are known, each once.

    Texts are numbers, labels in all languages and local names; a street is also known with the numbers of its
    buildings (Karlstrasse 45).
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
    """Return the level of each place, rooms first."""
    return {iri: level for level, (cls, _) in LEVELS.items() for iri in ontology.individuals(expand(cls))}


def holders(ontology: Ontology, levels: Mapping[str, str]) -> dict[str, str]:
    """Return the place that each place is a part of, whichever way round that is stated."""
    found = {}
    for triple, is_inverted in _parts(ontology, levels):
        smaller, larger = (triple.subject, triple.object) if is_inverted else (triple.object, triple.subject)
        found[str(smaller)] = str(larger)
    return found


def inverted(ontology: Ontology) -> tuple[Triple, ...]:
    """Return the statements that say of a larger place that it is a part of a smaller one."""
    return tuple(triple for triple, is_inverted in _parts(ontology, levels_of(ontology)) if is_inverted)


def _parts(ontology: Ontology, levels: Mapping[str, str]) -> Iterator[tuple[Triple, bool]]:
    """Yield the statements about places of different levels, each with whether it is the wrong way round."""
    ranks = {level: rank for rank, level in enumerate(LEVELS)}
    for triple in ontology.triples(p=expand("properPhysicalParts")):
        if triple.subject in levels and triple.object in levels:
            whole, part = ranks[levels[str(triple.subject)]], ranks[levels[str(triple.object)]]
            if whole != part:
                yield triple, whole < part


def _texts(ontology: Ontology, iri: str, number: str | None) -> Iterator[str]:
    """Yield a place's number, its labels in all languages, and its local name."""
    for prop in (*((expand(number),) if number else ()), str(RDFS.label)):
        yield from (value.value.strip() for value in ontology.values(iri, prop) if isinstance(value, Literal))
    yield local_name(iri)


def _addresses(ontology: Ontology, street: str, building: str) -> Iterator[str]:
    for name in _texts(ontology, street, None):
        for number in ontology.values(building, expand("streetNumber")):
            if isinstance(number, Literal):
                yield f"{name} {number.value.strip()}"
