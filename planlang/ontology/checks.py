"""What only shows when all documents are read: superclasses that nothing defines, fillers of the wrong kind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, note, warning
from planlang.ontology.documents import Reading
from planlang.ontology.terms import KNOWROB, OWL, RDF, RDFS, SUBCLASS_OF, XSD, Triple
from planlang.resources import bundled

if TYPE_CHECKING:
    from planlang.ontology.ontology import Ontology

MOST_WARNINGS = 100
"""Undefined superclasses of one file that are reported."""

MOST_SUGGESTIONS = 20
"""Among these, those for which a similar name is looked for."""

_W3C = (OWL, RDF, RDFS, XSD)


def checked(ontology: Ontology, readings: Sequence[Reading]) -> Iterator[Diagnostic]:
    """Diagnostics about every document that is not one of ours."""
    ours = bundled("ontologies").resolve()
    has_vocabulary = ontology.is_class(KNOWROB + "Action")
    for reading in readings:
        if not reading.document.path.resolve().is_relative_to(ours):
            if has_vocabulary:
                yield from _undefined_superclasses(ontology, reading.triples)
            yield from _individuals_as_classes(ontology, reading.triples)
            yield from _classes_as_individuals(ontology, reading.triples)


def _undefined_superclasses(ontology: Ontology, triples: Sequence[Triple]) -> Iterator[Diagnostic]:
    first: dict[str, Triple] = {}
    for triple in triples:
        name = triple.object
        if triple.predicate == SUBCLASS_OF and isinstance(name, str) and not name.startswith(_W3C):
            first.setdefault(name, triple)
    undefined = [name for name in first if not ontology.defined(name)]
    for place, name in enumerate(undefined[:MOST_WARNINGS]):
        advice = "import the file that defines it, or correct the name"
        similar = _similar(ontology, name) if place < MOST_SUGGESTIONS else None
        if similar:
            advice = f"did you mean {similar}? {advice}"
        message = f"nothing defines the superclass {local_name(name)} ({name})"
        yield warning("O041", message, first[name].span, advice)


def _similar(ontology: Ontology, name: str) -> str | None:
    """The local name of a declared class of the same namespace that is written almost like this one."""
    local = local_name(name)
    namespace = name.removesuffix(local)
    others = [other.removeprefix(namespace) for other in ontology.class_names() if other.startswith(namespace)]
    return next(iter(get_close_matches(local, others, n=1, cutoff=0.75)), None)


def _individuals_as_classes(ontology: Ontology, triples: Sequence[Triple]) -> Iterator[Diagnostic]:
    found = [
        t
        for t in triples
        if t.predicate == OWL + "someValuesFrom"
        and isinstance(t.object, str)
        and ontology.is_individual(t.object)
        and not ontology.is_class(t.object)
    ]
    if found:
        message = f"someValuesFrom with an individual is read as hasValue: {_names(found)}"
        yield note("O042", message, found[0].span)


def _classes_as_individuals(ontology: Ontology, triples: Sequence[Triple]) -> Iterator[Diagnostic]:
    found = [
        t
        for t in triples
        if t.predicate == OWL + "hasValue"
        and isinstance(t.object, str)
        and ontology.is_class(t.object)
        and not ontology.is_individual(t.object)
    ]
    if found:
        message = f"hasValue with a class is read as someValuesFrom: {_names(found)}"
        yield note("O043", message, found[0].span)


def _names(triples: Sequence[Triple]) -> str:
    names = list(dict.fromkeys(local_name(str(triple.object)) for triple in triples))
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
