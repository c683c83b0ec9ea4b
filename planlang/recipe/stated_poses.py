"""Poses that recipes state in numbers, of a matrix or in the short form of maps: where a base is to drive."""

from __future__ import annotations

import math

from planlang.ontology import Literal, Ontology, expand
from planlang.units import stated_number, unit_of_property

UPRIGHT = 1e-3
"""Tolerance of m22 around 1: a matrix within it has its z axis pointing up."""


def stated_pose(ontology: Ontology, iri: str) -> tuple[float, float, float, float] | None:
    """Pose in the map frame, of a matrix or in short form: x, y, z [m] and heading [rad]; None if a number is missing.

    The z axis has to point up, as that of a base does. The short form is that of maps: ``translation "x y z"``, with
    ``heading`` [degrees] or ``quaternion "x y z w"``.
    """
    if ontology.values(iri, expand("translation")):
        return _short_pose(ontology, iri)
    numbers = {name: _number(ontology, iri, name) for name in ("m03", "m13", "m23", "m00", "m10", "m22")}
    x, y, z, cosine, sine, up = (numbers[name] for name in numbers)
    if None in (x, y, z, cosine, sine, up) or abs((up or 0.0) - 1) > UPRIGHT:
        return None
    return x or 0.0, y or 0.0, z or 0.0, math.atan2(sine or 0.0, cosine or 0.0)


def _short_pose(ontology: Ontology, iri: str) -> tuple[float, float, float, float] | None:
    place, turned = (_numbers(ontology, iri, name) for name in ("translation", "quaternion"))
    if place is None or len(place) != 3:
        return None
    if turned is None:
        return *place, math.radians(_number(ontology, iri, "heading") or 0.0)
    norm = math.hypot(*turned)
    if len(turned) != 4 or norm < UPRIGHT:
        return None
    x, y, z, w = (one / norm for one in turned)
    return None if 2 * (x * x + y * y) > UPRIGHT else (*place, 2 * math.atan2(z, w))


def _numbers(ontology: Ontology, iri: str, name: str) -> tuple[float, ...] | None:
    """Numbers that an individual states for a property in one text; None if there are none, or not finite ones."""
    texts = [one.value for one in ontology.values(iri, expand(name)) if isinstance(one, Literal)]
    try:
        numbers = tuple(map(float, texts[-1].split())) if texts else ()
    except ValueError:
        return None
    return numbers if numbers and all(map(math.isfinite, numbers)) else None


def _number(ontology: Ontology, iri: str, name: str) -> float | None:
    """Last number that an individual states for a property; None if there is none, or it is not finite."""
    try:
        values = [one for one in ontology.values(iri, expand(name)) if isinstance(one, Literal)]
        return stated_number(values[-1], unit_of_property(name)) if values else None
    except ValueError:
        return None
