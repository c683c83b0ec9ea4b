"""Closed-world evaluation of class expressions for individuals: true, false, or None if a class is undefined."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

from planlang.designators import local_name
from planlang.ontology import BNode, Literal, Ontology, Term
from planlang.ontology.expression_text import expression_of
from planlang.ontology.expressions import Expression
from planlang.ontology.terms import OWL, RDFS, XSD
from planlang.units import stated_number, unit, unit_of

DEEPEST = 30
"""Greatest depth of nested definitions; deeper ones are unknown."""

_NUMBERS = ("float", "double", "decimal", "integer", "int", "long", "short", "byte", "nonNegativeInteger",
            "positiveInteger", "nonPositiveInteger", "negativeInteger", "unsignedInt", "unsignedLong")  # fmt: skip
_WHOLE = frozenset(XSD + name for name in _NUMBERS[3:])
_FRACTIONS = frozenset(XSD + name for name in _NUMBERS[:3])


class ClosedWorld:
    """The union of some ontologies, taken as all there is to know about individuals."""

    def __init__(self, ontologies: Iterable[Ontology]) -> None:
        self.ontologies: Sequence[Ontology] = tuple({id(one): one for one in ontologies}.values())
        self._above: dict[str, frozenset[str]] = {}
        self._classes: dict[Term, frozenset[str]] = {}
        self._types: dict[Term, tuple[str, ...]] = {}
        self._defined: dict[str, tuple[Sequence[Expression], bool]] = {}

    def is_known(self, cls: str) -> bool:
        """Check whether any of the ontologies defines a class."""
        return cls.startswith((OWL, RDFS, XSD)) or any(one.defined(cls) for one in self.ontologies)

    def is_below(self, cls: str, upper: str) -> bool:
        """Check whether a class is another one or a subclass of it in any of the ontologies."""
        return upper in (self._above.get(cls) or self.above((cls,)))

    def above(self, classes: Iterable[str]) -> frozenset[str]:
        """Collect classes and all their superclasses in any of the ontologies."""
        for cls in (cls for cls in classes if cls not in self._above):
            ancestors = (one.taxonomy.ancestors(cls) for one in self.ontologies)
            self._above[cls] = frozenset((cls,)).union(*ancestors)
        return frozenset().union(*(self._above[cls] for cls in classes))

    def types(self, thing: Term) -> tuple[str, ...]:
        """List the stated classes of an individual."""
        if isinstance(thing, Literal):
            return ()
        if thing not in self._types:
            self._types[thing] = tuple(dict.fromkeys(cls for one in self.ontologies for cls in one.types(thing)))
        return self._types[thing]

    def values(self, thing: Term, prop: Expression) -> tuple[Term, ...]:
        """List the values of a property, its subproperties or an inverse property for an individual."""
        if isinstance(thing, Literal):
            return ()
        if prop.kind == "inverse":
            name = prop.parts[0].term
            subjects = [
                t.subject
                for one in self.ontologies
                for below in one.subproperties(str(name))
                for t in one.triples(None, below, thing)
            ]
            return tuple(dict.fromkeys(subjects))
        name = prop.term
        return tuple(dict.fromkeys(v for o in self.ontologies for v in o.values_below(thing, str(name))))

    def satisfies(self, thing: Term, expression: Expression, depth: int = DEEPEST) -> bool | None:
        """Evaluate whether an individual or a literal is in a class or a data range; None if that is unknown."""
        return combined(expression, lambda part: self._is_in(thing, part, depth)) if depth else None

    def _is_in(self, thing: Term, expression: Expression, depth: int) -> bool | None:
        parts = expression.parts
        match expression.kind:
            case "name":
                return self._named(thing, expression.term, depth)
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
        return cardinality(expression.kind, expression.number, answers)

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
        definitions, is_known = self._definitions(cls)
        if definitions:
            return disjunction([self.satisfies(thing, one, depth - 1) for one in definitions])
        return False if is_known else None

    def _definitions(self, cls: str) -> tuple[Sequence[Expression], bool]:
        """Look up the equivalent expressions of a class, and whether any ontology defines it; results are cached."""
        if cls not in self._defined:
            expressions = (
                expression_of(one, triple.object, triple.span)
                for one in self.ontologies
                for triple in one.triples(cls, OWL.equivalentClass)
                if isinstance(triple.object, BNode)
            )
            self._defined[cls] = [one for one in expressions if one is not None], self.is_known(cls)
        return self._defined[cls]


def cardinality(kind: str, number: int, answers: Iterable[bool | None]) -> bool | None:
    """Evaluate a cardinality "min", "max" or "exactly" over truth values; None if unknown ones could change it."""
    answers = list(answers)
    least = sum(answer is True for answer in answers)
    most = least + sum(answer is None for answer in answers)
    outcomes = {
        count >= number if kind == "min" else count <= number if kind == "max" else count == number
        for count in range(least, most + 1)
    }
    return outcomes.pop() if len(outcomes) == 1 else None


def conjunction(answers: Iterable[bool | None]) -> bool | None:
    """Conjunction in Kleene's three-valued logic; None is unknown."""
    values = list(answers)
    return False if False in values else None if None in values else True


def disjunction(answers: Iterable[bool | None]) -> bool | None:
    """Disjunction in Kleene's three-valued logic; None is unknown."""
    values = list(answers)
    return True if True in values else None if None in values else False


def combined(expression: Expression, decide: Callable[[Expression], bool | None]) -> bool | None:
    """Evaluate what an expression combines by and, or, not, in the same logic; ``decide`` evaluates the other parts."""
    answers = (combined(part, decide) for part in expression.parts)
    match expression.kind:
        case "and":
            return conjunction(answers)
        case "or":
            return disjunction(answers)
        case "not":
            answer = next(answers)
            return None if answer is None else not answer
    return decide(expression)


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
    """Convert two literals to numbers in one unit. Raises ValueError if one is not a number, or their units differ."""
    first, second = unit_of(one), unit_of(other)
    if first is not None and second is not None and unit(first) is not None:
        return one.number(), stated_number(other, first)
    return stated_number(one), stated_number(other)


def _of_datatype(value: Literal, datatype: str) -> bool | None:
    if datatype in (RDFS.Literal, value.datatype):
        return True
    own_type = value.datatype or XSD.string
    name = unit_of(value)
    own_unit, datatype_unit = unit(name or ""), unit(local_name(datatype))
    if own_unit is not None and (datatype in _FRACTIONS or datatype_unit is not None):
        return datatype_unit is None or own_unit.dimension == datatype_unit.dimension
    if datatype == XSD.string or not datatype.startswith(XSD):
        return own_type == datatype if datatype.startswith(XSD) else None
    if own_type in _WHOLE and (datatype in _FRACTIONS or datatype == XSD.integer):
        return True
    if own_type in _FRACTIONS and datatype in _FRACTIONS:
        return True
    if datatype in (XSD.nonNegativeInteger, XSD.positiveInteger) and own_type in _WHOLE:
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
            return cardinality(lengths[name], int(bound.number()), [True] * len(value.value))
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
