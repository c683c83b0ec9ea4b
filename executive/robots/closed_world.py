"""Class expressions evaluated against individuals in a closed world: what no ontology says is not so.

OWL 2 structural specification, sections 7 and 8. Answers are three-valued (S. C. Kleene, 1952): None when an expression
names a class about which nothing is known, or asks what is not evaluated (patterns, which a stranger may have written).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from planlang.ontology import BNode, Literal, Ontology, Term
from planlang.ontology.expressions import Expression
from planlang.ontology.terms import OWL, RDFS, XSD
from planlang.ontology.writing.expression_text import expression_of

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

    def is_known(self, cls: str) -> bool:
        """Return True if any of the ontologies defines a class."""
        return cls.startswith((OWL, RDFS, XSD)) or any(one.defined(cls) for one in self.ontologies)

    def is_below(self, cls: str, upper: str) -> bool:
        """Return True if a class is another one or below it, by any of the ontologies."""
        above = self._above.get(cls)
        if above is None:
            found = (one.taxonomy.ancestors(cls) for one in self.ontologies)
            above = self._above[cls] = frozenset((cls,)).union(*found)
        return upper in above

    def types(self, thing: Term) -> tuple[str, ...]:
        """The classes that an individual is said to be of."""
        if isinstance(thing, Literal):
            return ()
        return tuple(dict.fromkeys(cls for one in self.ontologies for cls in one.types(thing)))

    def values(self, thing: Term, prop: Expression) -> tuple[Term, ...]:
        """What an individual has by a property or one below it, or by the inverse of one."""
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
        """Whether an individual or a value is in a class or a data range; None if nothing is known of that."""
        if depth == 0:
            return None
        kind, parts = expression.kind, expression.parts
        match kind:
            case "name":
                return self._named(thing, expression.term, depth)
            case "and":
                return _all(self.satisfies(thing, part, depth - 1) for part in parts)
            case "or":
                return _any(self.satisfies(thing, part, depth - 1) for part in parts)
            case "not":
                return _not(self.satisfies(thing, parts[0], depth - 1))
            case "one of":
                return any(_same(thing, part.term) for part in parts)
            case "facets":
                return _all(
                    [self.satisfies(thing, parts[0], depth - 1), *(_facet(thing, *f) for f in expression.facets)]
                )
            case "value":
                return any(_same(value, parts[1].term) for value in self.values(thing, parts[0]))
            case "Self":
                return thing in self.values(thing, parts[0])
            case "some":
                return _any(self.satisfies(value, parts[1], depth - 1) for value in self.values(thing, parts[0]))
            case "only":
                return _all(self.satisfies(value, parts[1], depth - 1) for value in self.values(thing, parts[0]))
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
        if any(self.is_below(kind, cls) for kind in self.types(thing)):
            return True
        definitions = [
            expression_of(one, triple.object, triple.span)
            for one in self.ontologies
            for triple in one.triples(cls, OWL.equivalentClass)
            if isinstance(triple.object, BNode)
        ]
        defined = [self.satisfies(thing, known, depth - 1) for known in definitions if known is not None]
        if defined:
            return _any(defined)
        return False if self.is_known(cls) else None


def compared(kind: str, number: int, answers: Iterable[bool | None]) -> bool | None:
    """Whether as many answers are true as "min", "max" or "exactly" so many asks for; None if that depends."""
    answers = list(answers)
    surely = sum(answer is True for answer in answers)
    perhaps = surely + sum(answer is None for answer in answers)
    possible = range(surely, perhaps + 1)
    found = {
        count >= number if kind == "min" else count <= number if kind == "max" else count == number
        for count in possible
    }
    return found.pop() if len(found) == 1 else None


def _all(answers: Iterable[bool | None]) -> bool | None:
    found = list(answers)
    return False if False in found else None if None in found else True


def _any(answers: Iterable[bool | None]) -> bool | None:
    found = list(answers)
    return True if True in found else None if None in found else False


def _not(answer: bool | None) -> bool | None:
    return None if answer is None else not answer


def _same(one: Term, other: Term | None) -> bool:
    if one == other:
        return True
    if isinstance(one, Literal) and isinstance(other, Literal):
        try:
            return one.number() == other.number()
        except ValueError:
            return False
    return False


def _of_datatype(value: Literal, datatype: str) -> bool | None:
    if datatype in (RDFS.Literal, value.datatype):
        return True
    stated = value.datatype or XSD.string
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
        number, limit = value.number(), bound.number()
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
