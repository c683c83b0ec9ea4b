"""Parts of recipes that no task holds together: what is missing is told by the dialect that they are of."""

from __future__ import annotations

from dataclasses import dataclass

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, error
from planlang.ontology import Ontology
from planlang.ontology.terms import ON_PROPERTY


@dataclass(frozen=True, slots=True)
class Dialect:
    """A way of writing recipes: how its parts are called, the local names of their properties and of the property by
    which a task has them, and what is missing where nothing has them.
    """

    parts: str
    marks: tuple[str, ...]
    holder: str
    missing: str


DIALECTS = (
    Dialect(
        "transitions between states",
        ("fromState", "toState"),
        "stateTransition",
        "give an action class `stateTransition value T` for each of them, and taskStartState and taskEndState",
    ),
    Dialect(
        "ordering constraints",
        ("occursBeforeInOrdering", "occursAfterInOrdering"),
        "orderingConstraints",
        "give an action class `orderingConstraints value O` for each of them, and `subAction some X`",
    ),
    Dialect(
        "a chain of actions",
        ("nextAction", "previousAction"),
        "subAction",
        "give the individual that they are part of `subAction` with the first of them",
    ),
    Dialect(
        "parts of a workflow",
        ("definesTask", "hasBindingRole"),
        "hasStep",
        "give the workflow `hasStep` with each of its tasks",
    ),
)
"""In the order in which they are looked for: the first that is found tells the file."""


def loose_parts(ontology: Ontology) -> list[Diagnostic]:
    """An error that says what holds together the parts that the main document has; empty if it has none."""
    main = str(ontology.documents[0].path)
    own = [triple for triple in ontology.triples() if triple.span.file == main]
    used = {local_name(triple.predicate) for triple in own}
    used |= {
        local_name(triple.object)
        for triple in own
        if triple.predicate == ON_PROPERTY and isinstance(triple.object, str)
    }
    for dialect in DIALECTS:
        spans = [triple.span for triple in own if local_name(triple.predicate) in dialect.marks]
        if spans and dialect.holder not in used:
            message = f"this file has {dialect.parts}, but no task that they are of"
            return [error("R003", message, min(spans), dialect.missing)]
    return []
