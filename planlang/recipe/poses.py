"""Poses that recipes state by their numbers."""

from __future__ import annotations

import math

from planlang.ontology import Literal, Ontology, expand
from planlang.units import stated_number, unit_of_property

UPRIGHT = 1e-3
"""The distance of the last number of a matrix from 1 up to which its z axis points up."""


def stated_pose(ontology: Ontology, iri: str) -> tuple[float, float, float, float] | None:
    """Return x, y, z [m] and heading [rad] of a matrix in the frame of the map; None if a number is missing.

    The z axis of the pose has to point up, as that of a base does.
    """
    numbers = {name: _number(ontology, iri, name) for name in ("m03", "m13", "m23", "m00", "m10", "m22")}
    x, y, z, cosine, sine, up = (numbers[name] for name in numbers)
    if None in (x, y, z, cosine, sine, up) or abs((up or 0.0) - 1) > UPRIGHT:
        return None
    return x or 0.0, y or 0.0, z or 0.0, math.atan2(sine or 0.0, cosine or 0.0)


def _number(ontology: Ontology, iri: str, name: str) -> float | None:
    """Return the number that an individual states last by a property; None if there is none, or it is not finite."""
    try:
        values = [one for one in ontology.values(iri, expand(name)) if isinstance(one, Literal)]
        return stated_number(values[-1], unit_of_property(name)) if values else None
    except ValueError:
        return None
