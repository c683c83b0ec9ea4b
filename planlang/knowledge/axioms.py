"""The part of an ontology that the profile OWL 2 EL can say, as axioms for :mod:`planlang.knowledge.completion`.

What EL cannot say (universal and negated conditions, unions and upper bounds above a class) is left out: answers that
follow from the rest are right, and some that would follow from all may be missing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from planlang.ontology import BNode, Literal, Ontology, Term
from planlang.ontology.classes import twin
from planlang.ontology.expression_text import expression_of
from planlang.ontology.expressions import Expression
from planlang.ontology.terms import OWL, RDF, RDFS, ROBOEARTH, XSD

THING, NOTHING = str(OWL.Thing), str(OWL.Nothing)


@dataclass(frozen=True, slots=True)
class Some:
    """``property some filler``."""

    property: str
    filler: Concept


@dataclass(frozen=True, slots=True)
class And:
    """Both at once."""

    left: Concept
    right: Concept


@dataclass(frozen=True, slots=True)
class One:
    """The class of a single individual (IRI)."""

    individual: str


Concept = str | Some | And | One
"""A class expression of EL; a named class is its IRI."""


@dataclass(slots=True)
class Axioms:
    """Inclusions of concepts, and the hierarchy of properties. IRIs throughout."""

    above: dict[Concept, list[Concept]] = field(default_factory=dict)
    """Each concept with those stated to include it; both directions of an equivalence."""
    properties_above: dict[str, set[str]] = field(default_factory=dict)
    transitive: set[str] = field(default_factory=set)
    domains: dict[str, list[Concept]] = field(default_factory=dict)
    ranges: dict[str, list[Concept]] = field(default_factory=dict)
    disjoint: list[tuple[str, str]] = field(default_factory=list)

    def state(self, lower: Concept, upper: Concept) -> None:
        """Add that one concept is below another."""
        if lower != upper:
            self.above.setdefault(lower, []).append(upper)


def axioms_of(ontology: Ontology) -> Axioms:
    """Return what an ontology states in EL, of classes, properties and individuals."""
    found = Axioms()
    for cls in ontology.taxonomy.classes():
        for upper in ontology.taxonomy.parents(cls):
            found.state(cls, upper)
    _read_class_axioms(ontology, found)
    _read_property_axioms(ontology, found, ontology)
    _read_facts(ontology, found, ontology)
    return found


def own_axioms_of(ontology: Ontology, vocabulary: Axioms) -> Axioms:
    """Return what the main document of an ontology states in EL, and which of its names are below others.

    ``vocabulary`` is what the other documents state: it is not repeated.
    """
    main = ontology.alone()
    found = Axioms()
    for name in dict.fromkeys(term for term in main.store.terms if isinstance(term, str)):
        known = vocabulary.above.get(name, ())
        for upper in ontology.taxonomy.parents(name):
            if upper not in known:
                found.state(name, upper)
    _read_class_axioms(main, found)
    _read_property_axioms(main, found, ontology)
    _read_facts(main, found, ontology)
    return found


def _read_class_axioms(ontology: Ontology, found: Axioms) -> None:
    for prop, is_definition in ((RDFS.subClassOf, False), (OWL.equivalentClass, True)):
        for triple in ontology.triples(p=prop):
            if isinstance(triple.subject, BNode) and isinstance(triple.object, BNode) and is_definition:
                continue
            _relate(ontology, triple.subject, triple.object, found, is_definition=is_definition)
    for triple in ontology.triples(p=OWL.intersectionOf):
        if isinstance(triple.subject, str):
            defined = concept(_intersection(ontology, triple.subject))
            if defined is not None:
                found.state(triple.subject, defined)
                found.state(defined, triple.subject)
    for triple in ontology.triples(p=OWL.disjointWith):
        if isinstance(triple.subject, str) and isinstance(triple.object, str):
            found.disjoint.append((triple.subject, triple.object))


def _relate(ontology: Ontology, lower: Term, upper: Term, found: Axioms, *, is_definition: bool) -> None:
    span = next(ontology.triples(s=lower)).span if not isinstance(lower, Literal) else None
    assert span is not None
    left, right = (expression_of(ontology, term, span) for term in (lower, upper))
    if left is None or right is None or (left.kind == right.kind == "name" and not is_definition):
        return
    below = concept(left)
    if below is not None:
        for implied in implied_by(right):
            found.state(below, implied)
    above = concept(right)
    if is_definition and above is not None:
        for implied in implied_by(left):
            found.state(above, implied)


def _intersection(ontology: Ontology, cls: str) -> Expression | None:
    (triple, *_) = ontology.triples(cls, OWL.intersectionOf)
    members = [expression_of(ontology, member, triple.span) for member in _items(ontology, triple.object)]
    parts = tuple(member for member in members if member is not None)
    return Expression("and", triple.span, parts=parts) if parts and len(parts) == len(members) else None


def _items(ontology: Ontology, cell: Term) -> Iterator[Term]:
    seen = set()
    while isinstance(cell, BNode) and cell not in seen:
        seen.add(cell)
        yield from ontology.values(cell, RDF.first)
        cell = ontology.value(cell, RDF.rest) or RDF.nil


def _read_property_axioms(ontology: Ontology, found: Axioms, known: Ontology) -> None:
    for name in ontology.store.terms:
        other = twin(name) if isinstance(name, str) and name.startswith(ROBOEARTH) else None
        if isinstance(name, str) and other is not None and known.is_property(other):
            found.properties_above[name] = {*ontology.superproperties(name), *known.superproperties(other)}
    for p in (RDFS.subPropertyOf, OWL.equivalentProperty):
        for triple in ontology.triples(p=p):
            for prop in (triple.subject, triple.object):
                if isinstance(prop, str) and prop not in found.properties_above:
                    found.properties_above[prop] = set(ontology.superproperties(prop))
    for triple in ontology.triples(p=RDF.type, o=OWL.TransitiveProperty):
        found.transitive.add(str(triple.subject))
    for p, stated in ((RDFS.domain, found.domains), (RDFS.range, found.ranges)):
        for triple in ontology.triples(p=p):
            expression = expression_of(ontology, triple.object, triple.span)
            if isinstance(triple.subject, str) and expression is not None and not _is_data(expression):
                stated.setdefault(triple.subject, []).extend(implied_by(expression))


def _is_data(expression: Expression) -> bool:
    return expression.kind == "facets" or str(expression.term).startswith((str(XSD), str(RDFS)))


def _read_facts(ontology: Ontology, found: Axioms, known: Ontology) -> None:
    """Read what individuals are and what they are linked to, as axioms about their own classes.

    A link to what is a class for ``known``, as a model has that is for one, is a link to something of the class, too.
    """
    language = (str(OWL), str(RDF), str(RDFS))
    individuals = {
        triple.subject: None
        for triple in ontology.triples(p=RDF.type)
        if isinstance(triple.subject, str) and not str(triple.object).startswith(language)
    }
    for individual in individuals:
        for triple in ontology.triples(s=individual):
            if triple.predicate == RDF.type:
                kind = expression_of(ontology, triple.object, triple.span)
                for implied in implied_by(kind) if kind is not None else ():
                    if not (isinstance(implied, str) and implied.startswith(language)):
                        found.state(One(individual), implied)
            elif isinstance(triple.object, str) and not triple.predicate.startswith(language):
                found.state(One(individual), Some(triple.predicate, One(triple.object)))
                if known.is_class(triple.object):
                    found.state(One(individual), Some(triple.predicate, triple.object))
                for prop in found.properties_above.get(triple.predicate, {triple.predicate}):
                    for implied in found.ranges.get(prop, ()):
                        found.state(One(triple.object), implied)


def concept(expression: Expression | None) -> Concept | None:
    """Return an expression of EL as a concept; None for any other, also if only a part of it is another."""
    if expression is None:
        return None
    parts = expression.parts
    match expression.kind:
        case "name" if isinstance(expression.term, str):
            return expression.term
        case "one of" if len(parts) == 1 and isinstance(parts[0].term, str):
            return One(parts[0].term)
        case "value" if isinstance(parts[1].term, str) and parts[0].kind == "name":
            return Some(str(parts[0].term), One(parts[1].term))
        case "and":
            return _all(concept(part) for part in parts)
        case "some" | "min" if parts[0].kind == "name" and (expression.kind == "some" or expression.number == 1):
            filler = concept(parts[1]) if len(parts) > 1 else THING
            return None if filler is None else Some(str(parts[0].term), filler)
    return None


def _all(found: Iterable[Concept | None]) -> Concept | None:
    together: Concept | None = None
    for one in found:
        if one is None:
            return None
        together = one if together is None else And(together, one)
    return together


def implied_by(expression: Expression) -> Iterator[Concept]:
    """Yield concepts of EL that together say as much of an expression as EL can."""
    parts = expression.parts
    if expression.kind == "and":
        for part in parts:
            yield from implied_by(part)
    elif expression.kind in ("some", "min", "exactly") and parts[0].kind == "name":
        if expression.kind == "some" or expression.number > 0:
            fillers = tuple(implied_by(parts[1])) if len(parts) > 1 else ()
            filler = _all(fillers) if fillers else THING
            assert filler is not None
            yield Some(str(parts[0].term), filler)
    else:
        whole = concept(expression)
        if whole is not None:
            yield whole
