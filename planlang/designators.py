"""Typed, hashable descriptions of objects, devices, locations and actions: pure data, grounded by an executive.

A class of the KnowRob vocabulary is written by its local name (``"DrinkingBottle"``), any other by its full IRI.
Properties are written in snake case (``object_acted_on`` is ``objectActedOn``).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

RELATIONS: dict[str, str] = {
    "in_reach_of": "inReachOf",
    "visible_from": "visibleFrom",
    "above": "aboveOf",
    "on": "on-Physical",
    "in_": "in-ContGeneric",
    "in_center_of": "inCenterOf",
    "in_front_of": "inFrontOf-Generally",
    "next_to": "toTheSideOf",
}
"""Relation of a location -> the local name of its OWL property."""


@dataclass(frozen=True, slots=True)
class Object:
    """An object or a device, told by its class and, when known, by the individual that it is.

    ``iri`` binds first (rules: a map individual of the same IRI); else class and relations decide.
    """

    type: str
    iri: str | None = None

    @property
    def name(self) -> str:
        """Local name of the individual, or of the class when anonymous."""
        return local_name(self.iri or self.type)

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Person(Object):
    """A person: has a hand, a reach of their own, and is never grasped."""


@dataclass(frozen=True, slots=True)
class Device(Object):
    """A part of the robot, e.g. a gripper; no side in its name or type means any side."""


@dataclass(frozen=True, slots=True)
class Relation:
    """One conjunct of a location: ``name`` is a key of :data:`RELATIONS`."""

    name: str
    reference: Object | Location

    def __str__(self) -> str:
        return f"{self.name}({self.reference})"


@dataclass(frozen=True, slots=True)
class Location:
    """A set of poses: the conjunction of its relations. Without relations: a posture of the robot, by ``name``.

    ``device`` narrows what reaches: "in reach of the bottle with the right gripper".
    """

    relations: tuple[Relation, ...] = ()
    name: str | None = field(default=None, compare=False)
    device: Device | None = None

    def __and__(self, other: Location) -> Location:
        """The poses in both."""
        more = tuple(relation for relation in other.relations if relation not in self.relations)
        return Location(self.relations + more, self.name, self.device or other.device)

    def __str__(self) -> str:
        if not self.relations:
            return f"posture {self.name}"
        text = " and ".join(str(relation) for relation in self.relations)
        return f"{text} with {self.device}" if self.device else text


@dataclass(frozen=True, slots=True)
class Posture(Location):
    """A named posture of the robot's own, e.g. ``carrying``."""

    name: str | None = None


Value = Object | Location | str | int | float | bool | tuple[Object | Location | str | int | float | bool, ...]
"""What may fill a property of an action; a tuple where several things do."""


@dataclass(frozen=True, slots=True)
class Action:
    """An action to perform: its class and its properties, in snake case, sorted by name."""

    type: str
    properties: tuple[tuple[str, Value], ...] = ()
    name: str | None = field(default=None, compare=False)

    def get(self, property_name: str) -> Value | None:
        """The filler of a property, or None."""
        return dict(self.properties).get(property_name)

    def __str__(self) -> str:
        inside = ", ".join(f"{key}={value}" for key, value in self.properties)
        return f"{local_name(self.type)}({inside})"


@dataclass(frozen=True, slots=True)
class Condition:
    """A fact that the executive can look up in its belief, e.g. ``holding(bottle)``."""

    predicate: str
    arguments: tuple[Value, ...]

    def __str__(self) -> str:
        return f"{self.predicate}({', '.join(map(str, self.arguments))})"


def an_object(type: str, iri: str | None = None) -> Object:
    """Describe an object of a class, or the individual ``iri``."""
    return Object(type, iri)


def a_person(type: str = "Person", iri: str | None = None) -> Person:
    """Describe a person."""
    return Person(type, iri)


def a_device(type: str, iri: str | None = None) -> Device:
    """Describe a part of the robot."""
    return Device(type, iri)


def a_location(
    name: str | None = None,
    *,
    using: Device | None = None,
    **relations: Object | Location | Iterable[Object | Location],
) -> Location:
    """Describe a location by relations, e.g. ``a_location(in_reach_of=bottle, using=RIGHT_GRIPPER)``.

    A relation to several references is written with a tuple. Raises ValueError for an unknown relation.
    """
    conjuncts: list[Relation] = []
    for key, references in relations.items():
        if key not in RELATIONS:
            raise ValueError(f"unknown relation {key!r}; valid relations: {', '.join(RELATIONS)}")
        if isinstance(references, (Object, Location)):
            references = (references,)
        conjuncts.extend(Relation(key, reference) for reference in references)
    if not conjuncts:
        raise ValueError("a location needs a relation; a named posture of the robot is a_posture(name)")
    return Location(tuple(conjuncts), name, using)


def a_posture(name: str) -> Posture:
    """Describe a named posture of the robot's own."""
    return Posture((), name)


def action(type: str, *, name: str | None = None, **properties: Value) -> Action:
    """Describe an action: ``action("Reaching", to_location=approach_pose, device_used=RIGHT_GRIPPER)``."""
    return Action(type, tuple(sorted(properties.items())), name)


def holding(what: Object) -> Condition:
    """True while the robot holds the object."""
    return Condition("holding", (what,))


def local_name(iri: str) -> str:
    """The part of an IRI after ``#`` or the last ``/``."""
    return iri.rsplit("#", 1)[-1].rsplit("/", 1)[-1]
