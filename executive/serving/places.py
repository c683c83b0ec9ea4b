"""The place that a map is of: room, floor, building, street and city, by the words that people ask for them with."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.designators import local_name
from planlang.ontology import Literal, Ontology, expand
from planlang.ontology.terms import RDFS

LEVELS = {
    "room": ("RoomInAConstruction", "roomNumber"),
    "floor": ("LevelOfAConstruction", "floorNumber"),
    "building": ("Building", "streetNumber"),
    "street": ("Street", None),
    "city": ("City", None),
}
"""Level of the hierarchy of places -> its class, and the property that numbers its members."""
MOST_PLACES = 1000


def places(ontology: Ontology) -> tuple[tuple[str, str], ...]:
    """Return the levels and texts under which the main document's places are known, each once."""
    found: dict[tuple[str, str], None] = {}
    for level, (cls, number) in LEVELS.items():
        for iri in ontology.individuals(expand(cls)):
            if ontology.main(iri):
                found.update(dict.fromkeys((level, text) for text in _texts(ontology, iri, number)))
    for street in ontology.individuals(expand("Street")):
        if ontology.main(street):
            found.update(dict.fromkeys(("street", text) for text in _addresses(ontology, street)))
    return tuple(found)[:MOST_PLACES]


def _texts(ontology: Ontology, iri: str, number: str | None) -> Iterator[str]:
    """Yield a place's number, its labels in all languages, and its local name."""
    for prop in (*((expand(number),) if number else ()), str(RDFS.label)):
        yield from (value.value.strip() for value in ontology.values(iri, prop) if isinstance(value, Literal))
    yield local_name(iri)


def _addresses(ontology: Ontology, street: str) -> Iterator[str]:
    """Yield the street with the number of each of its buildings: Karlstrasse 45."""
    for building in ontology.values(street, expand("properPhysicalParts")):
        if isinstance(building, str):
            for name in _texts(ontology, street, None):
                for number in ontology.values(building, expand("streetNumber")):
                    if isinstance(number, Literal):
                        yield f"{name} {number.value.strip()}"
