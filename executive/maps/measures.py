"""The numbers that maps state: sizes and poses, in SI units, finite, rigid; each with its place in the file.

One that cannot be read costs what it says, with a warning, and nothing else of the map.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note, warning
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import orthonormal, product
from planlang.ontology import Literal, Ontology, Restriction, Triple, expand
from planlang.units import IncompatibleUnits, conversion, stated_number, unit, unit_of, unit_of_property


def stated(ontology: Ontology, subject: str, prop: str) -> Triple | None:
    """Return the last statement of a property about a subject, which replaces earlier ones; None if there is none."""
    found = tuple(ontology.triples(subject, expand(prop)))
    return found[-1] if found else None


FARTHEST = 1e7
"""Greatest number in a map [m]: the distance from a pole to the equator, by which surveyed maps count."""
LARGEST = 1e4
"""Greatest extent of a thing [m]."""


def length(triple: Triple, found: list[Diagnostic]) -> float | None:
    """Return the number a triple states, in the unit of its property; None with a warning if it is none."""
    values = lengths(triple, found)
    if values is None:
        return None
    if len(values) != 1:
        found.append(_unreadable(triple, f"one number is expected, {_text(triple)!r} is {len(values)}"))
        return None
    return values[0]


def lengths(triple: Triple, found: list[Diagnostic], most: float = FARTHEST) -> tuple[float, ...] | None:
    """Return the numbers of a literal such as "0.4 0.8 1.2", in the unit of its property.

    None, with a warning, if one is none or more than ``most``, or if their own unit does not fit the property.
    """
    text = _text(triple)
    try:
        if "_" in text:  # Python would read 1_000
            raise ValueError
        numbers = tuple(float(word) for word in text.replace(",", " ").split())
    except ValueError:
        found.append(_unreadable(triple, f"not a number: {text!r}"))
        return None
    if not all(math.isfinite(number) for number in numbers):
        found.append(_unreadable(triple, f"not a finite number: {text!r}"))
        return None
    converted = _converted(triple, numbers, found)
    if converted is not None and any(abs(number) > most for number in converted):
        found.append(_unreadable(triple, f"{text} is more than {most:,.0f} m"))
        return None
    return converted


def _converted(triple: Triple, numbers: tuple[float, ...], found: list[Diagnostic]) -> tuple[float, ...] | None:
    """Return numbers in the unit of the property; None with a warning if their own unit does not fit."""
    if not isinstance(triple.object, Literal) or (name := unit_of(triple.object)) is None:
        return numbers
    prop = local_name(triple.predicate)
    if unit(name) is None:
        message = f"{prop} is in {name}, an unknown unit; the number is read without it"
        found.append(warning("M030", message, triple.span, "use a unit of QUDT, such as Meter"))
        return numbers
    try:
        converted = conversion(triple.object, unit_of_property(prop))
        return numbers if converted is None else tuple(converted(number) for number in numbers)
    except IncompatibleUnits as wrong:
        found.append(warning("M030", f"{prop} is left out: {wrong}", triple.span))
    except ValueError as wrong:
        found.append(_unreadable(triple, str(wrong)))
    return None


def _unreadable(triple: Triple, problem: str) -> Diagnostic:
    name = local_name(triple.subject) if isinstance(triple.subject, str) else "something"
    return warning("M002", f"{local_name(triple.predicate)} of {name} is left out: {problem}", triple.span)


def _text(triple: Triple) -> str:
    return triple.object.value if isinstance(triple.object, Literal) else str(triple.object)


Size = tuple[float, float, float]
"""Extents along the box's own x (depth), y (width) and z (height) [m]."""

EXTENTS = ("depthOfObject", "widthOfObject", "heightOfObject")
"""Properties for the extents along x, y, z."""

TRIPLES = ("boundingBoxSize", "dimensionsOfObject", "dimensions")
"""Properties whose one literal states all three extents."""

THIN = 0.001
"""Extent of a door that has none [m]."""


def read_size(ontology: Ontology, iri: str, types: Iterable[str], found: list[Diagnostic]) -> Size | None:
    """Return the size of an individual; extents that the file does not state are filled in, and noted.

    It is None when an extent is negative, or neither stated nor known for a class: such a thing is a marker.
    """
    extents = stated_size(ontology, iri, found)
    if any(value is not None and value < 0 for value in extents):
        return None
    if all(extents):
        x, y, z = (value or 0.0 for value in extents)
        return (x, y, z)
    types = tuple(types)
    size, origins = [], []
    for name, value in zip(EXTENTS, extents, strict=True):
        filled, origin = (value, "") if value else _default(ontology, types, name, any(extents), found)
        size.append(filled)
        origins.append(f"{name} {filled} m ({origin})" if origin else "")
    span = ontology.span(iri)
    if None in size:
        if any(value is not None for value in extents):
            missing = ", ".join(name for name, value in zip(EXTENTS, size, strict=True) if value is None)
            found.append(note("M006", f"{local_name(iri)} has no {missing} and no class that knows one: a place", span))
        return None
    found.append(note("M005", f"{local_name(iri)}: {', '.join(filter(None, origins))}", span))
    x, y, z = (value or 0.0 for value in size)
    return (x, y, z)


def read_boards(
    ontology: Ontology, iri: str, types: Iterable[str], size: Size | None, found: list[Diagnostic]
) -> tuple[float, ...]:
    """Heights of the boards of a shelf above its lower end [m], the lowest first; none for what has no boards.

    Those that the thing states, else those of its nearest class, of which the ones within its height are noted.
    """
    if size is None:
        return ()
    own = stated(ontology, iri, "boardHeights")
    of_class = (one for cls in types for one in ontology.inherited_restrictions(cls, expand("boardHeights")))
    default = None if own else next(of_class, None)
    said = Triple(iri, expand("boardHeights"), default.filler, default.span) if default else own
    heights = sorted(lengths(said, found, LARGEST) or ()) if said else []
    boards = tuple(height for height in heights if 0 <= height < size[2])
    if own and len(boards) < len(heights):
        found.append(_unreadable(own, f"a shelf {size[2]} m high has boards from 0 m to there"))
        return ()
    if default and boards:
        shown = ", ".join(f"{height} m" for height in boards)
        found.append(note("M005", f"{local_name(iri)}: boards at {shown} (default of its class)", ontology.span(iri)))
    return boards


def stated_size(ontology: Ontology, iri: str, found: list[Diagnostic]) -> tuple[float | None, ...]:
    """Return the three extents that a file states, None for each that it does not."""
    values: list[float | None] = [None, None, None]
    for name in TRIPLES:
        triple = stated(ontology, iri, name)
        numbers = lengths(triple, found, LARGEST) if triple else None
        if triple and numbers and len(numbers) == 3:
            values = [_positive(number, name, triple.span, found) for number in numbers]
    for index, name in enumerate(EXTENTS):
        triple = stated(ontology, iri, name)
        numbers = lengths(triple, found, LARGEST) if triple else None
        if triple and numbers:
            values[index] = _positive(numbers[0], name, triple.span, found)
    radius = stated(ontology, iri, "radius")
    numbers = lengths(radius, found, LARGEST / 2) if radius else None
    if radius and numbers and values[0] is None and values[1] is None:
        diameter = _positive(2 * numbers[0], "radius", radius.span, found)
        values[0] = values[1] = diameter
    return tuple(values)


def _positive(value: float, name: str, span: Span | None, found: list[Diagnostic]) -> float:
    if value < 0:
        message = f"{name} is {value} m; a thing cannot be smaller than nothing: it is taken for a mere place"
        found.append(warning("M007", message, span))
    return value


def _default(
    ontology: Ontology, types: tuple[str, ...], name: str, partly: bool, found: list[Diagnostic]
) -> tuple[float | None, str]:
    if partly and ontology.any_is_a(types, ("Door",)):
        return THIN, "doors are thin"
    for cls in types:
        for ancestor in ontology.ancestors(cls):
            for restriction in ontology.restrictions(ancestor):
                if restriction.property == expand(name) and isinstance(restriction.filler, Literal):
                    value = _number_of(restriction)
                    if value is not None:
                        return value, f"default of {local_name(ancestor)}"
                    message = f"{name} of {local_name(ancestor)} is left out: no size is {restriction.filler.value!r}"
                    found.append(warning("M002", message, restriction.span))
    return None, ""


def _number_of(restriction: Restriction) -> float | None:
    """Return the size that a restriction states [m]; None if it is none."""
    try:
        unit_name = unit_of_property(local_name(restriction.property))
        value = stated_number(restriction.filler, unit_name) if isinstance(restriction.filler, Literal) else math.nan
    except ValueError:
        return None
    return value if 0 <= value <= LARGEST else None


TOLERANCE = 1e-3
"""Entries of a rotation may differ by this from an orthonormal matrix before that is worth a note."""

FLAT = 0.1
"""Volume of a matrix's axes, relative to a cube of their mean length, that is no basis: one axis a twentieth."""

POSE = 'a pose needs m00..m22 and m03, m13, m23, or translation "x y z" and a heading or quaternion "x y z w"'
"""What is said of one that lacks something."""

_ROTATION = tuple(f"m{i}{j}" for i in range(3) for j in range(3))
_TRANSLATION = ("m03", "m13", "m23")


def read_transform(ontology: Ontology, iri: str, found: list[Diagnostic]) -> Array | None:
    """Return the homogeneous (4, 4) matrix that an individual states, repaired to a rigid one; lengths in metres.

    Understands RotationMatrix3D with m00..m23 (the last row is not needed), and ``translation "x y z"`` with
    ``heading`` (degrees about the z axis) or ``quaternion "x y z w"``. None, with a warning in ``found``, if numbers
    are missing or not finite.
    """
    if stated(ontology, iri, "m00") or stated(ontology, iri, "m03"):
        return _from_entries(ontology, iri, found)
    return _from_quaternion(ontology, iri, found)


def _from_entries(ontology: Ontology, iri: str, found: list[Diagnostic]) -> Array | None:
    matrix = np.eye(4)
    missing = []
    complete = True
    for name in (*_ROTATION, *_TRANSLATION):
        triple = stated(ontology, iri, name)
        if triple is None:
            missing.append(name)
            continue
        value = length(triple, found)
        if value is None:
            complete = False
        else:
            matrix[int(name[1]), int(name[2])] = value
    if missing:
        message = f"the matrix {local_name(iri)} has no {', '.join(missing)}"
        found.append(warning("M003", message, ontology.span(iri), POSE))
    if missing or not complete:
        return None
    matrix[:3, :3] = rigid(matrix[:3, :3], local_name(iri), ontology.span(iri), found)
    return matrix


def _from_quaternion(ontology: Ontology, iri: str, found: list[Diagnostic]) -> Array | None:
    values: dict[str, tuple[float, ...]] = {"quaternion": (0.0, 0.0, 0.0, 1.0)}
    turned = stated(ontology, iri, "heading")
    if turned is not None and not stated(ontology, iri, "quaternion"):
        heading = length(turned, found)
        half = math.radians(heading or 0.0) / 2
        values["quaternion"] = (0.0, 0.0, math.sin(half), math.cos(half))
    for name, count in (("translation", 3), ("quaternion", 4)):
        triple = stated(ontology, iri, name)
        if triple is None and name in values:
            if turned is not None or ontology.is_a(iri, expand("EnduringThing-Localized")):
                continue  # a thing that states its pose itself is not turned unless it says so
            found.append(note("M004", f"the pose {local_name(iri)} has no quaternion; not turned", ontology.span(iri)))
            continue
        numbers = lengths(triple, found) if triple else None
        if triple and numbers is None:
            return None
        if triple is None or numbers is None or len(numbers) != count:
            message = f"the pose {local_name(iri)} states neither a matrix nor a {name} of {count} numbers"
            span = triple.span if triple else ontology.span(iri)
            found.append(warning("M003", message, span, POSE))
            return None
        values[name] = numbers
    norm = float(np.linalg.norm(values["quaternion"]))
    if norm < 1e-6:
        found.append(warning("M004", f"the quaternion of {local_name(iri)} is zero; not turned", ontology.span(iri)))
        quaternion = (0.0, 0.0, 0.0, 1.0)
    else:
        x, y, z, w = (value / norm for value in values["quaternion"])
        quaternion = (x, y, z, w)
    px, py, pz = values["translation"]
    return Pose((px, py, pz), quaternion).matrix()


def rigid(rotation: Array, name: str, span: Span | None, found: list[Diagnostic]) -> Array:
    """Return the rotation (3, 3) that a matrix means, which may be a reflection or not orthonormal; repairs are noted.

    A reflection keeps its x axis (the front of a thing) and its z axis, y is turned around: a box looks the same.
    Others become the nearest rotation (polar decomposition). One without three directions is replaced by no rotation.
    """
    volume = float(np.sum(np.cross(rotation[0], rotation[1]) * rotation[2]))
    extent = float(np.sqrt(np.sum(rotation * rotation) / 3))
    if abs(volume) <= FLAT * extent**3:
        found.append(warning("M004", f"the matrix {name} has no three directions; taken as not turned", span))
        return np.eye(3)
    if np.abs(product(rotation.T, rotation) - np.eye(3)).max() > TOLERANCE:
        found.append(note("M001", f"the matrix {name} is not orthonormal; the nearest rotation is used", span))
    nearest = orthonormal(rotation)
    if volume < 0:
        found.append(note("M001", f"the matrix {name} is a reflection; its y axis is turned around", span))
        nearest[:, 1] *= -1.0
    return nearest
