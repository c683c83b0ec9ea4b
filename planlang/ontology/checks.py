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
    seen: set[str] = set()
    for triple in triples:
        name = triple.object
        if triple.predicate != SUBCLASS_OF or not isinstance(name, str) or name in seen or name.startswith(_W3C):
            continue
        seen.add(name)
        if not ontology.defined(name):
            advice = "import the file that defines it, or correct the name"
            local = local_name(name)
            namespace = name.removesuffix(local)
            others = (other for other in ontology.class_names() if other.startswith(namespace))
            similar = get_close_matches(local, [other.removeprefix(namespace) for other in others], n=1, cutoff=0.75)
            if similar:
                advice = f"did you mean {similar[0]}? {advice}"
            yield warning("O041", f"nothing defines the superclass {local_name(name)} ({name})", triple.span, advice)


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
