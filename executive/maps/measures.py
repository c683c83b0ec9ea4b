"""Sizes of things that maps state, or that are defaults of their classes."""

from __future__ import annotations

import math
from collections.abc import Iterable

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note, unread
from planlang.measures import EXTENTS, LARGEST, TRIPLES, lengths, stated, unreadable
from planlang.ontology import Literal, Ontology, Restriction, Triple, expand
from planlang.units import stated_number, unit_of_property

Size = tuple[float, float, float]
"""Extents along the box's own x (depth), y (width) and z (height) [m]."""

THIN = 0.001
"""Extent of a door that has none [m]."""


def read_size(ontology: Ontology, iri: str, types: Iterable[str], notes: list[Diagnostic]) -> Size | None:
    """Read the size of an individual; missing extents are filled in from its classes, with a note.

    None if no extent is stated or a default of a class: such an object is a mere place. None with an error if an
    extent is negative, or only some are known.
    """
    types = tuple(types)
    extents = stated_size(ontology, iri, notes)
    if not any(extents) and ontology.any_is_a(types, ("Joint-Physical",)):
        return None  # maps of the IAI kitchen give their joints extents of 0
    if any(value is not None and value < 0 for value in extents):
        return None
    if all(extents):
        x, y, z = (value or 0.0 for value in extents)
        return (x, y, z)
    thin = (THIN, "doors are thin") if any(extents) and ontology.any_is_a(types, ("Door",)) else None
    size, origins = [], []
    for name, value in zip(EXTENTS, extents, strict=True):
        filled, origin = (value, "") if value else thin or _default(ontology, types, name, notes)
        size.append(filled)
        origins.append(f"{name} {filled} m ({origin})" if origin else "")
    span = ontology.span(iri)
    if None in size:
        if any(value is not None for value in extents):
            missing = ", ".join(name for name, value in zip(EXTENTS, size, strict=True) if value is None)
            message = f"{local_name(iri)} has no {missing}, and its class has no default: it is a mere place"
            notes.append(unread("M006", message, span))
        return None
    notes.append(note("M005", f"{local_name(iri)}: {', '.join(filter(None, origins))}", span))
    x, y, z = (value or 0.0 for value in size)
    return (x, y, z)


def read_boards(
    ontology: Ontology, iri: str, types: Iterable[str], size: Size | None, notes: list[Diagnostic]
) -> tuple[float, ...]:
    """Read the heights of the boards of a shelf above its lower end [m], the lowest first; none for what has no boards.

    Those that the thing states, else those of its nearest class, of which the ones within its height are noted.
    """
    if size is None:
        return ()
    own = stated(ontology, iri, "boardHeights")
    of_class = (one for cls in types for one in ontology.inherited_restrictions(cls, expand("boardHeights")))
    default = None if own else next(of_class, None)
    said = Triple(iri, expand("boardHeights"), default.filler, default.span) if default else own
    heights = sorted(lengths(said, notes, LARGEST) or ()) if said else []
    boards = tuple(height for height in heights if 0 <= height < size[2])
    if own and len(boards) < len(heights):
        notes.append(unreadable(own, f"a shelf {size[2]} m high has boards from 0 m to there"))
        return ()
    if default and boards:
        shown = ", ".join(f"{height} m" for height in boards)
        notes.append(note("M005", f"{local_name(iri)}: boards at {shown} (default of its class)", ontology.span(iri)))
    return boards


def stated_size(ontology: Ontology, iri: str, notes: list[Diagnostic]) -> tuple[float | None, ...]:
    """Read the three stated extents; None for each that is missing."""
    values: list[float | None] = [None, None, None]
    for name in TRIPLES:
        triple = stated(ontology, iri, name)
        numbers = lengths(triple, notes, LARGEST) if triple else None
        if triple and numbers and len(numbers) == 3:
            values = [_positive(number, name, triple.span, notes) for number in numbers]
    for index, name in enumerate(EXTENTS):
        triple = stated(ontology, iri, name)
        numbers = lengths(triple, notes, LARGEST) if triple else None
        if triple and numbers:
            values[index] = _positive(numbers[0], name, triple.span, notes)
    radius = stated(ontology, iri, "radius")
    numbers = lengths(radius, notes, LARGEST / 2) if radius else None
    if radius and numbers and values[0] is None and values[1] is None:
        diameter = _positive(2 * numbers[0], "radius", radius.span, notes)
        values[0] = values[1] = diameter
    return tuple(values)


def _positive(value: float, name: str, span: Span | None, notes: list[Diagnostic]) -> float:
    if value < 0:
        message = f"{name} is negative: {value} m; the object is a mere place"
        notes.append(unread("M007", message, span))
    return value


def _default(
    ontology: Ontology, types: tuple[str, ...], name: str, notes: list[Diagnostic]
) -> tuple[float | None, str]:
    for cls in types:
        for ancestor in ontology.ancestors(cls):
            for restriction in ontology.restrictions(ancestor):
                if restriction.property == expand(name) and isinstance(restriction.filler, Literal):
                    value = _number_of(restriction)
                    if value is not None:
                        return value, f"default of {local_name(ancestor)}"
                    message = f"{name} of {local_name(ancestor)} is left out: not a size: {restriction.filler.value!r}"
                    notes.append(unread("M002", message, restriction.span))
    return None, ""


def _number_of(restriction: Restriction) -> float | None:
    """Read the extent that a restriction states [m]; None if it is not a valid one."""
    try:
        unit_name = unit_of_property(local_name(restriction.property))
        value = stated_number(restriction.filler, unit_name) if isinstance(restriction.filler, Literal) else math.nan
    except ValueError:
        return None
    return value if 0 <= value <= LARGEST else None
