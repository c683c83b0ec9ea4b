"""Typed, hashable descriptions of objects, devices, locations and actions: pure data, grounded by an executive.

A class of the KnowRob vocabulary is written by its local name (``"DrinkingBottle"``), any other by its full IRI.
Properties are written in snake case (``object_acted_on`` is ``objectActedOn``).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import field, replace
from numbers import Real
from typing import Any, cast
from warnings import warn

from planlang.designator_usage import ACTION as _ACTION
from planlang.designator_usage import ACTION_CLASS as _ACTION_CLASS
from planlang.designator_usage import CONDITION as _CONDITION
from planlang.designator_usage import HOLDING as _HOLDING
from planlang.designator_usage import LOCATED as _LOCATED
from planlang.designator_usage import LOCATION as _LOCATION
from planlang.designator_usage import OBJECT as _OBJECT
from planlang.designator_usage import POSE as _POSE
from planlang.designator_usage import POSTURE as _POSTURE
from planlang.designator_usage import RELATION as _RELATION
from planlang.designator_usage import SITUATION as _SITUATION
from planlang.iris import is_called as is_called
from planlang.iris import label_iris as label_iris
from planlang.iris import local_name as local_name
from planlang.iris import local_part as local_part
from planlang.iris import names_of as names_of
from planlang.iris import snake_case as snake_case
from planlang.iris import told_apart as told_apart
from planlang.iris import unused_name as unused_name
from planlang.lengths import bound_of
from planlang.misuse import Usage, WrongType, WrongValue, amount, contrast, written
from planlang.records import dataclass
from planlang.relations import RELATIONS, measured, named

GRASPS: tuple[str, ...] = ("side", "tilted", "top")
"""Classes of grasps, by the direction from which the hand approaches."""


@dataclass(frozen=True, slots=True)
class Object:
    """An object, described by its class and, if known, its individual.

    An executive looks for an individual of the map with this ``iri`` first, else for one of the class. With ``where``
    it is one of the class that is there when it is chosen.
    """

    type: str
    iri: str | None = None
    where: Location | None = None

    def __post_init__(self) -> None:
        _OBJECT.text("type", self.type)
        if self.iri is not None:
            _OBJECT.text("iri", self.iri)
        if self.where is not None:
            _OBJECT.instance("where", self.where, Location, "a location")
            if self.iri is not None:
                message = "an individual is chosen already: where says which thing of a class is meant"
                raise _OBJECT.refused("where", message, self.where)

    @property
    def name(self) -> str:
        """Local name of the individual, or of the class when anonymous."""
        return local_name(self.iri or self.type)

    def __str__(self) -> str:
        return self.name if self.where is None else f"{self.name} that is {self.where}"


@dataclass(frozen=True, slots=True)
class Person(Object):
    """A person: has a hand, a reach of their own, and is never grasped."""


@dataclass(frozen=True, slots=True)
class Device(Object):
    """A part of the robot, e.g. a gripper; without a side in its name or class, either side will do."""


@dataclass(frozen=True, slots=True)
class Relation:
    """One conjunct of a location: ``name`` is a key of ``planlang.relations.RELATIONS``.

    It relates to as many ``references`` as the relation has: one, but for ``between`` two.
    ``within`` and ``beyond`` bound the distance of a relation that has one [m]: between the outlines seen from above,
    or for ``above`` the height. A ``negated`` relation holds where the relation, bounds included, does not.
    """

    name: str
    references: tuple[Reference, ...]
    within: float | None = None
    beyond: float | None = None
    negated: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or self.name not in RELATIONS:
            raise _RELATION.wrong("name", self.name, f"one of {', '.join(RELATIONS)}", WrongValue)
        for bound, length in (("within", self.within), ("beyond", self.beyond)):
            if length is not None and amount(length) is None:
                raise _RELATION.wrong(bound, length, "a finite length >= 0 [m]", WrongValue)
        arity = RELATIONS[self.name].arity
        if isinstance(self.references, Reference):
            warn(f"write Relation({self.name!r}, (reference,)): a relation may have several", DeprecationWarning, 3)
            object.__setattr__(self, "references", (self.references,))
        refers = isinstance(self.references, tuple) and all(isinstance(one, Reference) for one in self.references)
        if not refers or len(self.references) != arity:
            raise _RELATION.wrong("references", self.references, f"a tuple of {arity} objects or locations")

    @property
    def reference(self) -> Reference:
        """The first of the references, for modules that were written when there was one."""
        warn("Relation.reference is Relation.references[0]: a relation may have several", DeprecationWarning, 2)
        return self.references[0]

    def __invert__(self) -> Relation:
        """The complement."""
        return replace(self, negated=not self.negated)

    def __str__(self) -> str:
        bounds = ""
        if self.beyond is not None:
            bounds += f", beyond {self.beyond!r} m"
        if self.within is not None:
            bounds += f", within {self.within!r} m"
        return f"{'not ' if self.negated else ''}{self.name}({', '.join(map(str, self.references))}{bounds})"


@dataclass(frozen=True, slots=True)
class Location:
    """A set of poses: the conjunction of its relations, compared without their order.

    ``device`` and ``grasp`` (one of ``GRASPS``) restrict how the robot reaches: "in reach of the bottle with the right
    gripper, by a side grasp".
    """

    relations: tuple[Relation, ...] = ()
    name: str | None = field(default=None, compare=False)
    device: Device | None = None
    grasp: str | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.relations, tuple) or not all(isinstance(one, Relation) for one in self.relations):
            raise _LOCATION.wrong("relations", self.relations, "a tuple of relations")
        if self.name is not None:
            _LOCATION.text("name", self.name)
        if self.device is not None:
            _LOCATION.instance("using", self.device, Device, "a device")
        if self.grasp is not None and self.grasp not in GRASPS:
            raise _LOCATION.wrong("grasp", self.grasp, f"one of {', '.join(GRASPS)}", WrongValue)

    def __eq__(self, other: object) -> bool:
        return self._compared() == other._compared() if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._compared())

    def _compared(self) -> tuple[object, ...]:
        return frozenset(self.relations), self.device, self.grasp

    def __and__(self, other: Location) -> Location:
        """Intersect two locations; raises ValueError for two arms, two grasps, and for postures."""
        if not isinstance(other, Location):
            code = written(other)
            message = f"& joins two locations, not a location and {code}"
            raise WrongType(contrast(message, f"near & {code}", "near & a_location(in_reach_of=bottle)"))
        if isinstance(self, Posture | FixedPose) or isinstance(other, Posture | FixedPose):
            raise ValueError(f"a posture or a fixed pose cannot be joined with another location: {self} & {other}")
        if None not in (self.device, other.device) and self.device != other.device:
            raise ValueError(
                f"one location names two arms: {self.device} and {other.device}. A base from which "
                "two hands reach is in reach of two locations, each with its arm: a_location(in_reach_of=(one, other))"
            )
        if None not in (self.grasp, other.grasp) and self.grasp != other.grasp:
            raise ValueError(f"one location names two grasps: {self.grasp} and {other.grasp}")
        more = tuple(relation for relation in other.relations if relation not in self.relations)
        return Location(self.relations + more, self.name, self.device or other.device, self.grasp or other.grasp)

    def __invert__(self) -> Location:
        """The complement; raises ValueError unless it is a single relation without arm and grasp."""
        if len(self.relations) != 1 or self.device is not None or self.grasp is not None:
            raise ValueError(f"only a location of one relation, without arm and grasp, can be negated; this is {self}")
        return Location((~self.relations[0],))

    def references(self) -> Iterator[Reference]:
        """Yield what the relations refer to, in their order."""
        for relation in self.relations:
            yield from relation.references

    def objects(self) -> Iterator[Object]:
        """Yield the things that the relations themselves refer to."""
        return (one for one in self.references() if isinstance(one, Object))

    def things(self) -> Iterator[Object]:
        """Yield the things that the location refers to, including those of nested locations."""
        for reference in self.references():
            if isinstance(reference, Location):
                yield from reference.things()
            else:
                yield reference

    def __str__(self) -> str:
        if not self.relations:
            return f"posture {self.name}"
        text = " and ".join(str(relation) for relation in self.relations)
        text = f"{text} with {self.device}" if self.device else text
        return f"{text} by a {self.grasp} grasp" if self.grasp else text


Reference = Object | Location
"""What a relation refers to."""


@dataclass(frozen=True, slots=True)
class Posture(Location):
    """A named posture of the robot, e.g. ``carrying``."""

    name: str | None = None


@dataclass(frozen=True, slots=True)
class FixedPose(Location):
    """A pose in the map: position [m] and heading about the vertical [rad]."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0

    def __str__(self) -> str:
        return f"pose {self.name or ''}({self.x:g}, {self.y:g}, {self.z:g}; {self.yaw:g})"


class Filler:
    """Base class of value types from other modules that may fill a property."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class _Described:
    """Something of a class; ``properties`` are (snake case name, filler), sorted by name."""

    type: str
    properties: tuple[tuple[str, Value], ...] = ()

    def get(self, property_name: str) -> Value | None:
        """Return the filler of a property, or None."""
        return dict(self.properties).get(property_name)

    def __str__(self) -> str:
        inside = ", ".join(f"{key}={_told(value)}" for key, value in self.properties)
        return f"{local_name(self.type)}({inside})"


@dataclass(frozen=True, slots=True)
class Situation(_Described):
    """A situation of a class."""

    def __post_init__(self) -> None:
        _check_described(_SITUATION, self.type, self.properties)


Part = Object | Location | Situation | Filler | str | int | float | bool
"""One thing that may fill a property."""

Value = Part | tuple[Part, ...]
"""Value of a property of an action; a tuple for several values."""


@dataclass(frozen=True, slots=True)
class Action(_Described):
    """An action to perform: its class and its properties, in snake case, sorted by name."""

    name: str | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        _check_described(_ACTION, self.type, self.properties)
        if self.name is not None:
            _ACTION.text("name", self.name)


@dataclass(frozen=True, slots=True)
class Condition:
    """A fact that the executive can look up in its belief, e.g. ``holding(bottle)``."""

    predicate: str
    arguments: tuple[Value, ...]

    def __post_init__(self) -> None:
        _CONDITION.text("predicate", self.predicate)
        _CONDITION.instance("arguments", self.arguments, tuple, "a tuple of what the condition is about")

    def __bool__(self) -> bool:
        message = f"{self} is a condition, which is not true or false itself: holds() makes a fluent of it"
        wrong, right = "holding(cup) and holding(plate)", "holds(holding(cup)) & holds(holding(plate))"
        raise WrongType(contrast(message, wrong, right))

    def __str__(self) -> str:
        return f"{self.predicate}({', '.join(map(str, self.arguments))})"


def _told(value: object) -> str:
    """Format a filler; constraints, features and objects in a tuple by their names."""
    if not isinstance(value, tuple) or not any(isinstance(part, (Filler, Object)) for part in value):
        return str(value)
    return f"({', '.join(str(getattr(part, 'name', None) or part) for part in value)})"


def _check_described(usage: Usage, type_: object, properties: object) -> None:
    """Check the class and the properties of an action or a situation."""
    usage.text("type", type_)
    pairs = properties if isinstance(properties, tuple) else (None,)
    if not all(isinstance(pair, tuple) and len(pair) == 2 and isinstance(pair[0], str) for pair in pairs):
        raise usage.wrong("object_acted_on", properties, "given by pairs (property, filler)")
    for key, value in pairs:
        parts = value if isinstance(value, tuple) else (value,)
        for part in parts:
            if not isinstance(part, (Object, Location, Situation, Filler, str, Real)):
                meant = "an object, a location, a situation, a motion constraint, a text, a number, or a tuple of them"
                raise usage.wrong(key, value, meant)


def an_object(type: str, iri: str | None = None, *, where: Location | None = None) -> Object:
    """Describe an object of a class, or the individual ``iri``.

    ``where`` is the location of an object of the class when it is chosen: ``where=a_location(on=table)``.
    """
    return Object(type, iri, where)


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
    grasp: str | None = None,
    within: float | str | None = None,
    beyond: float | str | None = None,
    not_: Location | Iterable[Location] = (),
    **relations: Reference | Iterable[Reference] | Iterable[tuple[Reference, ...]],
) -> Location:
    """Describe a location by relations, e.g. ``a_location(in_reach_of=bottle, using=RIGHT_GRIPPER)``.

    A tuple relates to several references, each by itself; ``between`` takes two references in a tuple, or a tuple of
    such pairs. ``within`` and ``beyond`` bound the distance of the one relation in the call that has a distance, in
    metres or as a text: ``a_location(near=door, within="30 cm")``. Join several bounded relations with ``&``. ``not_``
    takes locations of one relation each that must not hold:
    ``a_location(in_reach_of=patient, not_=a_location(near=door))``. Raises ValueError for invalid relations and bounds.
    """
    conjuncts: list[Relation] = []
    for keyword, references in relations.items():
        relation = named(keyword)
        if relation is None:
            message = f"unknown relation {keyword!r}; valid relations: {', '.join(RELATIONS)}"
            raise WrongValue(contrast(message, f"a_location({keyword}=bottle)", "a_location(in_reach_of=bottle)"))
        each = _each(keyword, references) if relation.arity == 1 else _pairs(keyword, references)
        conjuncts.extend(Relation(relation.name, some) for some in each)
    if within is not None or beyond is not None:
        conjuncts = _bounded(conjuncts, within, beyond)
    if not isinstance(not_, Location):
        _LOCATION.iterable("not_", not_, "a location, or a tuple of them")
    for excluded in (not_,) if isinstance(not_, Location) else not_:
        _LOCATION.instance("not_", excluded, Location, "a location, or a tuple of them")
        conjuncts.extend((~excluded).relations)
    if not conjuncts:
        message = "a location needs a relation; a named posture of the robot is a_posture(name)"
        raise WrongValue(contrast(message, "a_location()", "a_location(in_reach_of=bottle)    or    a_posture(name)"))
    return Location(tuple(dict.fromkeys(conjuncts)), name, using, grasp)


def _each(keyword: str, given: object) -> Iterator[tuple[Reference, ...]]:
    """Yield the references of each conjunct of a relation to one thing."""
    meant = "an object or a location, or a tuple of them"
    several = (given,) if isinstance(given, Reference) else given
    _LOCATION.iterable(keyword, several, meant)
    for one in cast(Iterable[Any], several):
        _LOCATION.instance(keyword, one, Reference, meant)
        yield (one,)


def _pairs(keyword: str, given: object) -> Iterator[tuple[Reference, ...]]:
    """Yield the references of each conjunct of a relation to two things."""
    are_pairs = isinstance(given, tuple) and all(isinstance(one, tuple) for one in given)
    for pair in cast(tuple[Any, ...], given if are_pairs else (given,)):
        if not isinstance(pair, tuple) or [isinstance(one, Reference) for one in pair] != [True, True]:
            code = written(given)
            message = f"{keyword} of a_location relates to two objects, not {code}"
            raise WrongValue(contrast(message, f"a_location({keyword}={code})", f"a_location({keyword}=(bed, table))"))
        yield pair


def resting_on(where: Location | Object) -> Location:
    """Return the location for putting an object down: at a place, on a thing, or within a person's reach."""
    if isinstance(where, Location):
        return where
    return a_location(in_reach_of=where) if isinstance(where, Person) else a_location(on=where)


def _bounded(relations: list[Relation], within: float | str | None, beyond: float | str | None) -> list[Relation]:
    bounded = [relation for relation in relations if RELATIONS[relation.name].measured]
    if len(bounded) != 1:
        here = ", ".join(map(str, bounded)) or "no such relation"
        raise ValueError(
            f"within and beyond bound one relation of {', '.join(measured())}; this location has {here}. Join several "
            "bounded relations with &: a_location(near=bed, within=1.0) & a_location(near=door, within=2.0)"
        )
    at_most, at_least = bound_of("within", within), bound_of("beyond", beyond)
    if at_most is not None and at_least is not None and at_least > at_most:
        raise ValueError(f"no distance is beyond {at_least} m and within {at_most} m")
    return [
        replace(relation, within=at_most, beyond=at_least) if relation in bounded else relation
        for relation in relations
    ]


def a_posture(name: str) -> Posture:
    """Describe a named posture of the robot."""
    _POSTURE.text("name", name)
    return Posture((), name)


def a_pose(name: str | None = None, *, x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> FixedPose:
    """Describe a pose in the map: position [m], heading [rad]. Raises ValueError unless all are finite numbers."""
    for key, value in {"x": x, "y": y, "z": z, "yaw": yaw}.items():
        if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
            raise _POSE.wrong(key, value, "a finite number", WrongValue)
    return FixedPose((), name, None, None, float(x), float(y), float(z), float(yaw))


class ActionClass(str):
    """The IRI or local name of an action class, with its direct superclasses; see :func:`action_class`."""

    __slots__ = ("below",)
    below: tuple[str, ...]


def action_class(iri: str, *, below: str | Iterable[str]) -> ActionClass:
    """Define an action class: ``STIR_SOUP = action_class(RECIPE + "StirSoup", below="Stirring")``.

    ``below`` lists its superclasses, most specific first: names of the vocabulary, or classes defined like this one.
    ``action(STIR_SOUP)`` is performed by the process module of the nearest class, itself or a superclass.
    """
    _ACTION_CLASS.text("iri", iri)
    if not isinstance(below, str):
        _ACTION_CLASS.iterable("below", below, "classes of actions")
    above = (below,) if isinstance(below, str) else tuple(below)
    if not above:
        raise _ACTION_CLASS.wrong("below", below, "at least one superclass")
    for one in above:
        _ACTION_CLASS.text("below", one)
    stated = ActionClass(iri)
    stated.below = above
    return stated


def action(
    type: str, *, name: str | None = None, below: str | Iterable[str] | None = None, **properties: Value
) -> Action:
    """Describe an action: ``action("Reaching", to_location=approach_pose, device_used=RIGHT_GRIPPER)``.

    ``below`` defines a class that the vocabulary does not have, as :func:`action_class` does:
    ``action(RECIPE + "ApproachBottle", below="Reaching", to_location=approach_pose)``.
    """
    cls = type if below is None else action_class(type, below=below)
    return Action(cls, tuple(sorted(properties.items())), name)


def a_situation(type: str, **properties: Value) -> Situation:
    """Describe a situation: ``a_situation("VisualPerception", detected_object=bottle)``."""
    return Situation(type, tuple(sorted(properties.items())))


def holding(what: Object) -> Condition:
    """Condition: the robot holds the object."""
    _HOLDING.instance("what", what, Object, "an object")
    return Condition("holding", (what,))


def located(where: Location, what: Object | None = None) -> Condition:
    """Condition: ``what`` is at a location; an object, a hand given as a device, or by default the robot's base."""
    _LOCATED.instance("where", where, Location, "a location")
    if what is not None:
        _LOCATED.instance("what", what, Object, "an object")
    return Condition("located", (where,) if what is None else (where, what))
