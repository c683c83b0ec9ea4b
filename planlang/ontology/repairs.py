"""Terms of RDF and OWL that a file writes in the wrong namespace; restrictions that do not say that they are ones."""

from __future__ import annotations

from difflib import get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note, warning
from planlang.ontology.terms import ON_PROPERTY, OWL, RDF, RDFS, RESTRICTION, TYPE, BNode, Term, Triple

_RDF = """type first rest nil value subject predicate object Statement List Property langString XMLLiteral PlainLiteral
 HTML JSON Bag Seq Alt CompoundLiteral language direction"""
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

_SPELT = {OWL + "DataProperty": OWL + "DatatypeProperty", OWL + "Individual": OWL + "NamedIndividual"}
_PREFIX = {RDFS: "rdfs", OWL: "owl", RDF: "rdf"}


def repair(triples: list[Triple]) -> tuple[list[Triple], list[Diagnostic]]:
    """The triples with the terms that were meant, and what was changed. The given list stays as it is.

    ``owl:subClassOf`` becomes ``rdfs:subClassOf`` and the like; a nameless node with owl:onProperty becomes a
    restriction.
    """
    diagnostics: list[Diagnostic] = []
    known: dict[str, str] = {}
    reported: set[tuple[str, Span]] = set()
    repaired: list[Triple] = []
    for triple in triples:
        predicate = _meant(triple.predicate, known)
        value: Term = triple.object
        if predicate == TYPE and isinstance(value, str):
            value = _meant(value, known)
        for written, read in ((triple.predicate, predicate), (triple.object, value)):
            if isinstance(written, str) and isinstance(read, str) and (written, triple.span) not in reported:
                found = _report(written, read, triple.span, is_term=written is triple.predicate or predicate == TYPE)
                if found is not None:
                    reported.add((written, triple.span))
                    diagnostics.append(found)
        changed = predicate is not triple.predicate or value is not triple.object
        repaired.append(Triple(triple.subject, predicate, value, triple.span) if changed else triple)
    return _with_restrictions(repaired, diagnostics), diagnostics


def _meant(iri: str, known: dict[str, str]) -> str:
    read = known.get(iri)
    if read is None:
        read = known[iri] = next((home + local for home, local in _homes(iri)), _SPELT.get(iri, iri))
    return read


def _homes(iri: str) -> list[tuple[str, str]]:
    """The namespaces of the three that have this term, if the one that it is written in has not."""
    local = local_name(iri)
    namespace = iri.removesuffix(local)
    if namespace not in TERMS or local in TERMS[namespace] or (namespace == RDF and local.startswith("_")):
        return []
    return [(home, local) for home, terms in TERMS.items() if local in terms]


def _report(written: str, read: str, span: Span, *, is_term: bool) -> Diagnostic | None:
    local = local_name(written)
    namespace = written.removesuffix(local)
    if not is_term or namespace not in TERMS:
        return None
    prefix = _PREFIX[namespace]
    if read != written:
        name = local_name(read)
        right = f"{_PREFIX[read.removesuffix(name)]}:{name}"
        return warning("O012", f"{prefix}:{local} is read as {right}", span, f"write {right}")
    if local in TERMS[namespace] or not local or (namespace == RDF and local.startswith("_")):
        return None
    similar = get_close_matches(local, sorted(TERMS[namespace]), n=1)
    advice = f"did you mean {prefix}:{similar[0]}?" if similar else None
    return warning("O013", f"there is no {prefix}:{local}", span, advice)


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
