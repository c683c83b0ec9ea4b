"""What only shows when all documents are read: superclasses that nothing defines, fillers of the wrong kind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, note, warning
from planlang.ontology.documents import Reading
from planlang.ontology.terms import KNOWROB, OWL, RDF, RDFS, SUBCLASS_OF, XSD
from planlang.ontology.triples import Triples
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


def _named_objects(triples: Triples, predicate: str) -> dict[str, int]:
    """The IRIs that are objects of a predicate, each with the first row that has it."""
    found: dict[int, int] = {}
    for row in triples.by(predicate):
        found.setdefault(triples.objects[row], row)
    return {name: row for number, row in found.items() if (name := triples.name(number)) is not None}


def _undefined_superclasses(ontology: Ontology, triples: Triples) -> Iterator[Diagnostic]:
    named = _named_objects(triples, SUBCLASS_OF)
    first = {name: row for name, row in named.items() if not name.startswith(_W3C)}
    undefined = [name for name in first if not ontology.defined(name)]
    for place, name in enumerate(undefined[:MOST_WARNINGS]):
        advice = "import the file that defines it, or correct the name"
        similar = _similar(ontology, name) if place < MOST_SUGGESTIONS else None
        if similar:
            advice = f"did you mean {similar}? {advice}"
        message = f"nothing defines the superclass {local_name(name)} ({name})"
        yield warning("O041", message, triples.span(first[name]), advice)


def _similar(ontology: Ontology, name: str) -> str | None:
    """The local name of a declared class of the same namespace that is written almost like this one."""
    local = local_name(name)
    namespace = name.removesuffix(local)
    others = [other.removeprefix(namespace) for other in ontology.class_names() if other.startswith(namespace)]
    return next(iter(get_close_matches(local, others, n=1, cutoff=0.75)), None)


def _individuals_as_classes(ontology: Ontology, triples: Triples) -> Iterator[Diagnostic]:
    named = _named_objects(triples, OWL + "someValuesFrom")
    found = [name for name in named if ontology.is_individual(name) and not ontology.is_class(name)]
    if found:
        message = f"someValuesFrom with an individual is read as hasValue: {_names(found)}"
        yield note("O042", message, triples.span(named[found[0]]))


def _classes_as_individuals(ontology: Ontology, triples: Triples) -> Iterator[Diagnostic]:
    named = _named_objects(triples, OWL + "hasValue")
    found = [name for name in named if ontology.is_class(name) and not ontology.is_individual(name)]
    if found:
        message = f"hasValue with a class is read as someValuesFrom: {_names(found)}"
        yield note("O043", message, triples.span(named[found[0]]))


def _names(iris: Sequence[str]) -> str:
    names = list(dict.fromkeys(map(local_name, iris)))
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
