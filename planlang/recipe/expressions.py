"""Walking class expressions in triples: members of intersections, restrictions without a name."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.diagnostics import Span
from planlang.ontology import BNode, Literal, Ontology, Restriction, Term

OWL = "http://www.w3.org/2002/07/owl#"
RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
RDFS = "http://www.w3.org/2000/01/rdf-schema#"

_KINDS = {
    OWL + "someValuesFrom": "some",
    OWL + "hasValue": "value",
    OWL + "allValuesFrom": "only",
    OWL + "minQualifiedCardinality": "min",
    OWL + "maxQualifiedCardinality": "max",
    OWL + "qualifiedCardinality": "exactly",
}


def members(ontology: Ontology, expression: BNode) -> Iterator[Term]:
    """The members of an intersection in the order of the file; of anything else the expression itself."""
    for triple in ontology.triples(s=expression, p=OWL + "intersectionOf"):
        node: Term | None = triple.object
        seen: set[Term] = set()
        while isinstance(node, (str, BNode)) and node != RDF + "nil" and node not in seen:
            seen.add(node)
            first = _object(ontology, node, RDF + "first")
            if isinstance(first, BNode) and next(ontology.triples(s=first, p=OWL + "intersectionOf"), None):
                yield from members(ontology, first)
            elif first is not None:
                yield first
            node = _object(ontology, node, RDF + "rest")
        return
    yield expression


def restriction_of(ontology: Ontology, node: BNode, span: Span) -> Restriction | None:
    """An anonymous restriction as a value; None if the node is none."""
    property_iri = _object(ontology, node, OWL + "onProperty")
    if not isinstance(property_iri, str):
        return None
    for triple in ontology.triples(s=node):
        if triple.predicate in _KINDS:
            return Restriction(property_iri, _KINDS[triple.predicate], triple.object, None, triple.span, "intersection")
    return None


def direct_superclasses(ontology: Ontology, cls: str) -> tuple[str, ...]:
    """Named direct superclasses: under rdfs:subClassOf, as members of an intersection there, and equivalent ones."""
    found: dict[str, None] = {}
    for predicate in (RDFS + "subClassOf", OWL + "equivalentClass"):
        for triple in ontology.triples(s=cls, p=predicate):
            if isinstance(triple.object, BNode):
                for member in members(ontology, triple.object):
                    if isinstance(member, str) and not isinstance(member, BNode):
                        found[member] = None
            elif not isinstance(triple.object, Literal):
                found[triple.object] = None
    return tuple(name for name in found if name != cls)


def _object(ontology: Ontology, subject: str | BNode, predicate: str) -> Term | None:
    triple = next(ontology.triples(s=subject, p=predicate), None)
    return triple.object if triple else None
