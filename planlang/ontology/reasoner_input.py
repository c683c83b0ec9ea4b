"""The input of a reasoner for description logic: the axioms of an ontology, without what reasoners cannot take.

Values of datatypes that OWL 2 does not have, such as the units of QUDT, make HermiT give up. Facts with them are left
out; a restriction with them becomes a class of which nothing is known, so that what is found to contradict does. A
number is given the datatype that its property has: to OWL 0.5 and "0.5"^^xsd:float are different values.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field, replace

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note
from planlang.ontology.checks import is_malformed
from planlang.ontology.nested_writers import rdfxml
from planlang.ontology.ontology import Ontology
from planlang.ontology.terms import OWL, RDF, RDFS, XSD, BNode, Literal, Term, Triple
from planlang.records import dataclass

_INTEGERS = frozenset(
    XSD + name
    for name in (
        *("integer", "nonNegativeInteger", "nonPositiveInteger", "positiveInteger", "negativeInteger", "long", "int"),
        *("short", "byte", "unsignedLong", "unsignedInt", "unsignedShort", "unsignedByte"),
    )
)
_FRACTIONS = frozenset(XSD + name for name in ("decimal", "double", "float"))
_TEXTS = ("string", "normalizedString", "token", "language", "Name", "NCName", "NMTOKEN")
_OTHERS = ("boolean", "hexBinary", "base64Binary", "anyURI", "dateTime", "dateTimeStamp")
BUILT_IN = frozenset(
    {*_INTEGERS, *_FRACTIONS, *(XSD + name for name in (*_TEXTS, *_OTHERS))}
    | {OWL + "real", OWL + "rational", RDF.PlainLiteral, RDF.XMLLiteral, RDF.langString, RDFS.Literal}
)
"""The datatypes of OWL 2."""

_INTEGER = re.compile(r"[+-]?[0-9]+")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_FILLERS = frozenset((OWL.someValuesFrom, OWL.allValuesFrom, OWL.hasValue, OWL.onDataRange))
_WORDS = frozenset((RDFS.label, RDFS.comment, RDFS.seeAlso, RDFS.isDefinedBy, OWL.versionInfo, OWL.imports))
_W3C = "http://www.w3.org/"
NAMESPACE = "http://planlang/#"
"""The namespace of the names that a reasoner is given."""


@dataclass(slots=True)
class ReasonerInput:
    """The axioms of an ontology in names that are short and each only one thing's; ``notes``: what was left out."""

    triples: list[Triple]
    facts: frozenset[int]
    """Numbers of the triples that are about individuals."""
    names: dict[str, str]
    """Name -> IRI."""
    notes: list[Diagnostic] = field(default_factory=list)

    def text(self, *, facts: bool) -> str:
        """Return the axioms in RDF/XML, with what is said about individuals or without."""
        header = Triple("http://planlang/", RDF.type, OWL.Ontology, Span(""))
        kept = (triple for row, triple in enumerate(self.triples) if facts or row not in self.facts)
        return rdfxml([header, *kept], {"e": NAMESPACE})[0]


def reasoner_input(ontology: Ontology) -> ReasonerInput:
    """Return what a reasoner is given of an ontology."""
    left = _Left(ontology)
    triples = [triple for triple in map(left.with_numbers, left.axioms()) if triple is not None]
    triples = left.without_foreign_values(triples)
    individuals = {
        subject
        for subject in dict.fromkeys(triple.subject for triple in triples)
        if _is_about_individual(ontology, subject)
    }
    facts = frozenset(row for row, triple in enumerate(triples) if triple.subject in individuals)
    renamed, names = _renamed(triples)
    return ReasonerInput(renamed, facts, names, left.notes())


def _is_about_individual(ontology: Ontology, subject: str | BNode) -> bool:
    if isinstance(subject, BNode):
        return any(not one.startswith(_W3C) for one in ontology.types(subject))
    return ontology.is_individual(subject) and not ontology.is_class(subject) and not ontology.is_property(subject)


class _Left:
    """The rest of an ontology, and what was taken away or changed."""

    def __init__(self, ontology: Ontology) -> None:
        self._ontology = ontology
        self._properties = {
            triple.subject: triple.object
            for triple in ontology.triples(p=OWL.onProperty)
            if isinstance(triple.object, str)
        }
        self._ranges: dict[str, str | None] = {}
        self._foreign: dict[str, Span] = {}
        self._numbers: list[Span] = []
        self._rows = 0

    def axioms(self) -> Iterator[Triple]:
        """Yield the triples that are neither annotations nor about documents."""
        ontology = self._ontology
        headers = {triple.subject for triple in ontology.triples(p=RDF.type, o=OWL.Ontology)}
        words = {*_WORDS, *(t.subject for t in ontology.triples(p=RDF.type, o=OWL.AnnotationProperty))}
        for triple in ontology.triples():
            if triple.subject not in headers and triple.predicate not in words:
                yield triple

    def with_numbers(self, triple: Triple) -> Triple:
        """Return a triple whose number, if it has one, is of the datatype that the property has."""
        value = triple.object
        if not isinstance(value, Literal) or value.datatype not in {None, XSD.string, *_INTEGERS, *_FRACTIONS}:
            return triple
        is_filler = triple.predicate == OWL.hasValue
        prop = self._properties.get(triple.subject) if is_filler else triple.predicate
        wanted = self._range(prop) if prop is not None and not prop.startswith(_W3C) else None
        form = _INTEGER if wanted in _INTEGERS else _NUMBER
        if wanted is None or wanted == value.datatype or not form.fullmatch(value.value.strip()):
            return triple
        self._numbers.append(triple.span)
        return replace(triple, object=Literal(value.value.strip(), wanted))

    def _range(self, prop: str) -> str | None:
        """Return the datatype of a property's numbers; None if it has none."""
        if prop not in self._ranges:
            above = self._ontology.superproperties(prop)
            ranges = (range_ for one in above for range_ in self._ontology.values(one, RDFS.range))
            numeric = (one for one in ranges if one in _INTEGERS or one in _FRACTIONS)
            self._ranges[prop] = next((str(one) for one in numeric), None)
        return self._ranges[prop]

    def without_foreign_values(self, triples: Sequence[Triple]) -> list[Triple]:
        """Return the triples without values and ranges of values that OWL 2 does not have."""
        foreign, restrictions = self._foreign_terms(triples)
        kept = []
        for triple in triples:
            if triple.subject in foreign or triple.subject in restrictions or triple.object in foreign:
                self._rows += 1
                continue
            if triple.object in restrictions and isinstance(triple.object, BNode):
                triple = replace(triple, object=restrictions[triple.object])
            kept.append(triple)
        span = Span("")
        return [*kept, *(Triple(name, RDF.type, OWL.Class, span) for name in restrictions.values())]

    def _foreign_terms(self, triples: Sequence[Triple]) -> tuple[set[Term], dict[Term, str]]:
        """Return values and data ranges that OWL 2 does not have, and for each restriction with one a class."""
        foreign: set[Term] = set()
        restrictions: dict[Term, str] = {}
        above: dict[Term, list[Triple]] = {}
        waiting: list[Term] = []
        for triple in triples:
            above.setdefault(triple.object, []).append(triple)
            datatype = self._foreign_datatype(triple)
            if datatype is not None and triple.object not in foreign:
                self._foreign.setdefault(local_name(datatype) or datatype, triple.span)
                foreign.add(triple.object)
                waiting.append(triple.object)
        while waiting:
            for triple in above.get(waiting.pop(), ()):
                node = triple.subject
                if not isinstance(node, BNode) or node in foreign or node in restrictions:
                    continue
                if triple.predicate in _FILLERS:
                    restrictions[node] = f"urn:unread#UnreadRestriction{len(restrictions) + 1}"
                elif not _is_about_individual(self._ontology, node):
                    foreign.add(node)
                    waiting.append(node)
        return foreign, restrictions

    def _foreign_datatype(self, triple: Triple) -> str | None:
        """Return the datatype or value that a triple's object is or has and that OWL 2 does not have; else None."""
        value = triple.object
        if isinstance(value, Literal):
            if is_malformed(value):
                return repr(value.value[:20])
            return None if value.datatype is None or value.datatype in BUILT_IN else value.datatype
        if isinstance(value, BNode) or triple.predicate not in {RDFS.range, OWL.onDatatype, *_FILLERS}:
            return None
        if value in BUILT_IN:
            return None
        kinds = self._ontology.values(value, RDF.type)
        prop = triple.subject if triple.predicate == RDFS.range else self._properties.get(triple.subject)
        of_data = isinstance(prop, str) and OWL.DatatypeProperty in self._ontology.values(prop, RDF.type)
        is_datatype = value.startswith(XSD) or RDFS.Datatype in kinds or (of_data and OWL.Class not in kinds)
        return value if is_datatype else None

    def notes(self) -> list[Diagnostic]:
        """Return notes of what was left out and changed."""
        found = []
        if self._foreign:
            names = _listed(self._foreign)
            message = f"the reasoner is not given statements with values that OWL does not have: {names}"
            found.append(note("O062", f"{message} ({self._rows})", next(iter(self._foreign.values()))))
        own = {str(document.path) for document in self._ontology.documents[:1]}  # not what it imports
        numbers = [span for span in self._numbers if span.file in own]
        if numbers:
            message = f"the reasoner is given numbers in the datatypes that their properties have ({len(numbers)})"
            found.append(note("O062", message, numbers[0]))
        return found


def _listed(names: Iterable[str]) -> str:
    first, *others = sorted(names)
    more = f" and {len(others) - 3} more" if len(others) > 3 else ""
    return ", ".join([first, *others[:3]]) + more


def _renamed(triples: Iterable[Triple]) -> tuple[list[Triple], dict[str, str]]:
    """Return triples whose IRIs are local names, each of one thing only, and the IRI of each name."""
    of: dict[str, str] = {}
    names: dict[str, str] = {}

    def short(iri: str) -> str:
        if iri.startswith(_W3C):
            return iri
        if iri not in of:
            name = candidate = "_".join(re.findall(r"[A-Za-z0-9_]+", local_name(iri))).lstrip("0123456789") or "thing"
            while name in names:
                name = f"{candidate}_{len(names)}"
            of[iri], names[name] = NAMESPACE + name, iri
        return of[iri]

    def term(value: Term) -> Term:
        return short(value) if isinstance(value, str) else value

    renamed = []
    for one in triples:
        subject = short(one.subject) if isinstance(one.subject, str) else one.subject
        renamed.append(Triple(subject, short(one.predicate), term(one.object), one.span))
    return renamed, names
