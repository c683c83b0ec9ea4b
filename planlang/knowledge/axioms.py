"""The OWL 2 EL part of an ontology, as axioms for :mod:`planlang.knowledge.completion`.

Axioms beyond EL (universal and negated restrictions, unions and upper bounds as superclasses) are dropped. Reasoning
with the rest is sound, but answers that depend on the dropped axioms are missing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import field, replace

from planlang.closure import grouped
from planlang.ontology import Ontology
from planlang.ontology.classes import twin
from planlang.ontology.expression_text import expression_of
from planlang.ontology.expressions import Expression
from planlang.ontology.terms import OWL, RDF, RDFS, ROBOEARTH, XSD
from planlang.records import dataclass

THING, NOTHING = str(OWL.Thing), str(OWL.Nothing)


@dataclass(frozen=True, slots=True)
class Some:
    """An existential restriction: ``property some filler``."""

    property: str
    filler: Concept


@dataclass(frozen=True, slots=True)
class And:
    """A conjunction of two concepts."""

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
    """Stated superconcepts of each concept; an equivalence appears in both directions."""
    properties_above: dict[str, set[str]] = field(default_factory=dict)
    chains: list[tuple[str, str, str]] = field(default_factory=list)
    """Property chains (first, second, composition); a transitive property is all three."""
    domains: dict[str, list[Concept]] = field(default_factory=dict)
    ranges: dict[str, list[Concept]] = field(default_factory=dict)
    disjoint: list[tuple[str, str]] = field(default_factory=list)

    def state(self, lower: Concept, upper: Concept) -> None:
        """State that one concept is a subclass of another."""
        if lower != upper:
            self.above.setdefault(lower, []).append(upper)


def axioms_of(ontology: Ontology) -> Axioms:
    """Extract the EL axioms of an ontology on classes, properties and individuals."""
    found = Axioms()
    for cls in ontology.taxonomy.classes():
        for upper in ontology.taxonomy.parents(cls):
            found.state(cls, upper)
    _read_class_axioms(ontology, found)
    _read_property_axioms(ontology, found, ontology)
    _read_facts(ontology, found, ontology, found)
    return found


def own_axioms_of(ontology: Ontology, vocabulary: Axioms) -> Axioms:
    """Extract the EL axioms of an ontology's main document, and the superclasses of the names in it.

    ``vocabulary`` has the axioms of the other documents, which are not repeated.
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
    _read_facts(main, found, ontology, vocabulary)
    return found


def _read_class_axioms(ontology: Ontology, found: Axioms) -> None:
    for prop, is_definition in ((RDFS.subClassOf, False), (OWL.equivalentClass, True)):
        for triple in ontology.triples(p=prop):
            left, right = (expression_of(ontology, term, triple.span) for term in (triple.subject, triple.object))
            if left is not None and right is not None and (is_definition or not left.kind == right.kind == "name"):
                _include(left, right, found)
                if is_definition:
                    _include(right, left, found)
    for word, kind in ((OWL.intersectionOf, "and"), (OWL.unionOf, "or")):
        for triple in ontology.triples(p=word):
            if isinstance(triple.subject, str):
                parts = tuple(expression_of(ontology, one, triple.span) for one in ontology.items(triple.object))
                known = tuple(one for one in parts if one is not None)
                name, whole = (
                    Expression("name", triple.span, triple.subject),
                    Expression(kind, triple.span, parts=known),
                )
                if parts and len(known) == len(parts):
                    _include(name, whole, found)
                    _include(whole, name, found)
    found.disjoint += ontology.links(OWL.disjointWith)


def _include(lower: Expression, upper: Expression, found: Axioms) -> None:
    """State that an expression is a subclass of another, as far as EL allows."""
    if lower.kind in ("or", "one of") and len(lower.parts) > 1:
        for part in lower.parts:
            _include(part if lower.kind == "or" else replace(lower, parts=(part,)), upper, found)
        return
    below = concept(lower)
    if below is not None:
        for implied in implied_by(upper):
            found.state(below, implied)


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
        prop = str(triple.subject)
        found.chains.append((prop, prop, prop))
    for triple in ontology.triples(p=OWL.propertyChainAxiom):
        parts = list(ontology.items(triple.object))
        if len(parts) > 1 and all(isinstance(one, str) for one in (triple.subject, *parts)):
            _read_chain(list(map(str, parts)), str(triple.subject), found)
    for p, stated in ((RDFS.domain, found.domains), (RDFS.range, found.ranges)):
        for triple in ontology.triples(p=p):
            expression = expression_of(ontology, triple.object, triple.span)
            if expression is None or expression.kind == "facets":
                continue
            is_data = str(expression.term).startswith((str(XSD), str(RDFS)))
            if isinstance(triple.subject, str) and not is_data:
                stated.setdefault(triple.subject, []).extend(implied_by(expression))


def _read_chain(parts: list[str], whole: str, found: Axioms) -> None:
    first, *others = parts
    for number, following in enumerate(others, 2):
        both = (
            whole if number == len(parts) else f"{first} o {following}"
        )  # a name for the composition so far, which is not an IRI
        found.chains.append((first, following, both))
        first = both


def _read_facts(ontology: Ontology, found: Axioms, known: Ontology, vocabulary: Axioms) -> None:
    """Read types and links of individuals, as axioms on their singleton classes.

    Both ends of a link exist. Therefore its target is in the ranges of the property and of its superproperties, and has
    a link back by each inverse property. A link to a class of ``known``, as an object model has to the class that it is
    for, is also a link to some instance of that class.
    """
    language = (str(OWL), str(RDF), str(RDFS))
    stated = (found,) if vocabulary is found else (found, vocabulary)
    individuals = {
        triple.subject: None
        for triple in ontology.triples(p=RDF.type)
        if isinstance(triple.subject, str)
        and (triple.object == OWL.NamedIndividual or not str(triple.object).startswith(language))
    }
    inverses = _inverses(known)
    for one, other in (*ontology.links(OWL.sameAs), *ontology.same.items()):
        found.state(One(one), One(other))
        found.state(One(other), One(one))
    for individual in individuals:
        for triple in ontology.triples(s=individual):
            if triple.predicate == RDF.type:
                kind = expression_of(ontology, triple.object, triple.span)
                for implied in implied_by(kind) if kind is not None else ():
                    if not (isinstance(implied, str) and implied.startswith(language)):
                        found.state(One(individual), implied)
            elif isinstance(triple.object, str) and not triple.predicate.startswith(language):
                found.state(One(individual), Some(triple.predicate, One(triple.object)))
                for inverse in inverses.get(triple.predicate, ()):
                    found.state(One(triple.object), Some(inverse, One(individual)))
                if known.is_class(triple.object):
                    found.state(One(individual), Some(triple.predicate, triple.object))
                above = {triple.predicate}.union(*(one.properties_above.get(triple.predicate, ()) for one in stated))
                for implied in (of for prop in sorted(above) for one in stated for of in one.ranges.get(prop, ())):
                    found.state(One(triple.object), implied)


def _inverses(ontology: Ontology) -> dict[str, list[str]]:
    """Map each property to its named inverses, whichever of the two states them."""
    return grouped(pair for one, other in ontology.links(OWL.inverseOf) for pair in ((one, other), (other, one)))


def concept(expression: Expression | None) -> Concept | None:
    """Convert an expression to a concept; None if any part of it is beyond EL."""
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
            return together(concept(part) for part in parts)
        case "some" | "min" if parts[0].kind == "name" and (expression.kind == "some" or expression.number == 1):
            filler = concept(parts[1]) if len(parts) > 1 else THING
            return None if filler is None else Some(str(parts[0].term), filler)
    return None


def together(found: Iterable[Concept | None]) -> Concept | None:
    """Join concepts to a conjunction; None for no concepts, or if one is None.

    The conjunctions form a balanced tree, so that many parts do not make it deep.
    """
    parts = list(found)
    while len(parts) > 1:
        left, right = parts[::2], parts[1::2]
        pairs = zip(left, right, strict=False)
        joined = [None if one is None or other is None else And(one, other) for one, other in pairs]
        parts = [*joined, *left[len(right) :]]
    return parts[0] if parts else None


def implied_by(expression: Expression) -> Iterator[Concept]:
    """Yield EL concepts implied by an expression, which together approximate it as closely as EL allows."""
    parts = expression.parts
    if expression.kind == "and":
        for part in parts:
            yield from implied_by(part)
    elif expression.kind in ("some", "min", "exactly") and parts[0].kind == "name":
        if expression.kind == "some" or expression.number > 0:
            filler = together(implied_by(parts[1])) if len(parts) > 1 else None
            yield Some(str(parts[0].term), filler or THING)
    else:
        whole = concept(expression)
        if whole is not None:
            yield whole
