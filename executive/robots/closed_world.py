"""Class expressions asked of individuals of which everything is known: yes, no, or unknown where that is not said."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from planlang.designators import local_name
from planlang.ontology import BNode, Literal, Ontology, Term
from planlang.ontology.expression_text import expression_of
from planlang.ontology.expressions import Expression
from planlang.ontology.terms import OWL, RDFS, XSD
from planlang.units import stated_number, unit, unit_of

DEEPEST = 30
"""Definitions inside definitions that are looked into."""

_NUMBERS = ("float", "double", "decimal", "integer", "int", "long", "short", "byte", "nonNegativeInteger",
            "positiveInteger", "nonPositiveInteger", "negativeInteger", "unsignedInt", "unsignedLong")  # fmt: skip
_WHOLE = frozenset(XSD + name for name in _NUMBERS[3:])
_FRACTIONS = frozenset(XSD + name for name in _NUMBERS[:3])


class ClosedWorld:
    """Everything that some ontologies say together about individuals."""

    def __init__(self, ontologies: Iterable[Ontology]) -> None:
        self.ontologies: Sequence[Ontology] = tuple({id(one): one for one in ontologies}.values())
        self._above: dict[str, frozenset[str]] = {}
        self._classes: dict[Term, frozenset[str]] = {}
        self._types: dict[Term, tuple[str, ...]] = {}
        self._defined: dict[str, tuple[Sequence[Expression], bool]] = {}

    def is_known(self, cls: str) -> bool:
        """Return True if any of the ontologies defines a class."""
        return cls.startswith((OWL, RDFS, XSD)) or any(one.defined(cls) for one in self.ontologies)

    def is_below(self, cls: str, upper: str) -> bool:
        """Return True if a class is another one or below it, by any of the ontologies."""
        return upper in (self._above.get(cls) or self.above((cls,)))

    def above(self, classes: Iterable[str]) -> frozenset[str]:
        """Return classes and all that are above any of them, by any of the ontologies."""
        for cls in (cls for cls in classes if cls not in self._above):
            found = (one.taxonomy.ancestors(cls) for one in self.ontologies)
            self._above[cls] = frozenset((cls,)).union(*found)
        return frozenset().union(*(self._above[cls] for cls in classes))

    def types(self, thing: Term) -> tuple[str, ...]:
        """Return the classes that an individual is stated to be of."""
        if isinstance(thing, Literal):
            return ()
        if thing not in self._types:
            self._types[thing] = tuple(dict.fromkeys(cls for one in self.ontologies for cls in one.types(thing)))
        return self._types[thing]

    def values(self, thing: Term, prop: Expression) -> tuple[Term, ...]:
        """Return what an individual has by a property or one below it, or by the inverse of one."""
        if isinstance(thing, Literal):
            return ()
        if prop.kind == "inverse":
            name = prop.parts[0].term
            found = [
                t.subject
                for one in self.ontologies
                for below in one.subproperties(str(name))
                for t in one.triples(None, below, thing)
            ]
            return tuple(dict.fromkeys(found))
        name = prop.term
        return tuple(dict.fromkeys(v for o in self.ontologies for v in o.values(thing, str(name), subproperties=True)))

    def satisfies(self, thing: Term, expression: Expression, depth: int = DEEPEST) -> bool | None:
        """Return whether an individual or a value is in a class or a data range; None if nothing is known of that."""
        if depth == 0:
            return None
        kind, parts = expression.kind, expression.parts
        match kind:
            case "name":
                return self._named(thing, expression.term, depth)
            case "and":
                return conjunction(self.satisfies(thing, part, depth - 1) for part in parts)
            case "or":
                return disjunction(self.satisfies(thing, part, depth - 1) for part in parts)
            case "not":
                return negation(self.satisfies(thing, parts[0], depth - 1))
            case "one of":
                return any(_same(thing, part.term) for part in parts)
            case "facets":
                return conjunction(
                    [self.satisfies(thing, parts[0], depth - 1), *(_facet(thing, *f) for f in expression.facets)]
                )
            case "value":
                return any(_same(value, parts[1].term) for value in self.values(thing, parts[0]))
            case "Self":
                return thing in self.values(thing, parts[0])
            case "some":
                return disjunction(self.satisfies(value, parts[1], depth - 1) for value in self.values(thing, parts[0]))
            case "only":
                return conjunction(self.satisfies(value, parts[1], depth - 1) for value in self.values(thing, parts[0]))
        return self._counted(thing, expression, depth)

    def _counted(self, thing: Term, expression: Expression, depth: int) -> bool | None:
        prop, *fillers = expression.parts
        answers = [
            self.satisfies(value, fillers[0], depth - 1) if fillers else True for value in self.values(thing, prop)
        ]
        return compared(expression.kind, expression.number, answers)

    def _named(self, thing: Term, cls: Term | None, depth: int) -> bool | None:
        if isinstance(thing, Literal):
            return _of_datatype(thing, str(cls))
        if cls in (OWL.Thing, OWL.Nothing):
            return cls == OWL.Thing
        if not isinstance(cls, str):
            return None
        if thing not in self._classes:
            self._classes[thing] = self.above(self.types(thing))
        if cls in self._classes[thing]:
            return True
        definitions, known = self._definitions(cls)
        if definitions:
            return disjunction([self.satisfies(thing, one, depth - 1) for one in definitions])
        return False if known else None

    def _definitions(self, cls: str) -> tuple[Sequence[Expression], bool]:
        """Return what a class is defined to be the same as, and whether any ontology knows it; each looked up once."""
        if cls not in self._defined:
            found = (
                expression_of(one, triple.object, triple.span)
                for one in self.ontologies
                for triple in one.triples(cls, OWL.equivalentClass)
                if isinstance(triple.object, BNode)
            )
            self._defined[cls] = [one for one in found if one is not None], self.is_known(cls)
        return self._defined[cls]


def compared(kind: str, number: int, answers: Iterable[bool | None]) -> bool | None:
    """Return whether as many answers are true as "min", "max" or "exactly" so many asks for; None if that depends."""
    answers = list(answers)
    surely = sum(answer is True for answer in answers)
    perhaps = surely + sum(answer is None for answer in answers)
    possible = range(surely, perhaps + 1)
    found = {
        count >= number if kind == "min" else count <= number if kind == "max" else count == number
        for count in possible
    }
    return found.pop() if len(found) == 1 else None


def conjunction(answers: Iterable[bool | None]) -> bool | None:
    """Return whether all hold; None if that is not known."""
    found = list(answers)
    return False if False in found else None if None in found else True


def disjunction(answers: Iterable[bool | None]) -> bool | None:
    """Return whether any holds; None if that is not known."""
    found = list(answers)
    return True if True in found else None if None in found else False


def negation(answer: bool | None) -> bool | None:
    """Return the opposite; None if that is not known."""
    return None if answer is None else not answer


def _same(one: Term, other: Term | None) -> bool:
    if one == other:
        return True
    if isinstance(one, Literal) and isinstance(other, Literal):
        try:
            return math.isclose(*_numbers(one, other), rel_tol=1e-9)
        except ValueError:
            return False
    return False


def _numbers(one: Literal, other: Literal) -> tuple[float, float]:
    """Return two numbers in one unit; raises ValueError if one is none, or their units have no common dimension."""
    first, second = unit_of(one), unit_of(other)
    if first is not None and second is not None and unit(first) is not None:
        return one.number(), stated_number(other, first)
    return stated_number(one), stated_number(other)


def _of_datatype(value: Literal, datatype: str) -> bool | None:
    if datatype in (RDFS.Literal, value.datatype):
        return True
    stated = value.datatype or XSD.string
    name = unit_of(value)
    own, wanted = unit(name or ""), unit(local_name(datatype))
    if own is not None and (datatype in _FRACTIONS or wanted is not None):
        return wanted is None or own.dimension == wanted.dimension
    if datatype == XSD.string or not datatype.startswith(XSD):
        return stated == datatype if datatype.startswith(XSD) else None
    if stated in _WHOLE and (datatype in _FRACTIONS or datatype == XSD.integer):
        return True
    if stated in _FRACTIONS and datatype in _FRACTIONS:
        return True
    if datatype in (XSD.nonNegativeInteger, XSD.positiveInteger) and stated in _WHOLE:
        try:
            return value.number() >= (datatype == XSD.positiveInteger)
        except ValueError:
            return False
    return False


def _facet(value: Term, facet: str, bound: Literal) -> bool | None:
    if not isinstance(value, Literal):
        return False
    name = facet.removeprefix(XSD)
    lengths = {"length": "exactly", "minLength": "min", "maxLength": "max"}
    try:
        if name in lengths:
            return compared(lengths[name], int(bound.number()), [True] * len(value.value))
        number, limit = _numbers(value, bound)
    except ValueError:
        return False
    match name:
        case "minInclusive":
            return number >= limit
        case "minExclusive":
            return number > limit
        case "maxInclusive":
            return number <= limit
        case "maxExclusive":
            return number < limit
    return None
