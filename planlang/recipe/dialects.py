"""Parts of recipes that no task holds together: what is missing is told by the dialect that they are of."""

from __future__ import annotations

from dataclasses import dataclass

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, error
from planlang.ontology import Ontology


@dataclass(frozen=True, slots=True)
class Dialect:
    """A way of writing recipes: how its parts are called, the local names of their properties, and what holds them."""

    parts: str
    marks: tuple[str, ...]
    missing: str


DIALECTS = (
    Dialect(
        "transitions between states",
        ("fromState", "toState"),
        "give an action class `stateTransition value T` for each of them, and taskStartState and taskEndState",
    ),
    Dialect(
        "ordering constraints",
        ("occursBeforeInOrdering", "occursAfterInOrdering"),
        "give an action class `orderingConstraints value O` for each of them, and `subAction some X`",
    ),
    Dialect(
        "a chain of actions",
        ("nextAction", "previousAction"),
        "give the individual that they are part of `subAction` with the first of them",
    ),
    Dialect(
        "parts of a workflow",
        ("definesTask", "hasBindingRole"),
        "give the workflow `hasStep` with each of its tasks",
    ),
)
"""In the order in which they are looked for: the first that is found tells the file."""


def loose_parts(ontology: Ontology) -> list[Diagnostic]:
    """An error that says what holds together the parts that the main document has; empty if it has none."""
    main = str(ontology.documents[0].path)
    for dialect in DIALECTS:
        spans = [
            triple.span
            for triple in ontology.triples()
            if triple.span.file == main and local_name(triple.predicate) in dialect.marks
        ]
        if spans:
            message = f"this file has {dialect.parts}, but no task that they are of"
            return [error("R003", message, min(spans), dialect.missing)]
    return []
