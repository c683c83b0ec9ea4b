"""Numbers that files state: lengths and poses, converted to SI units and checked; rotations are made rigid.

A number of a shape or a pose that cannot be read is an error: see :func:`planlang.diagnostics.unread`. Others are
ignored, with a warning that points into the file.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note, unread, warning
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import orthonormal, product
from planlang.ontology import Literal, Ontology, Triple
from planlang.units import IncompatibleUnits, conversion, unit, unit_of, unit_of_property

EXTENTS = ("depthOfObject", "widthOfObject", "heightOfObject")
"""Properties for the extents along x, y, z."""

TRIPLES = ("boundingBoxSize", "dimensionsOfObject", "dimensions")
"""Properties whose one literal states all three extents."""

_ROTATION = tuple(f"m{i}{j}" for i in range(3) for j in range(3))
_TRANSLATION = ("m03", "m13", "m23")
SHAPING = frozenset({*EXTENTS, *TRIPLES, *_ROTATION, *_TRANSLATION, "radius", "translation", "quaternion", "heading"})
SHAPING |= {"wallThickness", "boardHeights", "jointPosition"}
"""Properties whose numbers are those of a shape or a pose."""


def stated(ontology: Ontology, subject: str, prop: str) -> Triple | None:
    """Find the last statement of a property of a subject, which replaces earlier ones; None if there is none."""
    return ontology.last(subject, prop)


FARTHEST = 1e7
"""Greatest coordinate in a map [m]: surveying grids count up to the distance from the equator to a pole."""
LARGEST = 1e4
"""Greatest extent of an object [m]."""


def length(triple: Triple, notes: list[Diagnostic]) -> float | None:
    """Read the number that a triple states, in the unit of its property; None with a warning if it is not one."""
    values = lengths(triple, notes)
    if values is None:
        return None
    if len(values) != 1:
        notes.append(unreadable(triple, f"expected one number, found {len(values)}: {_text(triple)!r}"))
        return None
    return values[0]


def lengths(triple: Triple, notes: list[Diagnostic], most: float = FARTHEST) -> tuple[float, ...] | None:
    """Read the numbers of a literal such as "0.4 0.8 1.2", in the unit of its property.

    None, with a warning, if a word is not a number, a number exceeds ``most``, or their unit does not fit the property.
    """
    text = _text(triple)
    try:
        if "_" in text:  # float() accepts 1_000
            raise ValueError
        numbers = tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        notes.append(unreadable(triple, f"not a number: {text!r}"))
        return None
    if not all(math.isfinite(number) for number in numbers):
        notes.append(unreadable(triple, f"not a finite number: {text!r}"))
        return None
    converted = _converted(triple, numbers, notes)
    if converted is not None and any(abs(number) > most for number in converted):
        notes.append(unreadable(triple, f"{text} is more than {most:,.0f} m"))
        return None
    return converted


def _converted(triple: Triple, numbers: tuple[float, ...], notes: list[Diagnostic]) -> tuple[float, ...] | None:
    """Convert numbers to the unit of the property; None with a warning if their own unit does not fit."""
    if not isinstance(triple.object, Literal) or (name := unit_of(triple.object)) is None:
        return numbers
    prop = local_name(triple.predicate)
    if unit(name) is None:
        message = f"{prop} is in the unknown unit {name}; the unit is ignored"
        notes.append(_problem("M030", message, triple, "use a unit of QUDT, such as Meter"))
        return numbers
    try:
        converted = conversion(triple.object, unit_of_property(prop))
        return numbers if converted is None else tuple(converted(number) for number in numbers)
    except IncompatibleUnits as wrong:
        notes.append(_problem("M030", f"{prop} is left out: {wrong}", triple))
    except ValueError as wrong:
        notes.append(unreadable(triple, str(wrong)))
    return None


def unreadable(triple: Triple, problem: str) -> Diagnostic:
    """Make the diagnostic of a statement that is left out, and why."""
    name = local_name(triple.subject) if isinstance(triple.subject, str) else "something"
    return _problem("M002", f"{local_name(triple.predicate)} of {name} is left out: {problem}", triple)


def _problem(code: str, message: str, triple: Triple, help: str | None = None) -> Diagnostic:
    """Make an error if a number belongs to a shape or a pose, else a warning: without it, the world has the object."""
    make = unread if local_name(triple.predicate) in SHAPING else warning
    return make(code, message, triple.span, help)


def _text(triple: Triple) -> str:
    return triple.object.value if isinstance(triple.object, Literal) else str(triple.object)


TOLERANCE = 1e-3
"""Greatest deviation of R^T R from the identity without a note."""

FLAT = 0.1
"""Least determinant of a usable matrix, relative to its scale cubed: one of its axes has a twentieth of the length."""

POSE = 'a pose needs m00..m22 and m03, m13, m23, or translation "x y z" and a heading or quaternion "x y z w"'
"""Advice for an incomplete pose."""


def read_transform(ontology: Ontology, iri: str, notes: list[Diagnostic]) -> Array | None:
    """Read the homogeneous matrix (4, 4) that an individual states, made rigid; lengths in metres.

    Understands RotationMatrix3D with m00..m23 (the last row is not needed), and ``translation "x y z"`` with
    ``heading`` (degrees about the z axis) or ``quaternion "x y z w"``. None, with a warning in ``notes``, if numbers
    are missing or not finite.
    """
    if stated(ontology, iri, "m00") or stated(ontology, iri, "m03"):
        return _from_entries(ontology, iri, notes)
    return _from_quaternion(ontology, iri, notes)


def _from_entries(ontology: Ontology, iri: str, notes: list[Diagnostic]) -> Array | None:
    matrix = np.eye(4)
    missing = []
    complete = True
    for name in (*_ROTATION, *_TRANSLATION):
        triple = stated(ontology, iri, name)
        if triple is None:
            missing.append(name)
            continue
        value = length(triple, notes)
        if value is None:
            complete = False
        else:
            matrix[int(name[1]), int(name[2])] = value
    if missing:
        message = f"the matrix {local_name(iri)} has no {', '.join(missing)}"
        notes.append(unread("M003", message, ontology.span(iri), POSE))
    if missing or not complete:
        return None
    matrix[:3, :3] = rigid(matrix[:3, :3], local_name(iri), ontology.span(iri), notes)
    return matrix


def _from_quaternion(ontology: Ontology, iri: str, notes: list[Diagnostic]) -> Array | None:
    values: dict[str, tuple[float, ...]] = {"quaternion": (0.0, 0.0, 0.0, 1.0)}
    heading = stated(ontology, iri, "heading")
    if heading is not None and not stated(ontology, iri, "quaternion"):
        half = math.radians(length(heading, notes) or 0.0) / 2
        values["quaternion"] = (0.0, 0.0, math.sin(half), math.cos(half))
    for name, count in (("translation", 3), ("quaternion", 4)):
        triple = stated(ontology, iri, name)
        if triple is None and name in values:
            continue  # not turned, which is the documented default
        numbers = lengths(triple, notes) if triple else None
        if triple and numbers is None:
            return None
        if triple is None or numbers is None or len(numbers) != count:
            message = f"the pose {local_name(iri)} states neither a matrix nor a {name} of {count} numbers"
            span = triple.span if triple else ontology.span(iri)
            notes.append(unread("M003", message, span, POSE))
            return None
        values[name] = numbers
    norm = float(np.linalg.norm(values["quaternion"]))
    if norm < 1e-6:
        notes.append(unread("M004", f"the quaternion of {local_name(iri)} is zero; not rotated", ontology.span(iri)))
        quaternion = (0.0, 0.0, 0.0, 1.0)
    else:
        x, y, z, w = (value / norm for value in values["quaternion"])
        quaternion = (x, y, z, w)
    px, py, pz = values["translation"]
    return Pose((px, py, pz), quaternion).matrix()


@lru_cache(maxsize=1024)
def _orthonormal(entries: bytes) -> Array:
    """Compute the nearest orthonormal matrix (3, 3) of one given by its bytes: most things of a map are not turned."""
    return orthonormal(np.frombuffer(entries).reshape(3, 3))


def rigid(rotation: Array, name: str, span: Span | None, notes: list[Diagnostic]) -> Array:
    """Repair a matrix (3, 3) to a rotation, with a diagnostic for each repair.

    A reflection keeps its x axis (the front of an object) and its z axis, and y is reversed: a box looks the same.
    A matrix that is not orthonormal becomes the nearest rotation (polar decomposition), a singular one the identity.
    """
    volume = float(np.sum(np.cross(rotation[0], rotation[1]) * rotation[2]))
    extent = float(np.sqrt(np.sum(rotation * rotation) / 3))
    if abs(volume) <= FLAT * extent**3:
        notes.append(unread("M004", f"the matrix {name} is singular; not rotated", span))
        return np.eye(3)
    if np.abs(product(rotation.T, rotation) - np.eye(3)).max() > TOLERANCE:
        notes.append(note("M001", f"the matrix {name} is not orthonormal; the nearest rotation is used", span))
    nearest = _orthonormal(rotation.tobytes()).copy()
    if volume < 0:
        notes.append(note("M001", f"the matrix {name} is a reflection; its y axis is reversed", span))
        nearest[:, 1] *= -1.0
    return nearest
