"""Reading the fillers of action properties: objects, persons, devices, location designators, numbers with units.

Numbers with units are converted to SI units (:mod:`planlang.units`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

from planlang.designators import local_name, snake_case
from planlang.kept import kept
from planlang.measures import length, read_transform, stated
from planlang.ontology import BNode, Literal, Ontology, Restriction, Term, expand, shorten
from planlang.ontology.terms import OWL, RDF, RDFS, UPPER, XSD, is_vocabulary
from planlang.recipe.model import Filler, Kind, Name, Parameter, Place, Thing
from planlang.recipe.statements import (
    KINDS,
    ON_ACTIONS,
    ON_INDIVIDUALS,
    REGISTERED_WORDS,
    Filling,
    fillings_of,
    is_word,
)
from planlang.relations import RELATIONS, of_owl_property
from planlang.units import dimension_of, stated_number, unit_of, unit_of_property

OBJECT_PROPERTY = OWL.ObjectProperty

PLACES = ("Point2D", "Point3D")
"""Classes of location designators: for the base (2D), for the hand or an object (3D)."""

PLACE = "Place"
"""Class of location designators that are no more specific; its subclasses such as cities and rooms are things."""

ANYTHING = ("EnduringThing-Localized", "SpatialThing-Localized", "SpatialThing")
"""Classes of things with a position, whatever their kind."""

UPRIGHT = 1e-3
"""Tolerance of the z component of a pose's z axis around 1 within which it points up."""

MOST_PLACES = 10
"""Maximum length of a chain of places: a plan nests the call for each place in that for the previous one."""

_SIZES = ("long", "int", "short", "byte", "unsignedLong", "unsignedInt", "unsignedShort", "unsignedByte")
_SIGNS = ("positiveInteger", "nonNegativeInteger", "negativeInteger", "nonPositiveInteger")
_INTEGERS = frozenset({"integer", *_SIZES, *_SIGNS})
NUMERIC = _INTEGERS | {"float", "double", "decimal"}
"""Local names of the datatypes of numbers."""

TEXT = frozenset({"", "string", "langString"})
"""Local names of the datatypes of text; an untyped literal is text."""


DEVICE_PROPERTIES = ("deviceUsed", "bodyPartsUsed")
"""Properties (local names) for the part of the robot with which it acts."""


def nearest_in_vocabulary(ontology: Ontology, cls: str, below: str | None = None) -> str:
    """Local name of the nearest class at or above ``cls`` in the bundled vocabulary; its own IRI if there is none.

    With ``below`` (IRI) subclasses of that class are preferred.
    """
    nearest = None
    for ancestor in ontology.ancestors(cls):
        short = shorten(ancestor)
        if short != ancestor:
            if below is None or ontology.is_a(ancestor, below):
                return short
            nearest = nearest or short
    return nearest or cls


_DEVICES = ("HolderGripper", "RobotPart", "ComponentComposition", "Arm", "srdl2-comp:HardwareComponent")
"""Classes of robot parts; KnowRob has the same class for arms of persons and robots."""


def kind_of(ontology: Ontology, cls: str) -> Kind:
    """Classify things of a class as persons, parts of a robot, or objects."""
    if ontology.is_a(cls, expand("Person")):
        return Kind.PERSON
    return Kind.DEVICE if is_device(ontology, cls) else Kind.OBJECT


def is_device(ontology: Ontology, cls: str) -> bool:
    """True for classes of robot parts that act on something, such as grippers, hands and arms."""
    return ontology.any_is_a((cls,), _DEVICES)


def is_place(ontology: Ontology, iri: str) -> bool:
    """True for a location designator, written as an individual or as a class."""
    return ontology.any_is_a((iri,), PLACES) or _is_just_a_place(ontology, iri) or _pose(ontology, iri) is not None


def _is_just_a_place(ontology: Ontology, iri: str) -> bool:
    """True for a Place that the vocabulary does not classify any further, for example as a room."""
    place = expand(PLACE)
    if not ontology.is_a(iri, place):
        return False
    above = {ancestor for cls in classes_of(ontology, iri) for ancestor in ontology.ancestors(cls)}
    return all(
        ancestor == place or ontology.is_a(place, ancestor) for ancestor in above if is_vocabulary_class(ancestor)
    )


def _pose(ontology: Ontology, iri: str) -> tuple[float, float, float, float] | None:
    """Pose of a base in the map frame, x, y, z [m] and heading [rad]; None unless it is stated, with the z axis up.

    Of a matrix only the entries are needed that such a pose depends on.
    """
    if not ontology.is_a(iri, expand("RotationMatrix3D")):
        return None
    entries = [stated(ontology, iri, name) for name in ("m03", "m13", "m23", "m00", "m10", "m22")]
    if any(entries):
        numbers = [None if one is None else length(one, []) for one in entries]
    else:
        matrix = read_transform(ontology, iri, [])
        numbers = [] if matrix is None else [*matrix[:3, 3].tolist(), matrix[0, 0], matrix[1, 0], matrix[2, 2]]
    known = [float(one) for one in numbers if one is not None]
    if len(known) < len(entries) or abs(known[-1] - 1) > UPRIGHT:
        return None
    x, y, z, cosine, sine, _ = known
    return x, y, z, math.atan2(sine, cosine)


def read_filler(ontology: Ontology, term: Term, property_name: str | None = None) -> Filler | None:
    """Read a term as a thing, place, value or name; None for undefined IRIs and anonymous expressions.

    A term of unknown kind that fills a property (IRI) of things is read as an object.
    """
    if isinstance(term, Literal):
        return read_literal(ontology, term, property_name)
    if isinstance(term, BNode):
        return read_described(ontology, term)
    if not ontology.defined(term):
        return None
    if is_place(ontology, term):
        return read_place(ontology, term)
    if property_name is not None and OWL.Class in ontology.values(property_name, RDFS.range):
        return Name(term)
    thing = read_thing(ontology, term)
    if thing is None and property_name is not None and is_of_unknown_kind(ontology, term):
        if names_device(ontology, term, property_name):
            return Thing(Kind.DEVICE, "Arm", _individual(ontology, term), expand("Arm"))
        thing = _unknown(ontology, term) if takes_things(ontology, property_name) else None
    return thing or Name(term)


def read_thing(ontology: Ontology, iri: str) -> Thing | None:
    """Read an individual or a class as a thing; None unless it belongs to a class of things with a position."""
    for cls in classes_of(ontology, iri):
        if is_localised(ontology, cls):
            kind, nearest = kind_of(ontology, cls), nearest_in_vocabulary(ontology, cls)
            says_nothing = nearest in ANYTHING and shorten(cls) == cls  # but that it is a thing with a position
            return Thing(kind, cls if says_nothing else nearest, _individual(ontology, iri), cls)
    return None


def read_described(ontology: Ontology, expression: BNode) -> Thing | None:
    """Read an expression for things of a class that stand in relations to others: ``Cup and on-Physical value table1``.

    None for any other expression.
    """
    named = [one for one in ontology.members(expression) if isinstance(one, str) and not isinstance(one, BNode)]
    if len(named) != 1 or ontology.unread_parts(expression):
        return None
    thing = None if is_place(ontology, named[0]) else read_thing(ontology, named[0])
    where = tuple(_standing(ontology, one) for one in ontology.restrictions(expression))
    if thing is None or thing.kind is not Kind.OBJECT or thing.iri is not None or not where:
        return None
    related = sorted((one for one in where if one is not None), key=lambda one: (one[0], one[1].name))
    return replace(thing, where=tuple(related)) if len(related) == len(where) else None


def _standing(ontology: Ontology, restriction: Restriction) -> tuple[str, Thing] | None:
    """Read a relation to one thing that a restriction requires; None for any other restriction."""
    relation, term = _relation(restriction.property), restriction.filler
    if relation is None or RELATIONS[relation].arity > 1 or restriction.kind not in KINDS:
        return None
    if restriction.cardinality not in (None, 1) or not isinstance(term, str) or isinstance(term, BNode):
        return None
    return None if is_place(ontology, term) or (thing := read_thing(ontology, term)) is None else (relation, thing)


def classes_of(ontology: Ontology, iri: str) -> tuple[str, ...]:
    """The class itself, or the classes of an individual, those with the most ancestors first."""
    if _individual(ontology, iri) is None:
        return (iri,)
    return tuple(sorted(ontology.types(iri), key=lambda cls: (-len(ontology.ancestors(cls)), cls)))


def is_of_unknown_kind(ontology: Ontology, iri: str) -> bool:
    """True if neither the class, nor any class of the individual, has an ancestor in the vocabulary."""
    above = (ancestor for cls in classes_of(ontology, iri) for ancestor in ontology.ancestors(cls))
    return not any(is_vocabulary_class(ancestor) for ancestor in above)


def names_device(ontology: Ontology, term: str, property_name: str) -> bool:
    """True for the device of an action that is of unknown kind, but called an arm, hand or gripper: ``leftArm``."""
    if local_name(property_name) not in DEVICE_PROPERTIES or not is_of_unknown_kind(ontology, term):
        return False
    words = {word for name in (term, *ontology.types(term)) for word in snake_case(local_name(name)).split("_")}
    return not words.isdisjoint(("arm", "hand", "gripper"))


def is_vocabulary_class(cls: str) -> bool:
    """True for a class that the bundled vocabulary defines."""
    short = shorten(cls)
    return short != cls and is_vocabulary(short)


def takes_things(ontology: Ontology, property_name: str) -> bool:
    """True for a property whose range is a class of things with a position."""
    ranges = ontology.iris(property_name, RDFS.range)
    return any(is_localised(ontology, cls) for cls in ranges)


@kept
def takes_numbers(ontology: Ontology, property_name: str) -> bool:
    """True for a property with a numeric range, its own or inherited, or with a physical dimension.

    The dimension follows from the local name, because some recipes have the vocabulary in a namespace of their own. A
    property that the file declares with things or other values has none.
    """
    above = ontology.superproperties(property_name)
    ranges = [range_ for one in above for range_ in ontology.iris(one, RDFS.range)]
    is_ranged = any(range_.startswith(XSD) and range_.removeprefix(XSD) in NUMERIC for range_ in ranges)
    return is_ranged or any(
        dimension_of(local_name(one)) is not None and not _is_declared_otherwise(ontology, one) for one in above
    )


def _is_declared_otherwise(ontology: Ontology, property_name: str) -> bool:
    """True for a property outside the vocabulary that is declared as an object property, or has a range."""
    if shorten(property_name) != property_name:
        return False
    kinds = ontology.values(property_name, RDF.type)
    return OBJECT_PROPERTY in kinds or bool(ontology.values(property_name, RDFS.range))


def _individual(ontology: Ontology, iri: str) -> str | None:
    return iri if ontology.is_individual(iri) and not ontology.is_class(iri) else None


def _unknown(ontology: Ontology, iri: str) -> Thing:
    """Read a thing of unknown kind as an object of its first class."""
    cls = next(iter(classes_of(ontology, iri)), expand(ANYTHING[0]))
    return Thing(Kind.OBJECT, shorten(cls), _individual(ontology, iri), cls)


def is_localised(ontology: Ontology, cls: str) -> bool:
    """True for classes of things with a position: objects, persons, devices."""
    return ontology.is_a(cls, expand("SpatialThing-Localized")) or kind_of(ontology, cls) is not Kind.OBJECT


def read_place(ontology: Ontology, iri: str, seen: frozenset[str] = frozenset()) -> Place:
    """Read a location designator, with its relations in the order of the file.

    An individual is read from its facts, a class from its restrictions. A reference that would close a circle, or that
    is :data:`MOST_PLACES` references away, is dropped. A related thing of unknown kind is read as an object.
    """
    stated: dict[object, tuple[str, dict[Thing | Place, None]]] = {}
    for relation, term in references(ontology, iri):
        if not isinstance(term, str) or (reference := _reference(ontology, term, seen | {iri})) is None:
            continue
        # what one relation to several things relates to is stated by a fact for each
        conjunct = relation if RELATIONS[relation].arity > 1 else (relation, reference)
        stated.setdefault(conjunct, (relation, {}))[1][reference] = None
    relations = tuple((relation, tuple(those)) for relation, those in stated.values())
    return Place(iri, relations, ontology.label(iri), _pose(ontology, iri))


def _reference(ontology: Ontology, term: str, seen: frozenset[str]) -> Thing | Place | None:
    """Read what a place relates to; None if it is undefined, or beyond the limits of :func:`read_place`."""
    if term in seen or (is_place(ontology, term) and len(seen) >= MOST_PLACES):
        return None
    if is_place(ontology, term):
        return read_place(ontology, term, seen)
    thing = read_thing(ontology, term)
    if thing is None and ontology.defined(term) and is_of_unknown_kind(ontology, term):
        return _unknown(ontology, term)
    return thing


def is_relation(property_name: str) -> bool:
    """True for a property (IRI) that relates location designators to things and places."""
    return _relation(property_name) is not None


def references_of_unknown_kind(ontology: Ontology, place: str) -> list[tuple[str, str]]:
    """List the relations of a location designator to defined things of unknown kind."""
    return [
        (relation, term)
        for relation, term in references(ontology, place)
        if isinstance(term, str)
        and not isinstance(term, BNode)
        and ontology.defined(term)
        and not is_place(ontology, term)
        and is_of_unknown_kind(ontology, term)
    ]


def unread_references(ontology: Ontology, place: str) -> list[str]:
    """List the undefined IRIs that a location designator refers to."""
    return [
        term for _, term in references(ontology, place) if isinstance(term, str) and read_filler(ontology, term) is None
    ]


def references(ontology: Ontology, place: str) -> Iterator[tuple[str, Term]]:
    """Yield the relations of a location designator, with the related terms, from its facts and restrictions."""
    for triple in ontology.triples(s=place):
        if (relation := _relation(triple.predicate)) is not None:
            yield relation, triple.object
    for restriction in ontology.restrictions(place):
        relation = _relation(restriction.property)
        if relation is not None and restriction.kind in KINDS and restriction.cardinality != 0:
            yield relation, restriction.filler


def _relation(property_name: str) -> str | None:
    """Relation that a property (IRI) stands for, if any."""
    return of_owl_property(shorten(property_name))


def read_literal(ontology: Ontology, literal: Literal, property_name: str | None) -> str | int | float | bool:
    """Convert a value of a property (IRI) to a Python value; numbers with units to the unit of the property.

    Untyped text is read as a number if the property takes numbers. Malformed numbers are returned as text.
    """
    if unit_of(literal) is not None:
        try:
            return float(stated_number(literal, unit_of_property(local_name(property_name or ""))))
        except ValueError:
            return literal.value
    datatype = local_name(literal.datatype or "")
    if datatype == "boolean":
        return literal.value.strip() in ("true", "1")
    is_number = datatype in TEXT and property_name is not None and takes_numbers(ontology, property_name)
    if datatype in NUMERIC or is_number:
        try:
            number = literal.number()
        except ValueError:
            return literal.value
        return int(number) if datatype in _INTEGERS and number == int(number) else float(number)
    return literal.value


CONSTRAINED_BY = "constrainedBy"
"""The property of motions whose fillers add up instead of replacing inherited ones."""

NO_PARAMETERS = (
    *ON_ACTIONS,
    "dependsOnCapability",
    "dependsOnComponent",
    "hasCapability",
    "hasCapabilityDependency",
    "providedByMotionPrimitive",
    "lispClass",
    "startTime",
    "endTime",
)
"""Properties of actions (local names) about their steps, requirements and times, which are not parameters."""

READ_BY_DIALECTS = (*ON_INDIVIDUALS, "adtChunkSupport")
"""Properties of individuals (local names) that the readers of dialects read."""


def fillings(ontology: Ontology, iri: str, more: tuple[Filling, ...] = ()) -> Iterator[list[Filling]]:
    """Yield the fillers of an action, nearest first: ``more``, those of its facts, of its class, of its ancestors.

    Superclasses and equivalent classes count alike. Restrictions of the bundled vocabulary do not count.
    """
    yield [filling for filling in more if _may_fill(filling.property)]
    cls = iri
    if not ontology.is_class(iri):
        cls = action_class(ontology, iri) or iri
        yield [filling for filling in _facts(ontology, iri) if _may_fill(filling.property)]
    yield from _levels(ontology, cls)


@kept
def _levels(ontology: Ontology, cls: str) -> list[list[Filling]]:
    """Fillings from the restrictions of a class and of its ancestors, nearest first."""
    return [level for ancestor in ontology.ancestors(cls) if (level := _restricted(ontology, ancestor))]


def _may_fill(property_name: str) -> bool:
    """True for a property (IRI) that may be a parameter of an action."""
    return not is_word(property_name, *NO_PARAMETERS, *REGISTERED_WORDS)


@kept
def _restricted(ontology: Ontology, cls: str) -> list[Filling]:
    """Fillings from the restrictions of a class; none for classes of the bundled vocabulary, of SOMA and of DUL."""
    is_users = (shorten(cls) == cls and not cls.startswith(UPPER)) or ontology.main(cls)
    every = fillings_of(ontology.restrictions(cls)) if is_users else ()
    return [filling for filling in every if _may_fill(filling.property)]


def read_parameters(
    ontology: Ontology, iri: str, more: tuple[Filling, ...] = (), created: frozenset[str] = frozenset()
) -> tuple[Parameter, ...]:
    """Read the parameters of an action: ``more``, its own, and those of its ancestors.

    A nearer filler replaces a farther one of the same property; constraints of motions add up. A robot part stated as a
    body part is read as the device used. ``created`` are individuals that another step creates: they may be undefined.
    """
    by_property: dict[str, list[Parameter]] = {}
    for level in fillings(ontology, iri, more):
        nearer = set(by_property)
        for filling in level:
            parameter = _parameter(ontology, filling, created)
            if parameter is not None and (parameter.property not in nearer or parameter.property == CONSTRAINED_BY):
                by_property.setdefault(parameter.property, []).append(parameter)
    return tuple(dict.fromkeys(parameter for parameters in by_property.values() for parameter in parameters))


def action_class(ontology: Ontology, individual: str) -> str | None:
    """Find the class of actions of an individual: its most specific type below Action, else Event, else any known type.

    The type with the most superclasses is the most specific: a grasp rather than a chunk of a table.
    """
    types = ontology.types(individual)
    for top in ("Action", "Event"):
        if fitting := [cls for cls in types if ontology.is_a(cls, expand(top))]:
            return max(fitting, key=lambda cls: len(ontology.ancestors(cls)))
    return next((cls for cls in types if len(ontology.ancestors(cls)) > 1), next(iter(types), None))


def unread_facts(ontology: Ontology, individual: str) -> Iterator[Filling]:
    """Yield the facts of an individual that are neither parameters of an action nor read otherwise."""
    for triple in ontology.triples(s=individual):
        name = triple.predicate
        is_bookkeeping = is_word(name, *NO_PARAMETERS, *READ_BY_DIALECTS, *REGISTERED_WORDS)
        is_bookkeeping |= name.startswith((OWL, RDF, RDFS))
        is_bookkeeping |= OWL.AnnotationProperty in ontology.values(name, RDF.type)
        if not is_bookkeeping and not _is_of_actions(ontology, name):
            yield Filling(name, triple.object, triple.span)


def _facts(ontology: Ontology, individual: str) -> Iterator[Filling]:
    """Yield the facts of an individual in properties that the vocabulary lists for actions."""
    for triple in ontology.triples(s=individual):
        if _is_of_actions(ontology, triple.predicate):
            yield Filling(triple.predicate, triple.object, triple.span)


@kept
def action_properties(ontology: Ontology) -> tuple[str, ...]:
    """Properties (IRIs) that the vocabulary lists for any class of actions."""
    properties = {triple.object: None for triple in ontology.triples(p=expand("hasParameter"))}
    return tuple(name for name in properties if isinstance(name, str))


@kept
def _is_of_actions(ontology: Ontology, property_name: str) -> bool:
    """True for a property that the vocabulary lists for a class of actions, or a subproperty of one."""
    return any(
        True
        for above in ontology.superproperties(property_name)
        for _ in ontology.triples(p=expand("hasParameter"), o=above)
    )


def _parameter(ontology: Ontology, filling: Filling, created: frozenset[str]) -> Parameter | None:
    filler = read_filler(ontology, filling.term, filling.property)
    if filler is None and filling.term in created:
        filler = Name(str(filling.term))
    if filler is None:
        return None
    property_name = shorten(filling.property)
    is_device_filler = isinstance(filler, Thing) and filler.kind is Kind.DEVICE
    if property_name == "bodyPartsUsed" and (is_device_filler or _is_device_term(ontology, filling.term)):
        property_name = "deviceUsed"
    return Parameter(property_name, filler, filling.span, number=filling.number if is_counted(filling, filler) else 1)


def is_counted(filling: Filling, filler: Filler | None) -> bool:
    """True for a number of different objects of a class that an action is about: ``objectActedOn exactly 3 Cup``."""
    is_stated = filling.kind == "exactly" and local_name(filling.property) == "objectActedOn"
    return is_stated and isinstance(filler, Thing) and filler.kind is Kind.OBJECT and filler.iri is None


def _is_device_term(ontology: Ontology, term: Term) -> bool:
    return (
        isinstance(term, str)
        and not isinstance(term, BNode)
        and any(is_device(ontology, cls) for cls in (ontology.types(term) or (term,)))
    )
