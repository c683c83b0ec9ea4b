"""Numbers of an ontology: finite, in metres, with the place in the file where each was stated."""

from __future__ import annotations

import math

from planlang.diagnostics import Diagnostic, error
from planlang.ontology import Literal, Ontology, Triple, expand

METRES: dict[str, float] = {
    "Meter": 1.0,
    "Decimeter": 0.1,
    "Centimeter": 0.01,
    "Millimeter": 0.001,
    "Inch": 0.0254,
    "Foot": 0.3048,
}
"""Local name of a QUDT unit that types a literal -> metres; any other datatype means the number as it is."""


def stated(ontology: Ontology, subject: str, prop: str) -> Triple | None:
    """The last statement of a property about a subject, or None; the later of two in a file replaces the earlier."""
    found = tuple(ontology.triples(subject, expand(prop)))
    return found[-1] if found else None


def length(triple: Triple, found: list[Diagnostic]) -> float | None:
    """The number a triple states, lengths in metres; None with a diagnostic if it is none or not finite."""
    values = lengths(triple, found)
    if values is None:
        return None
    if len(values) != 1:
        found.append(error("M002", f"one number is expected, {_text(triple)!r} is {len(values)}", triple.span))
        return None
    return values[0]


def lengths(triple: Triple, found: list[Diagnostic]) -> tuple[float, ...] | None:
    """The numbers of a literal such as "0.4 0.8 1.2", lengths in metres; None with a diagnostic if one is none."""
    text = _text(triple)
    try:
        if "_" in text:  # Python would read 1_000
            raise ValueError
        numbers = tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        found.append(error("M002", f"not a number: {text!r}", triple.span))
        return None
    if not all(math.isfinite(number) for number in numbers):
        found.append(error("M002", f"not a finite number: {text!r}", triple.span))
        return None
    datatype = triple.object.datatype if isinstance(triple.object, Literal) else None
    factor = METRES.get((datatype or "").rsplit("#", 1)[-1], 1.0)
    return tuple(factor * number for number in numbers)


def _text(triple: Triple) -> str:
    return triple.object.value if isinstance(triple.object, Literal) else str(triple.object)
