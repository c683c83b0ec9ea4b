"""Semantic maps: things with their classes, poses, sizes and parts, read from an ontology; the bundled ones."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from executive.belief.stated_values import EXTENTS, TRIPLES, Size, read_size, read_transform, stated
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, has_errors, note, warning
from planlang.files import Bundled
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product
from planlang.ontology import Literal, Ontology, expand, load


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
    span: Span | None = None


@dataclass(frozen=True, slots=True)
class SemanticMap:
    """The things of a map in document order, and what was repaired or assumed while reading it."""

    iri: str | None
    ontology: Ontology
    objects: tuple[MapObject, ...]
    diagnostics: tuple[Diagnostic, ...]

    def find(self, name: str) -> MapObject | None:
        """Return the thing with this IRI, or else of this name."""
        return next((o for o in self.objects if o.iri == name), None) or next(
            (o for o in self.objects if o.name == name), None
        )

    def holder(self, thing: MapObject) -> MapObject | None:
        """Return what the thing is a proper physical part of, if the map says so."""
        return next((o for o in self.objects if thing.iri in o.parts), None)


def read_map(ontology: Ontology) -> SemanticMap:
    """Read the map that an ontology states.

    A thing is what a perception places, or what has a size, parts, a hinge, a room or ``describedInMap``. Its pose is
    that of its latest perception (``startTime``, later in the file on a tie), composed with those it is relative to;
    without perception, the matrix that it states itself (``orientation``, ``pose``).
    Raises BadInput with everything found if a number is missing, not finite or negative, or poses depend on themselves.
    """
    found: list[Diagnostic] = []
    things = _things(ontology)
    poses = _Poses(ontology, found)
    names: set[str] = set()
    objects = []
    for iri in things:
        types = ontology.types(iri)
        size = read_size(ontology, iri, types, found)
        matrix = poses.of(iri)
        objects.append(
            MapObject(
                iri,
                _unique(local_name(iri), names),
                types,
                None if matrix is None else Pose.from_matrix(matrix),
                size,
                parts=_individuals(ontology, iri, "properPhysicalParts"),
                hinged_to=_individuals(ontology, iri, "hingedTo"),
                inside=_individuals(ontology, iri, "in-ContGeneric"),
                on=_individuals(ontology, iri, "on-Physical"),
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


_MARKS = ("describedInMap", "hingedTo", "properPhysicalParts", "roomNumber", "in-ContGeneric", *EXTENTS, *TRIPLES)


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
    return tuple(sorted((iri for iri in things if iri in order and iri not in links), key=order.__getitem__))


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


def _unique(name: str, names: set[str]) -> str:
    candidate, number = name, 2
    while candidate in names:
        candidate, number = f"{name}_{number}", number + 1
    names.add(candidate)
    return candidate


class _Poses:
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
        place = self._place(thing)
        return None if place is None else self._resolve(place)

    def _place(self, thing: str) -> str | None:
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
        nested = self._place(parent)
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


DEFAULT_ENVIRONMENT = "hospital_room"
"""The environment in which bundled recipes are run without ``--environment``."""


def environments_with(things: Iterable[str]) -> tuple[str, ...]:
    """Return the bundled environments in which all these things (local names or IRIs) have a pose, sorted."""
    wanted = tuple(things)
    return tuple(name for name in Bundled.ENVIRONMENT.names() if all(_has(_map(name), thing) for thing in wanted))


def default_environment(things: Iterable[str], notes: list[Diagnostic]) -> str:
    """Return the bundled environment for a run of a bundled recipe with these things.

    The default is replaced, with a note, if only one environment contains the named objects.
    """
    wanted = tuple(things)
    fitting = environments_with(wanted) if wanted else ()
    if len(fitting) != 1 or fitting[0] == DEFAULT_ENVIRONMENT:
        return DEFAULT_ENVIRONMENT
    lacking = ", ".join(thing for thing in wanted if not _has(_map(DEFAULT_ENVIRONMENT), thing))
    message = f"the environment {fitting[0]} is chosen, as {DEFAULT_ENVIRONMENT} has no {lacking}"
    notes.append(note("X010", message, help="--environment names one"))
    return fitting[0]


@cache
def _map(name: str) -> SemanticMap:
    return read_map(load(Bundled.ENVIRONMENT.find(name)))


def _has(semantic_map: SemanticMap, name: str) -> bool:
    thing = semantic_map.find(name)
    return thing is not None and thing.pose is not None
