"""Semantic maps: objects with their classes, poses, sizes and parts, read from an ontology."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field, replace
from datetime import datetime
from typing import NamedTuple

import numpy as np

from executive.maps.classes import MapObject, is_kind, misspellings, parts_of_classes, with_known_classes
from executive.maps.measures import read_boards, read_size
from executive.maps.soma import COMPONENTS, in_known_words
from planlang.designators import Object, is_called, local_name, names_of, unused_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, settled, unread
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product
from planlang.knowledge.places import inverted
from planlang.measures import EXTENTS, TRIPLES, length, read_transform, stated
from planlang.ontology import Literal, Ontology, expand
from planlang.ontology.terms import OWL
from planlang.records import dataclass
from planlang.words import Text, calling


@dataclass(frozen=True, slots=True)
class SemanticMap:
    """The objects of a map in document order, and diagnostics about repairs and assumptions made while reading it."""

    iri: str | None
    ontology: Ontology
    objects: tuple[MapObject, ...]
    diagnostics: tuple[Diagnostic, ...]
    ignores_unread: bool = False
    """True if the world may lack what cannot be read: see :func:`planlang.diagnostics.unread`."""
    recipes: tuple[Ontology, ...] = ()
    """Ontologies of which classes and effects count, too, in a run."""
    _known: Mapping[str, MapObject] = field(init=False, repr=False, compare=False)
    _holders: Mapping[str, MapObject] = field(init=False, repr=False, compare=False)
    _carriers: frozenset[str] = field(init=False, repr=False, compare=False)
    _kinds: dict[tuple[tuple[str, ...], tuple[str, ...]], bool] = field(init=False, repr=False, compare=False)
    """Whether classes are below others: of thousands of things, few have different ones."""

    def __post_init__(self) -> None:
        backwards = self.objects[::-1]  # so that the first of several objects wins
        known = {name: thing for thing in backwards for name in names_of(thing.iri)}
        known |= {thing.name: thing for thing in backwards} | {thing.iri: thing for thing in backwards}
        others = [
            (name, known[iri])
            for other, iri in self.ontology.same.items()
            if iri in known
            for name in (other, local_name(other), *names_of(other))
        ]
        known = dict(others) | known
        object.__setattr__(self, "_known", known)
        object.__setattr__(self, "_kinds", {})
        object.__setattr__(self, "_holders", {part: thing for thing in backwards for part in thing.parts})
        hinges = (iri for thing in self.objects if thing.pose and thing.size for iri in thing.hinged_to)
        object.__setattr__(self, "_carriers", frozenset(hinges))

    @property
    def declaring(self) -> tuple[Ontology, ...]:
        """Ontologies that declare classes and effects: the map's first."""
        return (self.ontology, *self.recipes)

    @property
    def has_files(self) -> bool:
        """True if the map refers to sensor data: an occupancy grid, a point cloud or an octree."""
        return any(True for _ in self.ontology.using("linkToMapFile"))

    def find(self, name: str) -> MapObject | None:
        """Find an object by IRI or by name."""
        return self._known.get(name)

    def is_a(self, thing: MapObject, *classes: str) -> bool:
        """Check whether an object is of one of these classes."""
        key = thing.types, classes
        if key not in self._kinds:
            self._kinds[key] = self.ontology.any_is_a(*key)
        return self._kinds[key]

    def has_leaves(self, thing: MapObject) -> bool:
        """Check whether an object has parts with a body of their own, or something hangs on it."""
        parts = (self.find(iri) for iri in thing.parts)
        return thing.iri in self._carriers or any(one is not None and one.pose and one.size for one in parts)

    def holder(self, thing: MapObject) -> MapObject | None:
        """Find the object that another is a part of; None if the map states none."""
        return self._holders.get(thing.iri)


def namespace_of(map_iri: str | None) -> str:
    """Make the namespace of what is added to a map."""
    return f"{(map_iri or 'http://planlang.org/kb/map.owl').rstrip('#')}#"


def read_map(ontology: Ontology, *, ignore_unread: bool = False) -> SemanticMap:
    """Read the map that an ontology states.

    Objects are individuals that a perception places, or that state a pose, a size, parts, a hinge, a room number or
    ``describedInMap``. Their pose is that of the latest perception (by ``startTime``, then by position in the file),
    composed with the poses that it is relative to; without a perception, the pose that they state themselves
    (``orientation``, ``pose``, ``translation``).
    Raises BadInput with all diagnostics if a pose or a size that the map states cannot be read (with ``ignore_unread``
    that is a warning, and the object lacks it), or if no object has a pose and the map refers to no sensor data. Other
    numbers that cannot be read are left out, with a warning.
    """
    notes: list[Diagnostic] = [*ontology.unread, *_unnamed_poses(ontology), *misspellings(ontology)]
    ontology = in_known_words(ontology, notes)
    things = _things(ontology)
    ontology = with_known_classes(ontology, things, notes)
    poses = PosesOfThings(ontology, notes)
    names: set[str] = set()
    objects = []
    parts = _parts_by_whole(ontology)
    for iri in things:
        names.add(name := unused_name(local_name(iri), names))
        types = ontology.types(iri)
        has_cap = ontology.any_is_a(ontology.iris(iri, "properPhysicalParts"), ("BottleCap",))
        vessels = (expand("Bottle"),) if has_cap else ()  # whatever its content
        size = read_size(ontology, iri, (*vessels, *types), notes)
        objects.append(
            MapObject(
                iri,
                name,
                (*types, *vessels),
                poses.pose(iri),
                size,
                parts=tuple(dict.fromkeys((*ontology.iris(iri, "properPhysicalParts"), *parts.get(iri, ())))),
                hinged_to=ontology.iris(iri, "hingedTo"),
                inside=ontology.iris(iri, "in-ContGeneric"),
                on=ontology.iris(iri, "on-Physical"),
                open_sides=_open_sides(ontology, iri, types),
                boards=read_boards(ontology, iri, types, size, notes),
                walls=_wall(ontology, iri, notes),
                span=ontology.span(iri),
            )
        )
    objects = _with_places_reversed(objects, ontology, notes)
    if any(ontology.triples(None, OWL.onProperty, expand("orientation"))):
        objects = parts_of_classes(objects, ontology, notes)
    for triple in ontology.using(*COMPONENTS, "areaOfObject"):
        length(triple, notes)  # numbers of features are used later, when a motion is grounded, and reported here
    notes += _other_frames(ontology, poses)
    diagnostics = settled(notes, ignore_unread=ignore_unread)
    semantic_map = SemanticMap(ontology.iri, ontology, tuple(objects), tuple(diagnostics), ignore_unread)
    if not any(thing.pose for thing in objects) and not semantic_map.has_files:
        document = ontology.documents[0] if ontology.documents else None
        span = Span(str(document.path)) if document else None
        help = "place objects by a SemanticMapPerception with objectActedOn and eventOccursAt"
        raise BadInput([*diagnostics, error("M009", "not a map: nothing in this file has a pose", span, help)])
    return semantic_map


def namesakes(ontology: Ontology, things: Iterable[MapObject], what: Object) -> list[MapObject]:
    """List the things that the individual of a designator may be; empty if it names none.

    It is the thing of its IRI; else those of its class that have its local name, then those that have it in other case
    or with other separators, then those that are labelled so.
    """
    if what.iri is None:
        return []
    every = list(things)
    if same := [thing for thing in every if thing.iri == what.iri]:
        return same
    written = local_name(what.iri)
    ways: tuple[Callable[[MapObject], bool], ...] = (
        lambda thing: is_called(thing.iri, written),
        lambda thing: _folded(local_name(thing.iri)) == _folded(written),
        lambda thing: _folded(ontology.label(thing.iri) or "") == _folded(written),
    )
    for is_named in ways:
        named = [thing for thing in every if is_named(thing)]
        if fitting := [one for one in named if any(is_kind(ontology, cls, what.type) for cls in one.types)]:
            return fitting
    return []


def _folded(name: str) -> str:
    return "".join(filter(str.isalnum, name.casefold()))


POSES = ("orientation", "pose", "eventOccursAt")
"""Properties whose fillers are poses, which have names (IRIs)."""


def _unnamed_poses(ontology: Ontology) -> Iterator[Diagnostic]:
    """Yield an error for each pose that is stated without a name."""
    for triple in ontology.using(*POSES):
        if not isinstance(triple.object, str) and isinstance(triple.subject, str):
            shown = f"the text {triple.object.value[:60]!r}" if isinstance(triple.object, Literal) else "without a name"
            message = f"{local_name(triple.predicate)} of {local_name(triple.subject)} is {shown}, which is not read"
            yield unread("M033", message, triple.span, "the filler must be an individual that states a pose")


def _other_frames(ontology: Ontology, poses: PosesOfThings) -> Iterator[Diagnostic]:
    """Yield an error for each map that is relative to something of another file: all files must share one frame."""
    for iri in ontology.individuals(expand("SemanticEnvironmentMap")):
        span = ontology.span(iri)
        for parent in ontology.values(poses.place_of(iri) or "", expand("relativeTo")):
            other = ontology.span(str(parent))
            if span is not None and other is not None and span.file != other.file:
                message = f"the frame of {local_name(iri)} is relative to {local_name(str(parent))}: this is ignored"
                yield unread("M027", message, span, Text("make one map of both: ", calling("merge")))


def _with_places_reversed(objects: list[MapObject], ontology: Ontology, notes: list[Diagnostic]) -> list[MapObject]:
    """Reverse parts of places (rooms, floors, buildings) where a file makes the larger one a part of the smaller."""
    parts = {part for thing in objects for part in thing.parts}
    if not any(thing.parts and ontology.is_a(thing.iri, "RoomInAConstruction") for thing in objects) and not (
        ontology.any_is_a(parts, ("City",))
    ):
        return objects
    things, parts_of = {thing.iri: thing for thing in objects}, dict[str, dict[str, None]]()
    for triple in inverted(ontology):
        smaller, larger = str(triple.subject), str(triple.object)
        message = f"{local_name(larger)} is stated as a part of {local_name(smaller)}, which is smaller: reversed"
        notes.append(note("M021", message, triple.span))
        for iri in (smaller, larger):
            if iri in things:
                parts_of.setdefault(iri, dict.fromkeys(things[iri].parts))
        parts_of.get(smaller, {}).pop(larger, None)
        parts_of.get(larger, {})[smaller] = None
    return [replace(thing, parts=tuple(parts_of.get(thing.iri, thing.parts))) for thing in objects]


OPENINGS = ("Doorway", "Portal")
"""Classes of openings in walls, which are not bodies."""

IN_HAND = "srdl2-comp:predecessorInKinematicChain"
"""Property from an object to the robot link that holds it when a run begins."""
"""Properties from a direction of a feature to its components."""
FEATURES = frozenset({"Cone", "FlatPhysicalSurface", "Sphere"})
"""Classes of parts that are features of an object model rather than objects."""
_MARKS = (
    *("describedInMap", "hingedTo", "properPhysicalParts", "roomNumber", "in-ContGeneric", IN_HAND),
    *(*EXTENTS, *TRIPLES),
)
"""Properties whose subjects are objects of the map."""


def _things(ontology: Ontology) -> tuple[str, ...]:
    """List the IRIs of the objects of the map, in document order."""
    things: dict[str, None] = {}
    others = {iri for name in ("UrdfLink", "UrdfJoint") for iri in ontology.individuals(expand(name))}
    for event in _perceptions(ontology):
        things.update(dict.fromkeys(ontology.iris(event, "objectActedOn")))
    for name in _MARKS:
        for triple in ontology.triples(None, expand(name)):
            if isinstance(triple.subject, str):
                things[triple.subject] = None
    for name in ("orientation", "pose"):
        for triple in ontology.triples(None, expand(name)):
            if isinstance(triple.subject, str) and isinstance(triple.object, str):
                things[triple.subject] = None
    for triple in ontology.triples(None, expand("translation")):
        if isinstance(triple.subject, str) and ontology.is_a(triple.subject, expand("EnduringThing-Localized")):
            things[triple.subject] = None
    order = {iri: rank for rank, iri in enumerate(_typed(ontology))}
    objects = {iri for iri in things if iri in order and iri not in others and not _is_feature(ontology, iri)}
    maps = {iri for iri in objects if ontology.is_a(iri, expand("Map"))}
    poses = PosesOfThings(ontology, []) if maps else None
    frames = {iri for iri in maps if poses and any(ontology.values(poses.place_of(iri) or "", expand("relativeTo")))}
    return tuple(sorted(objects - frames, key=order.__getitem__))  # the pose of a map only states its frame


WHOLES = ("physicalPartOf", "properPhysicalPartOf", "partOf")
"""Properties from a part to its whole."""


def _parts_by_whole(ontology: Ontology) -> dict[str, list[str]]:
    """Collect the parts that state what they are a part of, by the IRI of the whole."""
    parts: dict[str, list[str]] = {}
    for triple in ontology.using(*WHOLES):
        if isinstance(triple.subject, str) and isinstance(triple.object, str):
            parts.setdefault(triple.object, []).append(triple.subject)
    return parts


def _is_feature(ontology: Ontology, iri: str) -> bool:
    """Check whether an individual is a feature of an object model: by class, or placed in its whole without a size."""
    if any(local_name(cls) in FEATURES for cls in ontology.types(iri)):
        return True
    if any(stated(ontology, iri, name) for name in (*EXTENTS, *TRIPLES)):
        return False
    places = ontology.iris(iri, "orientation")
    wholes = (whole for place in places for whole in ontology.iris(place, "relativeTo"))
    return any(iri in ontology.iris(whole, "properPhysicalParts") for whole in wholes)


def _typed(ontology: Ontology) -> tuple[str, ...]:
    """List the individuals that have a class, in document order."""
    rdf_type = "http://www.w3.org/1999/02/22-rdf-syntax-ns#type"
    subjects = dict.fromkeys(t.subject for t in ontology.triples(None, rdf_type) if isinstance(t.subject, str))
    return tuple(iri for iri in subjects if ontology.is_individual(iri))


def _perceptions(ontology: Ontology) -> Iterator[str]:
    """Yield the events that place an object: those with eventOccursAt, except for proprioception."""
    proprioception = set(ontology.individuals(expand("Proprioception")))
    for triple in ontology.triples(None, expand("eventOccursAt")):
        if isinstance(triple.subject, str) and triple.subject not in proprioception:
            yield triple.subject


def _open_sides(ontology: Ontology, iri: str, types: tuple[str, ...]) -> tuple[str, ...]:
    """Sides that a thing states, else those that its nearest class does."""
    values = ontology.values(iri, expand("openSide"))
    stated = tuple(dict.fromkeys(value.value.strip() for value in values if isinstance(value, Literal)))
    classes = (one for cls in types for one in ontology.inherited_restrictions(cls, expand("openSide")))
    return stated or tuple(one.filler.value for one in classes if isinstance(one.filler, Literal))


def _wall(ontology: Ontology, iri: str, notes: list[Diagnostic]) -> float | None:
    triple = stated(ontology, iri, "wallThickness")
    thickness = None if triple is None else length(triple, notes)
    return thickness if thickness is None or thickness > 0 else None


class Perception(NamedTuple):
    """A perception of an object; ordered by age, the newest is the greatest."""

    time: float
    """Time [s]; minus infinity if none is stated."""
    rank: int
    """Position in the file."""
    place: str
    """IRI of the pose."""
    event: str


DEEPEST = 50
"""Greatest length of a chain of relative poses."""


class PosesOfThings:
    """Poses of objects in the map frame: relative poses are composed, and each pose is read only once."""

    def __init__(self, ontology: Ontology, notes: list[Diagnostic]) -> None:
        self.ontology = ontology
        self.notes = notes
        self.places: dict[str, list[Perception]] = {}
        for rank, event in enumerate(_perceptions(ontology)):
            when = self._time(event)
            for thing in ontology.iris(event, "objectActedOn"):
                for place in ontology.iris(event, "eventOccursAt"):
                    self.places.setdefault(thing, []).append(Perception(when, rank, place, event))
        self.known: dict[str, Array | None] = {}
        self.open: list[str] = []

    def of(self, thing: str) -> Array | None:
        """Pose of an object as a matrix (4, 4) in the map frame; None if it states none, or none can be read."""
        return next((matrix for matrix in map(self._resolve, self._places_of(thing)) if matrix is not None), None)

    def pose(self, thing: str) -> Pose | None:
        """Pose of an object in the map frame; None if it states none, or none can be read."""
        matrix = self.of(thing)
        return None if matrix is None else Pose.from_matrix(matrix)

    def place_of(self, thing: str) -> str | None:
        """IRI of the pose of an object: that of its latest perception, else the one that it states itself."""
        return next(iter(self._places_of(thing)), None)

    def _places_of(self, thing: str) -> list[str]:
        """IRIs of the poses of an object, newest first: an older pose replaces one that cannot be read."""
        own_poses = [*self.ontology.iris(thing, "orientation"), *self.ontology.iris(thing, "pose")]
        if stated(self.ontology, thing, "translation"):
            own_poses.append(thing)
        return [seen.place for seen in sorted(self.places.get(thing, ()), reverse=True)] or own_poses[::-1]

    def newest(self, thing: str) -> Perception | None:
        """Find the latest perception of an object whose pose can be read."""
        seen = sorted(self.places.get(thing, ()), reverse=True)
        return next((one for one in seen if self._resolve(one.place) is not None), None)

    def _resolve(self, place: str) -> Array | None:
        if place in self.known:
            return self.known[place]
        if place in self.open:
            circle = " -> ".join(local_name(iri) for iri in (*self.open[self.open.index(place) :], place))
            help = "state one of them in the map frame, without relativeTo"
            self.notes.append(unread("M008", f"poses relative to each other: {circle}", self._span(place), help))
            return None
        if len(self.open) == DEEPEST:
            message = f"{local_name(self.open[0])} is at the end of a chain of more than {DEEPEST} relative poses"
            self.notes.append(unread("M008", message, self._span(self.open[0]), "state it in the map frame"))
            return None
        self.open.append(place)
        matrix = read_transform(self.ontology, place, self.notes)
        for parent in self.ontology.iris(place, "relativeTo"):
            frame = self._frame(parent, place)
            matrix = None if frame is None or matrix is None else product(frame, matrix)
        self.open.pop()
        self.known[place] = matrix
        return matrix

    def _frame(self, parent: str, place: str) -> Array | None:
        """Matrix (4, 4) of the frame that a pose is relative to: another pose, an object, or the map itself."""
        if self.ontology.is_a(parent, expand("SemanticEnvironmentMap")) or parent == expand("MapFrame"):
            return np.eye(4)
        if self._places_of(parent):
            return self.of(parent)
        if stated(self.ontology, parent, "m03"):
            return self._resolve(parent)
        message = f"{local_name(place)} is relative to {local_name(parent)}, which has no pose in this map"
        self.notes.append(unread("M010", message, self._span(place)))
        return None

    def _span(self, place: str) -> Span | None:
        triple = stated(self.ontology, place, "relativeTo")
        return triple.span if triple else self.ontology.span(place)

    def _time(self, event: str) -> float:
        """Read the startTime of a perception [s]; minus infinity, with a note, if it cannot be read."""
        triple = stated(self.ontology, event, "startTime")
        if triple is None:
            return float("-inf")
        text = triple.object.value if isinstance(triple.object, Literal) else str(triple.object)
        seconds = seconds_of(text)
        if seconds is None:
            message = f"cannot read a time from {local_name(text)!r}; this perception counts as the oldest"
            self.notes.append(note("M011", message, triple.span))
            return float("-inf")
        return seconds


_DATE = re.compile(r"(?<!\d)(\d{4}-\d\d-\d\d)(?:[T ](\d\d:\d\d(?::\d\d(?:\.\d+)?)?))?(Z|[+-]\d\d:?\d\d)?$")
_DATED = re.compile(r"(?:(?<!\d)\d{4}(?:-[\dW]|[/_]\d\d[/_]\d\d(?!\d))|\d\d:\d\d|\d{8}T)[^#/]*$")
"""Text with a date or a time of day: its last digits are not seconds since 1970."""
_SECONDS = re.compile(r"(?<![\d.])\d{1,15}(?:\.\d{1,15})?$")
_LONGEST = 64
"""Greatest number of characters, at the end of a text, that are searched for a time."""


def seconds_of(time: str) -> float | None:
    """Read the time at the end of a text or of a time point's name, in seconds since 1970.

    It is a number of seconds, or an ISO 8601 date, in UTC unless it has an offset; a date without a time of day means
    midnight. None if there is no time, or a date that is incomplete.
    """
    time = time[-_LONGEST:]
    if (date := _DATE.search(time)) is not None:
        day, clock, zone = date.groups()
        try:
            return datetime.fromisoformat(f"{day}T{clock or '00:00'}{zone or 'Z'}").timestamp()
        except ValueError:
            return None
    number = None if _DATED.search(time) else _SECONDS.search(time)
    return None if number is None else float(number[0])
