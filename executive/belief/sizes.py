"""Sizes of map objects: as stated, else by the rules for doors, else the default of the class."""

from __future__ import annotations

from collections.abc import Iterable

from executive.belief.numbers import lengths, stated
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error, note
from planlang.ontology import Literal, Ontology, expand

Size = tuple[float, float, float]
"""Extents along the box's own x (depth), y (width) and z (height) [m]."""

EXTENTS = ("depthOfObject", "widthOfObject", "heightOfObject")
"""Properties for the extents along x, y, z."""

TRIPLES = ("boundingBoxSize", "dimensionsOfObject", "dimensions")
"""Properties whose one literal states all three extents."""

THIN = 0.001
"""Extent of a door that has none [m]."""


def read_size(
    ontology: Ontology, iri: str, types: Iterable[str], found: list[Diagnostic]
) -> tuple[Size | None, tuple[float | None, float | None, float | None]]:
    """The size of an individual and what the file states of it; what was filled in is noted.

    The size is None when an extent is neither stated nor known for a class: such a thing is a marker.
    """
    said = _stated(ontology, iri, found)
    if all(said):
        x, y, z = (value or 0.0 for value in said)
        return (x, y, z), said
    types = tuple(types)
    size, origins = [], []
    for name, value in zip(EXTENTS, said, strict=True):
        filled, origin = (value, "") if value else _default(ontology, types, name, any(said), found)
        size.append(filled)
        origins.append(f"{name} {filled} m ({origin})" if origin else "")
    span = ontology.span(iri)
    if None in size:
        if any(value is not None for value in said):
            missing = ", ".join(name for name, value in zip(EXTENTS, size, strict=True) if value is None)
            found.append(note("M006", f"{local_name(iri)} has no {missing} and no class that knows one: a place", span))
        return None, said
    found.append(note("M005", f"{local_name(iri)}: {', '.join(filter(None, origins))}", span))
    x, y, z = (value or 0.0 for value in size)
    return (x, y, z), said


def _stated(ontology: Ontology, iri: str, found: list[Diagnostic]) -> tuple[float | None, float | None, float | None]:
    values: list[float | None] = [None, None, None]
    for name in TRIPLES:
        triple = stated(ontology, iri, name)
        numbers = lengths(triple, found) if triple else None
        if triple and numbers and len(numbers) == 3:
            values = [_positive(number, name, triple.span, found) for number in numbers]
    for index, name in enumerate(EXTENTS):
        triple = stated(ontology, iri, name)
        numbers = lengths(triple, found) if triple else None
        if triple and numbers:
            values[index] = _positive(numbers[0], name, triple.span, found)
    radius = stated(ontology, iri, "radius")
    numbers = lengths(radius, found) if radius else None
    if radius and numbers and values[0] is None and values[1] is None:
        diameter = _positive(2 * numbers[0], "radius", radius.span, found)
        values[0] = values[1] = diameter
    return values[0], values[1], values[2]


def _positive(value: float, name: str, span: Span | None, found: list[Diagnostic]) -> float:
    if value < 0:
        found.append(error("M007", f"{name} is {value} m; a thing cannot be smaller than nothing", span))
        return 0.0
    return value


def _default(
    ontology: Ontology, types: tuple[str, ...], name: str, partly: bool, found: list[Diagnostic]
) -> tuple[float | None, str]:
    if partly and any(ontology.is_a(cls, expand("Door")) for cls in types):
        return THIN, "doors are thin"
    for cls in types:
        for ancestor in ontology.ancestors(cls):
            for restriction in ontology.restrictions(ancestor):
                if restriction.property == expand(name) and isinstance(restriction.filler, Literal):
                    try:
                        return restriction.filler.number(), f"default of {local_name(ancestor)}"
                    except ValueError as wrong:
                        message = f"{name} of {local_name(ancestor)}: {wrong}"
                        found.append(error("M002", message, restriction.span))
    return None, ""
