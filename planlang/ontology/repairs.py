"""Terms of RDF and OWL that a file writes in the wrong namespace; restrictions that do not say that they are ones."""

from __future__ import annotations

from difflib import get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note, warning
from planlang.ontology.terms import ON_PROPERTY, OWL, RDF, RDFS, RESTRICTION, TYPE, BNode, Term, Triple

_RDF = """type first rest nil value subject predicate object Statement List Property langString XMLLiteral PlainLiteral
 langRange HTML JSON Bag Seq Alt CompoundLiteral language direction"""
_RDFS = """subClassOf subPropertyOf domain range label comment seeAlso isDefinedBy member Class Datatype Literal
 Resource Container ContainerMembershipProperty"""
_OWL = """AllDifferent AllDisjointClasses AllDisjointProperties Annotation AnnotationProperty AsymmetricProperty Axiom
 Class DataRange DatatypeProperty DeprecatedClass DeprecatedProperty FunctionalProperty InverseFunctionalProperty
 IrreflexiveProperty NamedIndividual NegativePropertyAssertion Nothing ObjectProperty Ontology OntologyProperty
 ReflexiveProperty Restriction SymmetricProperty Thing TransitiveProperty allValuesFrom annotatedProperty
 annotatedSource annotatedTarget assertionProperty backwardCompatibleWith bottomDataProperty bottomObjectProperty
 cardinality complementOf datatypeComplementOf deprecated differentFrom disjointUnionOf disjointWith distinctMembers
 equivalentClass equivalentProperty hasKey hasSelf hasValue imports incompatibleWith intersectionOf inverseOf
 maxCardinality maxQualifiedCardinality members minCardinality minQualifiedCardinality onClass onDataRange onDatatype
 onProperties onProperty oneOf priorVersion propertyChainAxiom propertyDisjointWith qualifiedCardinality sameAs
 someValuesFrom sourceIndividual targetIndividual targetValue topDataProperty topObjectProperty unionOf versionIRI
 versionInfo withRestrictions rational real"""

TERMS: dict[str, frozenset[str]] = {RDFS: frozenset(_RDFS.split()), OWL: frozenset(_OWL.split()),
                                    RDF: frozenset(_RDF.split())}  # fmt: skip
"""Namespace -> local names of the terms that it has."""

MOST_WARNINGS = 100
"""Warnings about one file; further terms are repaired silently."""

_SPELT = {OWL + "DataProperty": OWL + "DatatypeProperty", OWL + "Individual": OWL + "NamedIndividual"}
_PREFIX = {RDFS: "rdfs", OWL: "owl", RDF: "rdf"}


def repair(triples: list[Triple]) -> tuple[list[Triple], list[Diagnostic]]:
    """The triples with the terms that were meant, and what was changed. The given list stays as it is.

    ``owl:subClassOf`` becomes ``rdfs:subClassOf`` and the like; a nameless node with owl:onProperty becomes a
    restriction.
    """
    meant = _Meanings()
    repaired: list[Triple] = []
    for triple in triples:
        predicate = meant.term(triple.predicate, triple.span)
        value: Term = triple.object
        if predicate == TYPE and isinstance(value, str):
            value = meant.term(value, triple.span)
        changed = predicate is not triple.predicate or value is not triple.object
        repaired.append(Triple(triple.subject, predicate, value, triple.span) if changed else triple)
    return _with_restrictions(repaired, meant.diagnostics), meant.diagnostics


class _Meanings:
    """Looks up what terms mean, and reports those that are not what they say."""

    def __init__(self) -> None:
        self.diagnostics: list[Diagnostic] = []
        self._known: dict[str, tuple[str, str, str | None] | None] = {}

    def term(self, iri: str, span: Span) -> str:
        """The term that is meant by an IRI: mostly itself."""
        if iri not in self._known:
            self._known[iri] = _correction(iri)
        correction = self._known[iri]
        if correction is None:
            return iri
        read, message, advice = correction
        if len(self.diagnostics) < MOST_WARNINGS:
            self.diagnostics.append(warning("O013" if read == iri else "O012", message, span, advice))
        return read


def meant_term(iri: str) -> str:
    """The term of RDF, RDFS or OWL that an IRI means: itself, or the same name in the namespace that has it."""
    correction = _correction(iri)
    return iri if correction is None else correction[0]


def _correction(iri: str) -> tuple[str, str, str | None] | None:
    """What a term is read as, why, and what to write; None if there is nothing to correct."""
    local = local_name(iri)
    namespace = iri.removesuffix(local)
    if namespace not in TERMS or not local or local in TERMS[namespace] or (namespace == RDF and local[0] == "_"):
        return None
    written = f"{_PREFIX[namespace]}:{local}"
    read = next((home + local for home, terms in TERMS.items() if local in terms), _SPELT.get(iri))
    if read is not None:
        name = local_name(read)
        right = f"{_PREFIX[read.removesuffix(name)]}:{name}"
        return read, f"{written} is read as {right}", f"write {right}"
    similar = get_close_matches(local, sorted(TERMS[namespace]), n=1)
    return iri, f"there is no {written}", f"did you mean {_PREFIX[namespace]}:{similar[0]}?" if similar else None


def _with_restrictions(triples: list[Triple], diagnostics: list[Diagnostic]) -> list[Triple]:
    typed = {triple.subject for triple in triples if triple.predicate == TYPE and triple.object == RESTRICTION}
    bare = {
        triple.subject: triple.span
        for triple in reversed(triples)
        if triple.predicate == ON_PROPERTY and isinstance(triple.subject, BNode) and triple.subject not in typed
    }
    if not bare:
        return triples
    first = min(bare.values())
    what = "a restriction does not say owl:Restriction"
    if len(bare) > 1:
        what = f"{len(bare)} restrictions do not say owl:Restriction"
    diagnostics.append(note("O014", f"{what}; owl:onProperty is taken for it", first))
    result: list[Triple] = []
    for triple in triples:
        result.append(triple)
        if triple.predicate == ON_PROPERTY and isinstance(triple.subject, BNode) and triple.subject in bare:
            span = bare.pop(triple.subject)
            result.append(Triple(triple.subject, TYPE, RESTRICTION, span))
    return result
