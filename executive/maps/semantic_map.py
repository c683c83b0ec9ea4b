"""Semantic maps: things with their classes, poses, sizes and parts, read from an ontology."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import field, replace
from datetime import datetime
from typing import NamedTuple

import numpy as np

from executive.maps.class_names import with_known_classes
from executive.maps.class_parts import Known, parts_of_classes
from executive.maps.measures import EXTENTS, TRIPLES, Size, length, read_boards, read_size, read_transform, stated
from planlang.designators import local_name, unused_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product
from planlang.knowledge.places import inverted
from planlang.ontology import Literal, Ontology, expand
from planlang.ontology.terms import OWL
from planlang.records import dataclass


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
    boards: tuple[float, ...] = ()
    """Heights of its boards, the lowest first: of their tops above its lower end [m]."""
    walls: float | None = None
    """Thickness of its walls and boards [m]."""
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

    @property
    def has_files(self) -> bool:
        """True if a map is stated that is a picture or another file beside the ontology."""
        maps = self.ontology.individuals(expand("Map"))
        return any(True for iri in maps for _ in self.ontology.said(iri, "linkToMapFile"))

    def find(self, name: str) -> MapObject | None:
        """Return the thing with this IRI, or else of this name."""
        return self._known.get(name)

    def is_a(self, thing: MapObject, *classes: str) -> bool:
        """Return True for a thing of one of some classes."""
        return self.ontology.any_is_a(thing.types, classes)

    def holder(self, thing: MapObject) -> MapObject | None:
        """Return what the thing is a proper physical part of, if the map says so."""
        return self._holders.get(thing.iri)


def read_map(ontology: Ontology) -> SemanticMap:
    """Read the map that an ontology states.

    A thing is what a perception places, or what has a size, parts, a hinge, a room or ``describedInMap``. Its pose is
    that of its latest perception (``startTime``, later in the file on a tie), composed with those it is relative to;
    without perception, the matrix that it states itself (``orientation``, ``pose``).
    What cannot be read costs the thing, with a warning. Raises BadInput with everything found if nothing has a place
    and no file of a map is named.
    """
    found: list[Diagnostic] = []
    things = _things(ontology)
    ontology = with_known_classes(ontology, things, found)
    poses = PosesOfThings(ontology, found)
    names: set[str] = set()
    objects = []
    for iri in things:
        types, vessels = ontology.types(iri), _vessels(ontology, iri)
        size = read_size(ontology, iri, (*vessels, *types), found)
        objects.append(
            MapObject(
                iri,
                _unique(local_name(iri), names),
                (*types, *vessels),
                poses.pose(iri),
                size,
                parts=ontology.iris(iri, "properPhysicalParts"),
                hinged_to=ontology.iris(iri, "hingedTo"),
                inside=ontology.iris(iri, "in-ContGeneric"),
                on=ontology.iris(iri, "on-Physical"),
                open_sides=_open_sides(ontology, iri, types),
                boards=read_boards(ontology, iri, types, size, found),
                walls=_wall(ontology, iri, found),
                span=ontology.span(iri),
            )
        )
    objects = _with_places_turned(objects, ontology, found)
    if any(ontology.triples(None, OWL.onProperty, expand("orientation"))):
        objects = _with_parts_of_classes(objects, ontology, found)
    found += _other_frames(ontology, poses)
    semantic_map = SemanticMap(ontology.iri, ontology, tuple(objects), tuple(found))
    if not any(thing.pose for thing in objects) and not semantic_map.has_files:
        document = ontology.documents[0] if ontology.documents else None
        span = Span(str(document.path)) if document else None
        help = "a map says where things are: SemanticMapPerception with objectActedOn and eventOccursAt"
        raise BadInput([*found, error("M009", "nothing in this file has a place: it is no map", span, help)])
    return semantic_map


def _other_frames(ontology: Ontology, poses: PosesOfThings) -> Iterator[Diagnostic]:
    """Yield a warning for each map that is relative to something of another file: here all are in one frame."""
    for iri in ontology.individuals(expand("SemanticEnvironmentMap")):
        own = ontology.span(iri)
        for parent in ontology.values(poses.place_of(iri) or "", expand("relativeTo")):
            other = ontology.span(str(parent))
            if own is not None and other is not None and own.file != other.file:
                message = f"the frame of {local_name(iri)} is relative to {local_name(str(parent))}: that is not heeded"
                yield warning("M027", message, own, "make one map of both: planlang merge")


def _with_parts_of_classes(objects: list[MapObject], ontology: Ontology, found: list[Diagnostic]) -> list[MapObject]:
    """Return the things with the parts that their classes have, where those state poses."""
    things = {thing.iri: thing for thing in objects}
    known = (Known(one.iri, one.name, one.types, one.pose, one.parts, one.span) for one in objects)
    for part in parts_of_classes(known, ontology, found):
        if part.iri in things:
            things[part.iri] = replace(things[part.iri], pose=part.pose)
            continue
        whole = things[part.whole]
        things[part.whole] = replace(whole, parts=(*whole.parts, part.iri))
        things[part.iri] = MapObject(part.iri, part.name, (part.cls,), part.pose, part.size, span=whole.span)
    return list(things.values())


def _with_places_turned(objects: list[MapObject], ontology: Ontology, found: list[Diagnostic]) -> list[MapObject]:
    """Return the things with larger places having the smaller ones as parts, where a file states the inverse."""
    parts = {part for thing in objects for part in thing.parts}
    if not any(thing.parts and ontology.is_a(thing.iri, "RoomInAConstruction") for thing in objects) and not (
        ontology.any_is_a(parts, ("City",))
    ):
        return objects
    things, parts_of = {thing.iri: thing for thing in objects}, dict[str, dict[str, None]]()
    for triple in inverted(ontology):
        smaller, larger = str(triple.subject), str(triple.object)
        message = f"{local_name(larger)} is stated as a part of {local_name(smaller)}, which is smaller: turned around"
        found.append(note("M021", message, triple.span))
        for iri in (smaller, larger):
            if iri in things:
                parts_of.setdefault(iri, dict.fromkeys(things[iri].parts))
        parts_of.get(smaller, {}).pop(larger, None)
        parts_of.get(larger, {})[smaller] = None
    return [replace(thing, parts=tuple(parts_of.get(thing.iri, thing.parts))) for thing in objects]


OPENINGS = ("Doorway", "Portal")
"""Classes of openings in walls, which are no bodies."""

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
    there = {iri for iri in things if iri in order and iri not in others and not _is_feature(ontology, iri)}
    maps = {iri for iri in there if ontology.is_a(iri, expand("Map"))}
    poses = PosesOfThings(ontology, []) if maps else None
    frames = {iri for iri in maps if poses and any(ontology.values(poses.place_of(iri) or "", expand("relativeTo")))}
    return tuple(sorted(there - frames, key=order.__getitem__))  # what a map is relative to, is where its frame is


def _vessels(ontology: Ontology, iri: str) -> tuple[str, ...]:
    """Return what a thing is by its parts: a bottle if it has a cap, whatever is in it."""
    parts = ontology.iris(iri, "properPhysicalParts")
    return (expand("Bottle"),) if ontology.any_is_a(parts, ("BottleCap",)) else ()


def _is_feature(ontology: Ontology, iri: str) -> bool:
    """Return whether an individual is a feature of a model: by its class, or placed in its whole and without a size."""
    if any(local_name(cls) in FEATURES for cls in ontology.types(iri)):
        return True
    if any(stated(ontology, iri, name) for name in (*EXTENTS, *TRIPLES)):
        return False
    places = ontology.iris(iri, "orientation")
    wholes = (whole for place in places for whole in ontology.iris(place, "relativeTo"))
    return any(iri in ontology.iris(whole, "properPhysicalParts") for whole in wholes)


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


def _texts(ontology: Ontology, iri: str, prop: str) -> tuple[str, ...]:
    values = ontology.values(iri, expand(prop))
    return tuple(dict.fromkeys(value.value.strip() for value in values if isinstance(value, Literal)))


def _open_sides(ontology: Ontology, iri: str, types: tuple[str, ...]) -> tuple[str, ...]:
    """Sides that a thing states, else those that its nearest class does."""
    stated = _texts(ontology, iri, "openSide")
    classes = (one for cls in types for one in ontology.inherited_restrictions(cls, expand("openSide")))
    return stated or tuple(one.filler.value for one in classes if isinstance(one.filler, Literal))


def _wall(ontology: Ontology, iri: str, found: list[Diagnostic]) -> float | None:
    triple = stated(ontology, iri, "wallThickness")
    thickness = None if triple is None else length(triple, found)
    return thickness if thickness is None or thickness > 0 else None


def _unique(name: str, names: set[str]) -> str:
    names.add(found := unused_name(name, names))
    return found


class Seen(NamedTuple):
    """A perception of a thing, the newest one being the greatest."""

    time: float
    """Seconds; minus infinity if that is not stated."""
    rank: int
    """Its place in the file."""
    place: str
    """The pose, by IRI."""
    event: str


DEEPEST = 50
"""Poses that are relative to each other in a row."""


class PosesOfThings:
    """Poses of things as matrices, each read once, relative ones composed."""

    def __init__(self, ontology: Ontology, found: list[Diagnostic]) -> None:
        self.ontology = ontology
        self.found = found
        self.places: dict[str, list[Seen]] = {}
        for rank, event in enumerate(_perceptions(ontology)):
            when = self._time(event)
            for thing in ontology.iris(event, "objectActedOn"):
                for place in ontology.iris(event, "eventOccursAt"):
                    self.places.setdefault(thing, []).append(Seen(when, rank, place, event))
        self.known: dict[str, Array | None] = {}
        self.open: list[str] = []

    def of(self, thing: str) -> Array | None:
        """Return where a thing is, (4, 4) in the map; None if that is nowhere stated, or cannot be read."""
        return next((matrix for matrix in map(self._resolve, self._places_of(thing)) if matrix is not None), None)

    def pose(self, thing: str) -> Pose | None:
        """Return :meth:`of` as a pose."""
        matrix = self.of(thing)
        return None if matrix is None else Pose.from_matrix(matrix)

    def place_of(self, thing: str) -> str | None:
        """Return the pose of a thing: that of its latest perception, else the one that it states itself."""
        return next(iter(self._places_of(thing)), None)

    def _places_of(self, thing: str) -> list[str]:
        """Return the poses of a thing, the one that counts first: an earlier one stands in for one that is no pose."""
        own = [*self.ontology.iris(thing, "orientation"), *self.ontology.iris(thing, "pose")]
        if stated(self.ontology, thing, "translation"):
            own.append(thing)
        return [seen.place for seen in sorted(self.places.get(thing, ()), reverse=True)] or own[::-1]

    def newest(self, thing: str) -> Seen | None:
        """Return the perception of a thing that counts: the latest one with a pose that can be read."""
        seen = sorted(self.places.get(thing, ()), reverse=True)
        return next((one for one in seen if self._resolve(one.place) is not None), None)

    def _resolve(self, place: str) -> Array | None:
        if place in self.known:
            return self.known[place]
        if place in self.open:
            circle = " -> ".join(local_name(iri) for iri in (*self.open[self.open.index(place) :], place))
            help = "state one of them in the map frame, without relativeTo"
            self.found.append(warning("M008", f"poses relative to each other: {circle}", self._span(place), help))
            return None
        if len(self.open) == DEEPEST:
            message = f"{local_name(self.open[0])} is relative to a pose that is relative to others, {DEEPEST} times"
            self.found.append(warning("M008", message, self._span(self.open[0]), "state it in the map frame"))
            return None
        self.open.append(place)
        matrix = read_transform(self.ontology, place, self.found)
        for parent in self.ontology.iris(place, "relativeTo"):
            frame = self._frame(parent, place)
            matrix = None if frame is None or matrix is None else product(frame, matrix)
        self.open.pop()
        self.known[place] = matrix
        return matrix

    def _frame(self, parent: str, place: str) -> Array | None:
        """Return the frame that a pose is relative to: another pose, a thing's pose, or the map itself."""
        if self.ontology.is_a(parent, expand("SemanticEnvironmentMap")) or parent == expand("MapFrame"):
            return np.eye(4)
        if self._places_of(parent):
            return self.of(parent)
        if stated(self.ontology, parent, "m03"):
            return self._resolve(parent)
        message = f"{local_name(place)} is relative to {local_name(parent)}, which has no place in this map"
        self.found.append(warning("M010", message, self._span(place)))
        return None

    def _span(self, place: str) -> Span | None:
        triple = stated(self.ontology, place, "relativeTo")
        return triple.span if triple else self.ontology.span(place)

    def _time(self, event: str) -> float:
        """Return the seconds of a perception's startTime; minus infinity, with a note, if they cannot be read."""
        triple = stated(self.ontology, event, "startTime")
        if triple is None:
            return float("-inf")
        text = triple.object.value if isinstance(triple.object, Literal) else str(triple.object)
        seconds = seconds_of(text)
        if seconds is None:
            message = f"no time can be read from {local_name(text)!r}; this perception counts as the oldest"
            self.found.append(note("M011", message, triple.span))
            return float("-inf")
        return seconds


_DATE = re.compile(r"(?<!\d)(\d{4}-\d\d-\d\d)(?:[T ](\d\d:\d\d(?::\d\d(?:\.\d+)?)?))?(Z|[+-]\d\d:?\d\d)?$")
_DATED = re.compile(r"(?:(?<!\d)\d{4}(?:-[\dW]|[/_]\d\d[/_]\d\d(?!\d))|\d\d:\d\d|\d{8}T)[^#/]*$")
"""What has a date or a time of day, whose last digits are no seconds since 1970."""
_SECONDS = re.compile(r"(?<![\d.])\d{1,15}(?:\.\d{1,15})?$")
_LONGEST = 64
"""Characters at the end of a text that may be a time."""


def seconds_of(time: str) -> float | None:
    """Return the seconds since 1970 that end a text or a time point's name, as a number or an ISO 8601 date in UTC.

    A date alone is its midnight. What has a date that cannot be read in full has no seconds.
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
