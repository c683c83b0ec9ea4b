"""Semantic maps: things with their classes, poses, sizes and parts, read from an ontology; the bundled ones.

The numbers, sizes and poses that a map states are finite, in metres, poses rigid, each with its place in the file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, has_errors, note, warning
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import orthonormal, product
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
    """Return the last statement of a property about a subject, which replaces earlier ones; None if there is none."""
    found = tuple(ontology.triples(subject, expand(prop)))
    return found[-1] if found else None


def length(triple: Triple, found: list[Diagnostic]) -> float | None:
    """Return the number a triple states, lengths in metres; None with a diagnostic if it is none or not finite."""
    values = lengths(triple, found)
    if values is None:
        return None
    if len(values) != 1:
        found.append(error("M002", f"one number is expected, {_text(triple)!r} is {len(values)}", triple.span))
        return None
    return values[0]


def lengths(triple: Triple, found: list[Diagnostic]) -> tuple[float, ...] | None:
    """Return the numbers of a literal such as "0.4 0.8 1.2", in metres; None with a diagnostic if one is none."""
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


def stated_size(ontology: Ontology, iri: str, found: list[Diagnostic]) -> tuple[float | None, ...]:
    """Return the three extents that a file states, None for each that it does not."""
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
    return tuple(values)


def _positive(value: float, name: str, span: Span | None, found: list[Diagnostic]) -> float:
    if value < 0:
        message = f"{name} is {value} m; a thing cannot be smaller than nothing: it is taken for a mere place"
        found.append(warning("M007", message, span))
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
                        return float(restriction.filler.number()), f"default of {local_name(ancestor)}"
                    except ValueError as wrong:
                        message = f"{name} of {local_name(ancestor)}: {wrong}"
                        found.append(error("M002", message, restriction.span))
    return None, ""


TOLERANCE = 1e-3
"""Entries of a rotation may differ by this from an orthonormal matrix before that is worth a note."""

FLAT = 0.1
"""Volume of a matrix's axes, relative to a cube of their mean length, that is no basis: one axis a twentieth."""

_ROTATION = tuple(f"m{i}{j}" for i in range(3) for j in range(3))
_TRANSLATION = ("m03", "m13", "m23")


def read_transform(ontology: Ontology, iri: str, found: list[Diagnostic]) -> Array | None:
    """Return the homogeneous (4, 4) matrix that an individual states, repaired to a rigid one; lengths in metres.

    Understands RotationMatrix3D with m00..m23 (the last row is not needed), and ``translation "x y z"`` with
    ``quaternion "x y z w"``. None, with an error in ``found``, if numbers are missing or not finite.
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
        found.append(error("M003", message, ontology.span(iri), "a pose needs m00..m22 and m03, m13, m23"))
    if missing or not complete:
        return None
    matrix[:3, :3] = rigid(matrix[:3, :3], local_name(iri), ontology.span(iri), found)
    return matrix


def _from_quaternion(ontology: Ontology, iri: str, found: list[Diagnostic]) -> Array | None:
    values = {}
    for name, count in (("translation", 3), ("quaternion", 4)):
        triple = stated(ontology, iri, name)
        numbers = lengths(triple, found) if triple else None
        if triple and numbers is None:
            return None
        if triple is None or numbers is None or len(numbers) != count:
            message = f"the pose {local_name(iri)} states neither a matrix nor a {name} of {count} numbers"
            span = triple.span if triple else ontology.span(iri)
            found.append(error("M003", message, span, "a pose needs m00..m22 and m03, m13, m23"))
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


@dataclass(frozen=True, slots=True)
class MapObject:
    """One thing of a map; lists of others are their IRIs."""

    iri: str
    name: str
    """Local name, with ``_2`` etc. when an earlier thing of the map has the same."""
    types: tuple[str, ...]
    pose: Pose | None
    """Pose of the box centre in the map; None for what has no place of its own (a building)."""
    size: Size | None
    """Extents along its own axes [m]; None for a mere place."""
    parts: tuple[str, ...] = ()
    hinged_to: tuple[str, ...] = ()
    inside: tuple[str, ...] = ()
    on: tuple[str, ...] = ()
    open_sides: tuple[str, ...] = ()
    """Sides of its box, such as "+x", at which it is open; if there are any, it is hollow."""
    walls: float | None = None
    """Thickness of its walls [m]."""
    span: Span | None = None


@dataclass(frozen=True, slots=True)
class SemanticMap:
    """The things of a map in document order, and what was repaired or assumed while reading it."""

    iri: str | None
    ontology: Ontology
    objects: tuple[MapObject, ...]
    diagnostics: tuple[Diagnostic, ...]
    _known: Mapping[str, MapObject] = field(init=False, repr=False, compare=False)
    _holders: Mapping[str, MapObject] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        inverse = self.objects[::-1]  # the first of several counts
        known = {thing.name: thing for thing in inverse} | {thing.iri: thing for thing in inverse}
        object.__setattr__(self, "_known", known)
        object.__setattr__(self, "_holders", {part: thing for thing in inverse for part in thing.parts})

    def find(self, name: str) -> MapObject | None:
        """Return the thing with this IRI, or else of this name."""
        return self._known.get(name)

    def holder(self, thing: MapObject) -> MapObject | None:
        """Return what the thing is a proper physical part of, if the map says so."""
        return self._holders.get(thing.iri)


def read_map(ontology: Ontology) -> SemanticMap:
    """Read the map that an ontology states.

    A thing is what a perception places, or what has a size, parts, a hinge, a room or ``describedInMap``. Its pose is
    that of its latest perception (``startTime``, later in the file on a tie), composed with those it is relative to;
    without perception, the matrix that it states itself (``orientation``, ``pose``).
    Raises BadInput with everything found if a number is missing, not finite or negative, or poses depend on themselves.
    """
    found: list[Diagnostic] = []
    things = _things(ontology)
    poses = PosesOfThings(ontology, found)
    names: set[str] = set()
    objects = []
    for iri in things:
        types, vessels = ontology.types(iri), _vessels(ontology, iri)
        size = read_size(ontology, iri, (*vessels, *types), found)
        matrix = poses.of(iri)
        objects.append(
            MapObject(
                iri,
                _unique(local_name(iri), names),
                (*types, *vessels),
                None if matrix is None else Pose.from_matrix(matrix),
                size,
                parts=_individuals(ontology, iri, "properPhysicalParts"),
                hinged_to=_individuals(ontology, iri, "hingedTo"),
                inside=_individuals(ontology, iri, "in-ContGeneric"),
                on=_individuals(ontology, iri, "on-Physical"),
                open_sides=_texts(ontology, iri, "openSide"),
                walls=_wall(ontology, iri, found),
                span=ontology.span(iri),
            )
        )
    if not has_errors(found) and not any(thing.pose for thing in objects):
        document = ontology.documents[0] if ontology.documents else None
        span = Span(str(document.path)) if document else None
        help = "a map says where things are: SemanticMapPerception with objectActedOn and eventOccursAt"
        found.append(error("M009", "nothing in this file has a place: it is no map", span, help))
    if has_errors(found):
        raise BadInput(found)
    return SemanticMap(ontology.iri, ontology, tuple(objects), tuple(found))


IN_HAND = "srdl2-comp:predecessorInKinematicChain"
"""The property of a thing that hangs from a link of a robot: the robot holds it when a run begins."""
FEATURES = frozenset({"Cone", "FlatPhysicalSurface", "Sphere"})
"""Classes of parts that are features of a thing's model, not things of their own."""
_MARKS = (
    *("describedInMap", "hingedTo", "properPhysicalParts", "roomNumber", "in-ContGeneric", IN_HAND),
    *(*EXTENTS, *TRIPLES),
)


def _things(ontology: Ontology) -> tuple[str, ...]:
    """Return the IRIs of the things of the map, in document order of what makes them one."""
    things: dict[str, None] = {}
    links = set(ontology.individuals(expand("UrdfLink"))) | set(ontology.individuals(expand("UrdfJoint")))
    for event in _perceptions(ontology):
        things.update(dict.fromkeys(_individuals(ontology, event, "objectActedOn")))
    for name in _MARKS:
        for triple in ontology.triples(None, expand(name)):
            if isinstance(triple.subject, str):
                things[triple.subject] = None
    for name in ("orientation", "pose"):
        for triple in ontology.triples(None, expand(name)):
            if isinstance(triple.subject, str) and isinstance(triple.object, str):
                things[triple.subject] = None
    order = {iri: rank for rank, iri in enumerate(_typed(ontology))}
    there = (iri for iri in things if iri in order and iri not in links and not _is_feature(ontology, iri))
    return tuple(sorted(there, key=order.__getitem__))


def _vessels(ontology: Ontology, iri: str) -> tuple[str, ...]:
    """Return what a thing is by its parts: a bottle if it has a cap, whatever is in it."""
    parts = _individuals(ontology, iri, "properPhysicalParts")
    return (expand("Bottle"),) if any(ontology.is_a(part, expand("BottleCap")) for part in parts) else ()


def _is_feature(ontology: Ontology, iri: str) -> bool:
    """Return whether an individual is a feature of a model: by its class, or placed in its whole and without a size."""
    if any(local_name(cls) in FEATURES for cls in ontology.types(iri)):
        return True
    if any(stated(ontology, iri, name) for name in (*EXTENTS, *TRIPLES)):
        return False
    places = _individuals(ontology, iri, "orientation")
    wholes = (whole for place in places for whole in _individuals(ontology, place, "relativeTo"))
    return any(iri in _individuals(ontology, whole, "properPhysicalParts") for whole in wholes)


def _typed(ontology: Ontology) -> tuple[str, ...]:
    """Return the individuals that have a class, in document order."""
    rdf_type = "http://www.w3.org/1999/02/22-rdf-syntax-ns#type"
    subjects = dict.fromkeys(t.subject for t in ontology.triples(None, rdf_type) if isinstance(t.subject, str))
    return tuple(iri for iri in subjects if ontology.is_individual(iri))


def _perceptions(ontology: Ontology) -> Iterator[str]:
    """Yield the events that place a thing: those with eventOccursAt, a robot's sense of itself left out."""
    own = set(ontology.individuals(expand("Proprioception")))
    for triple in ontology.triples(None, expand("eventOccursAt")):
        if isinstance(triple.subject, str) and triple.subject not in own:
            yield triple.subject


def _individuals(ontology: Ontology, iri: str, prop: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys(v for v in ontology.values(iri, expand(prop)) if isinstance(v, str)))


def _texts(ontology: Ontology, iri: str, prop: str) -> tuple[str, ...]:
    values = ontology.values(iri, expand(prop))
    return tuple(dict.fromkeys(value.value.strip() for value in values if isinstance(value, Literal)))


def _wall(ontology: Ontology, iri: str, found: list[Diagnostic]) -> float | None:
    triple = stated(ontology, iri, "wallThickness")
    thickness = None if triple is None else length(triple, found)
    return thickness if thickness is None or thickness > 0 else None


def _unique(name: str, names: set[str]) -> str:
    candidate, number = name, 2
    while candidate in names:
        candidate, number = f"{name}_{number}", number + 1
    names.add(candidate)
    return candidate


class PosesOfThings:
    """Poses of things as matrices, each read once, relative ones composed."""

    def __init__(self, ontology: Ontology, found: list[Diagnostic]) -> None:
        self.ontology = ontology
        self.found = found
        self.places: dict[str, list[tuple[float, int, str]]] = {}
        for rank, event in enumerate(_perceptions(ontology)):
            when = self._time(event)
            for thing in _individuals(ontology, event, "objectActedOn"):
                for place in _individuals(ontology, event, "eventOccursAt"):
                    self.places.setdefault(thing, []).append((when, rank, place))
        self.known: dict[str, Array | None] = {}
        self.open: list[str] = []

    def of(self, thing: str) -> Array | None:
        """Return where a thing is, (4, 4) in the map; None if it is nowhere stated."""
        place = self.place_of(thing)
        return None if place is None else self._resolve(place)

    def place_of(self, thing: str) -> str | None:
        """Return the pose of a thing: that of its latest perception, else the one that it states itself."""
        if thing in self.places:
            return max(self.places[thing])[2]
        own = [*_individuals(self.ontology, thing, "orientation"), *_individuals(self.ontology, thing, "pose")]
        return own[-1] if own else None

    def _resolve(self, place: str) -> Array | None:
        if place in self.known:
            return self.known[place]
        if place in self.open:
            circle = " -> ".join(local_name(iri) for iri in (*self.open[self.open.index(place) :], place))
            help = "state one of them in the map frame, without relativeTo"
            self.found.append(error("M008", f"poses relative to each other: {circle}", self._span(place), help))
            return None
        self.open.append(place)
        matrix = read_transform(self.ontology, place, self.found)
        for parent in _individuals(self.ontology, place, "relativeTo"):
            frame = self._frame(parent, place)
            matrix = None if frame is None or matrix is None else product(frame, matrix)
        self.open.pop()
        self.known[place] = matrix
        return matrix

    def _frame(self, parent: str, place: str) -> Array | None:
        """Return the frame that a pose is relative to: another pose, a thing's pose, or the map itself."""
        if self.ontology.is_a(parent, expand("SemanticEnvironmentMap")) or parent == expand("MapFrame"):
            return np.eye(4)
        nested = self.place_of(parent)
        if nested is None and stated(self.ontology, parent, "m03"):
            nested = parent
        if nested is None:
            message = f"{local_name(place)} is relative to {local_name(parent)}, which has no place in this map"
            self.found.append(warning("M010", message, self._span(place)))
            return None
        return self._resolve(nested)

    def _span(self, place: str) -> Span | None:
        triple = stated(self.ontology, place, "relativeTo")
        return triple.span if triple else self.ontology.span(place)

    def _time(self, event: str) -> float:
        """Return the seconds of a perception's startTime: a number, or the number that ends a time point's name."""
        triple = stated(self.ontology, event, "startTime")
        if triple is None:
            return float("-inf")
        text = triple.object.value if isinstance(triple.object, Literal) else str(triple.object)
        number = re.search(r"(\d+(\.\d+)?)$", text)
        if number is None:
            message = f"no time can be read from {local_name(text)!r}; this perception counts as the oldest"
            self.found.append(note("M011", message, triple.span))
            return float("-inf")
        return float(number.group(1))
