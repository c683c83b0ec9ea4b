"""Dialects of recipes that are recognised but not read: each is told by its own properties, and named."""

from __future__ import annotations

from dataclasses import dataclass

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error
from planlang.ontology import Ontology, Triple

_ON_PROPERTY = "http://www.w3.org/2002/07/owl#onProperty"


@dataclass(frozen=True, slots=True)
class Dialect:
    """A way of writing recipes: how it is called and the local names of the properties that tell it."""

    name: str
    marks: tuple[str, ...]


OTHERS = (
    Dialect("a finite-state recipe (stateTransition, fromState, toState)", ("stateTransition", "taskStartState")),
    Dialect("a workflow of the DUL and EASE ontologies (hasStep)", ("hasStep",)),
    Dialect("a chain of individuals (nextAction, previousAction)", ("nextAction", "previousAction")),
    Dialect("a recipe of sub-events (subEvents)", ("subEvents",)),
    Dialect("a recipe inside owl:equivalentClass", ("subAction",)),
)
"""In the order in which they are looked for: the first that matches names the file."""


def other_dialects(ontology: Ontology, task: str | None = None) -> list[Diagnostic]:
    """An error that names the dialect of the main document, or of one task; empty if nothing tells it."""
    for dialect in OTHERS:
        span = _first_mark(ontology, dialect, task)
        if span is not None:
            what = f"`{local_name(task)}`" if task is not None else "this file"
            advice = (
                "readable are restrictions `subAction some X` and `orderingConstraints value O` under rdfs:subClassOf,"
                " flat or in one owl:intersectionOf"
            )
            return [error("R003", f"{what} is {dialect.name}, a dialect that is not read yet", span, advice)]
    return []


def _first_mark(ontology: Ontology, dialect: Dialect, task: str | None) -> Span | None:
    if task is not None:
        for restriction in ontology.restrictions(task):
            if local_name(restriction.property) in dialect.marks:
                return restriction.span
        return None
    main = str(ontology.documents[0].path)
    spans = [
        triple.span
        for triple in ontology.triples()
        if triple.span.file == main and local_name(_telling(triple)) in dialect.marks
    ]
    return min(spans, default=None)


def _telling(triple: Triple) -> str:
    """The property that a triple uses: of a restriction the one it is on, else its predicate."""
    is_restriction = triple.predicate == _ON_PROPERTY and isinstance(triple.object, str)
    return str(triple.object) if is_restriction else triple.predicate
