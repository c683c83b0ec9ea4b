"""Classes of a map's things: those of other ontologies, matched by name, and the parts that class models state.

Properties that nothing declares are reported if they are nearly those of maps: what they state would be lost.

A plan compiled from a recipe in one ontology runs in a map in another. A class that the map's vocabulary does not
define is matched by local name, then by an annotation (``Class: Egg-Chickens Annotations: alsoCalled "Egg"``), and
finally by an unambiguous first part: ``Bed`` is Bed-PieceOfFurniture.

Each instance of a class gets the parts that its class model states, at the modelled poses: ``Class: Cabinet SubClassOf:
properPhysicalParts some Door1``, ``Class: Door1 SubClassOf: orientation value Pose1``, and ``Pose1`` is ``relativeTo``
the class of the cabinet, the class of another part, or another pose.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace

from executive.maps import soma
from executive.maps.link_names import LINKS
from executive.maps.measures import Size, read_size
from planlang.designators import local_name, local_part, unused_name
from planlang.diagnostics import Diagnostic, Span, note, unread, warning
from planlang.geometry import Pose
from planlang.kept import kept
from planlang.measures import EXTENTS, read_transform
from planlang.ontology import Literal, Ontology, expand
from planlang.ontology.terms import KNOWROB as NAMESPACE
from planlang.ontology.terms import RDF
from planlang.records import dataclass
from planlang.spelling import Spellings, similar


def known(ontology: Ontology, cls: str) -> str:
    """Map a class to its IRI in the vocabulary: the best of its :func:`meanings`."""
    return meanings(ontology, cls)[0]


def is_kind(ontology: Ontology, one: str, cls: str) -> bool:
    """Check whether class ``one`` is ``cls`` or a subclass of it, matching unknown classes by name.

    By IRI only if the map has objects of ``cls`` itself: unknown classes of one name in two namespaces differ.
    """
    iri = expand(cls)
    if not ontology.defined(iri) and iri in _used(ontology):
        return expand(one) == iri or ontology.is_a(one, iri)
    known_one = known(ontology, one)
    return any(ontology.is_a(known_one, meaning) for meaning in meanings(ontology, cls))


def meanings(ontology: Ontology, cls: str) -> tuple[str, ...]:
    """List the classes that a class can mean: itself if defined or without match, else matches by name, best first."""
    iri = expand(cls)
    if ontology.defined(iri):
        return (iri,)
    return tuple(_classes_by_name(ontology).get(local_name(iri).lower(), (iri,)))


@kept
def _classes_by_name(ontology: Ontology) -> dict[str, dict[str, None]]:
    """Lower-case name -> classes with it: local names, other names, and first parts that only one class has."""
    names: dict[str, dict[str, None]] = {}
    for name in ontology.class_names():
        names.setdefault(local_name(name).lower(), {})[name] = None
    for triple in ontology.triples(p=expand("alsoCalled")):
        if isinstance(triple.object, Literal) and isinstance(triple.subject, str):
            names.setdefault(triple.object.value.lower(), {})[triple.subject] = None
    short: dict[str, dict[str, None]] = {}
    for name in ontology.class_names():
        short.setdefault(local_name(name).lower().partition("-")[0], {})[name] = None
    return {key: classes for key, classes in short.items() if len(classes) == 1} | names


@kept
def _used(ontology: Ontology) -> frozenset[object]:
    """Classes with individuals in the ontology."""
    return frozenset(triple.object for triple in ontology.triples(p=RDF.type))


def with_known_classes(ontology: Ontology, things: Iterable[str], notes: list[Diagnostic]) -> Ontology:
    """Replace undefined classes of objects (IRIs) by defined classes of the same name, with a note for each.

    A class without a match gets a warning, with similar names. Undefined classes of the same name in different
    namespaces are left alone: :func:`is_kind` distinguishes them.
    """
    unknown = {cls: iri for iri in things for cls in ontology.types(iri) if not ontology.defined(cls)}
    counts = Counter(map(local_name, unknown))
    names: dict[str, str] = {}
    for cls, iri in unknown.items():
        if counts[local_name(cls)] > 1:
            continue
        subject, span = f"{local_name(cls)}, the class of {local_name(iri)}", ontology.span(iri)
        if (match := known(ontology, cls)) != expand(cls):
            names[cls] = match
            notes.append(note("M031", f"{subject}, is read as {local_name(match)}", span))
            continue
        defined_names = {local_name(name) for name in ontology.class_names()}
        close = similar(local_name(cls), sorted(defined_names), least=0.8)
        advice = f"did you mean {close[0]}?" if close else _definition(ontology, local_name(cls))
        notes.append(warning("M031", f"{subject}, is not defined: such objects have no known properties", span, advice))
    return ontology.renamed(names) if names else ontology


def _definition(ontology: Ontology, name: str) -> str:
    """Advise to define a class, below the one that its last words name: a CoffeeMug is a mug."""
    words = re.findall(r"[A-Z]+[^A-Z]*", name.partition("-")[0])
    tails = ("".join(words[begin:]).lower() for begin in range(1, len(words)))
    found = (one for tail in tails for one in _classes_by_name(ontology).get(tail, ()))
    above = next((f"knowrob:{local_part(one)}" for one in found if one.startswith(NAMESPACE)), "...")
    return f"define it: Class: {name} SubClassOf: {above}"


ALIKE = 0.9
"""Least similarity (difflib) of a misspelt property and a known one: a letter too many, or two that are swapped."""
KNOWROB = (
    *EXTENTS, "describedInMap", "objectActedOn", "eventOccursAt", "startTime", "orientation", "translation",
    "quaternion", "relativeTo", "properPhysicalParts", "properPhysicalPartOf", "physicalParts", "physicalPartOf",
    "hingedTo", "connectedTo-Rigidly", "in-ContGeneric", "on-Physical", "jointPosition", "minJointValue",
    "maxJointValue", "linkToMapFile", "pathToCadModel", "massOfObject", "weightOfObject", "areaOfObject",
)  # fmt: skip
"""Properties of KnowRob's maps that are read, of which a statement is lost if it is misspelt.

The vocabulary does not tell them from others: nine of them have no domain there, and a hundred others, such as
nextEvent and streetNumber, have the domains of the rest. An undeclared property that is nearly one of those loses
nothing.
"""


OWN = ("boardHeights", "openSide", "wallThickness", "routePoints", "drivingSpeed")
"""Properties of planlang's own that are read of maps."""


def misspellings(ontology: Ontology) -> Iterator[Diagnostic]:
    """Report the properties in use that nothing declares and that are nearly those of maps, each once.

    One of planlang's own is reported in another namespace, too. KnowRob's are not: its maps state some so, which means
    nothing else there.
    """
    words = Spellings((*KNOWROB, *OWN, *LINKS, *soma.READ))
    for number in ontology.store.used:
        iri = ontology.store.name(number) or ""
        name = local_part(iri)
        alike = words.similar(name, least=ALIKE)
        if not alike or ontology.is_property(iri):
            continue
        right = expand(alike[0])
        if alike[0] == name and (iri == right or name not in OWN):
            continue
        first = next(ontology.triples(None, iri))
        of = f" of {local_name(first.subject)}" if isinstance(first.subject, str) else ""
        called, meant = (f"<{iri}>", f"<{right}>") if alike[0] == name else (name, alike[0])
        yield unread("M036", f"{called}{of} is no property that maps have", first.span, f"did you mean {meant}?")


DEEPEST = 5
"""Greatest depth of nested parts, and of chains of relative poses."""
MOST_PARTS = 1000
"""Most parts that a map gets from classes: a guard against hostile files."""


@dataclass(frozen=True, slots=True)
class MapObject:
    """An object of a map; other objects are referred to by IRI."""

    iri: str
    name: str
    """Local name, with ``_2`` etc. if an earlier object of the map has the same."""
    types: tuple[str, ...]
    pose: Pose | None
    """Pose of the box centre in the map frame; None for objects without one (a building)."""
    size: Size | None
    """Extents along its own axes [m]; None for a mere place."""
    parts: tuple[str, ...] = ()
    hinged_to: tuple[str, ...] = ()
    inside: tuple[str, ...] = ()
    on: tuple[str, ...] = ()
    open_sides: tuple[str, ...] = ()
    """Sides of its box at which it is open, such as "+x"; with any, the box is hollow."""
    boards: tuple[float, ...] = ()
    """Heights of the tops of its boards above its lower end, in ascending order [m]."""
    walls: float | None = None
    """Thickness of its walls and boards [m]."""
    span: Span | None = None


def parts_of_classes(things: Iterable[MapObject], ontology: Ontology, notes: list[Diagnostic]) -> list[MapObject]:
    """Add the parts, and the poses of parts, that a map leaves to the classes of its objects."""
    reader = _Reader(things, ontology, notes)
    for thing in tuple(reader.things.values()):
        reader.complete(reader.things[thing.iri])
    return list(reader.things.values())


class _Reader:
    def __init__(self, things: Iterable[MapObject], ontology: Ontology, notes: list[Diagnostic]) -> None:
        self.things = {thing.iri: thing for thing in things}
        self.names = {thing.name for thing in self.things.values()}
        self.ontology, self.notes = ontology, notes
        self.added: list[str] = []
        """Names of the parts, new ones and those that got their poses."""

    def complete(self, thing: MapObject) -> None:
        """Add the parts that the classes of an object state, and the parts of these parts."""
        if thing.pose is None:
            return
        frames = {cls: thing.pose for stated_class in thing.types for cls in self.ontology.ancestors(stated_class)}
        before = len(self.added)
        self._add(thing, frames, thing, DEEPEST)
        if names := ", ".join(self.added[before:]):
            self.notes.append(note("M026", f"{thing.name} has {names} where its class has them", thing.span))

    def _add(self, whole: MapObject, frames: dict[str, Pose], root: MapObject, depth: int) -> None:
        """Add the parts of ``whole``; ``frames`` are poses of classes in the map frame."""
        for cls in self._classes_of_parts(whole):
            if depth == 0 or len(self.added) >= MOST_PARTS:
                return
            stated_parts = (self.things[iri] for iri in self.things[whole.iri].parts if iri in self.things)
            part = next((one for one in stated_parts if self.ontology.any_is_a(one.types, (cls,))), None)
            pose = self._pose(cls, frames) if part is None or part.pose is None else part.pose
            if pose is None:
                continue
            frames[cls] = pose
            if part is not None and part.pose is not None:
                continue  # it gets its own parts as an object of the map, at its pose there
            if part is None:
                part = self._new(root, cls, pose)
                whole = self.things[whole.iri] = replace(whole, parts=(*whole.parts, part.iri))
            part = self.things[part.iri] = replace(part, pose=pose)
            self.added.append(part.name)
            self._add(part, {**frames, **dict.fromkeys(self.ontology.ancestors(cls), pose)}, root, depth - 1)

    def _classes_of_parts(self, thing: MapObject) -> Iterator[str]:
        for cls in thing.types:
            for restriction in self.ontology.inherited_restrictions(cls, expand("properPhysicalParts")):
                if restriction.kind == "some" and isinstance(restriction.filler, str):
                    yield restriction.filler

    def _new(self, root: MapObject, cls: str, pose: Pose) -> MapObject:
        name = unused_name(f"{root.name}_{local_name(cls)}", self.names)
        self.names.add(name)
        size = read_size(self.ontology, cls, (cls,), [])
        return MapObject(f"{root.iri}{name.removeprefix(root.name)}", name, (cls,), pose, size, span=root.span)

    def _pose(self, cls: str, frames: dict[str, Pose]) -> Pose | None:
        """Find the pose of a part's class in the map; None if none is stated, or it is relative to an unknown frame."""
        for restriction in self.ontology.inherited_restrictions(cls, expand("orientation")):
            if isinstance(restriction.filler, str):
                return self._resolved(restriction.filler, frames, ())
        return None

    def _resolved(self, place: str, frames: dict[str, Pose], within: tuple[str, ...]) -> Pose | None:
        matrix = None if place in within or len(within) > DEEPEST else read_transform(self.ontology, place, self.notes)
        parents = self.ontology.iris(place, "relativeTo")
        parent = next(iter(parents), None)
        if matrix is None or parent is None:
            return None
        frame = frames.get(parent)
        if frame is None and any(self.ontology.triples(parent, expand("m03"))):  # the parent is itself a pose
            frame = self._resolved(parent, frames, (*within, place))
        return None if frame is None else frame @ Pose.from_matrix(matrix)
