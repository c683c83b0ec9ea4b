"""Readers of the dialects in which recipes are written; each yields the same statements.

General layout: one file for each reader. ``partial_order`` reads classes with sub-actions and ordering constraints, in
an intersection, flat or equivalent, as ``subAction`` or ``subEvents``, ``finite_state`` classes with states and
transitions, ``action_table`` individuals chained by ``nextAction``, ``workflow`` individuals with ``hasStep`` and
relations of intervals; ``data_flow`` reads inputs and outputs in any of them. The reader is chosen by what
a class or an individual states, so that one file may mix dialects. ``register`` adds a reader of one more.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, error
from planlang.ontology import Ontology
from planlang.ontology.terms import OWL
from planlang.recipe.readers import action_table, finite_state, partial_order, workflow
from planlang.recipe.readers.data_flow import read_data_flow
from planlang.recipe.statements import REGISTERED_WORDS, Statements


@dataclass(frozen=True, slots=True)
class Loose:
    """The marks of parts of a recipe that belong to no task.

    ``parts`` names them; ``marks`` are the local names of their properties, ``holder`` that of the property by which a
    task has them; ``help`` is the advice where nothing has them.
    """

    parts: str
    marks: tuple[str, ...]
    holder: str
    help: str


@dataclass(frozen=True, slots=True)
class Reader:
    """A reader of one dialect, or of several that are nearly the same.

    ``tasks`` yields the classes or individuals (IRIs) of the main document that may state a recipe; ``read`` returns
    what one of them states, or None if that is no recipe in this dialect. ``words`` are the local names of properties
    that only this reader takes up: they fill no parameters, and slips in them are misspellings.
    """

    tasks: Callable[[Ontology], Iterator[str]]
    read: Callable[[Ontology, str], Statements | None]
    loose: Loose | None = None
    words: tuple[str, ...] = ()


READERS: list[Reader] = [
    Reader(
        finite_state.tasks,
        finite_state.read,
        Loose(
            "transitions between states",
            ("fromState", "toState"),
            "stateTransition",
            "give an action class `stateTransition value T` for each of them, and taskStartState and taskEndState",
        ),
    ),
    Reader(
        partial_order.tasks,
        partial_order.read,
        Loose(
            "ordering constraints",
            ("occursBeforeInOrdering", "occursAfterInOrdering"),
            "orderingConstraints",
            "give an action class `orderingConstraints value O` for each of them, and `subAction some X`",
        ),
    ),
    Reader(
        workflow.tasks,
        workflow.read,
        Loose(
            "parts of a workflow",
            ("definesTask", "hasBindingRole"),
            "hasStep",
            "give the workflow `hasStep` with each of its tasks",
        ),
    ),
    Reader(
        action_table.tasks,
        action_table.read,
        Loose(
            "a chain of actions",
            ("nextAction", "previousAction"),
            "subAction",
            "give the individual that they are part of `subAction` with the first of them",
        ),
    ),
]
"""The readers in the order of their use: the first that finds a recipe reads it."""


def register(reader: Reader) -> None:
    """Add a reader of one more dialect; it is asked after those that are there."""
    READERS.append(reader)
    REGISTERED_WORDS.extend(reader.words)


def statements_of(ontology: Ontology, iri: str) -> Statements | None:
    """Return what a class or an individual states, with its data flow; None if it states no recipe."""
    for reader in READERS:
        found = reader.read(ontology, iri)
        if found is not None:
            return read_data_flow(ontology, found)
    return None


def tasks_of(ontology: Ontology) -> tuple[str, ...]:
    """Return the classes and individuals of the main document that may state a recipe, each once."""
    return tuple(dict.fromkeys(iri for reader in READERS for iri in reader.tasks(ontology)))


def loose_parts(ontology: Ontology) -> list[Diagnostic]:
    """Return an error (R003) about parts of a recipe in the main document that no task holds together, if any.

    The first reader that knows such parts is the one that is believed.
    """
    main = str(ontology.documents[0].path)
    own = [triple for triple in ontology.triples() if triple.span.file == main]
    used = {local_name(triple.predicate) for triple in own}
    used |= {
        local_name(triple.object)
        for triple in own
        if triple.predicate == OWL.onProperty and isinstance(triple.object, str)
    }
    for loose in (reader.loose for reader in READERS if reader.loose is not None):
        spans = [triple.span for triple in own if local_name(triple.predicate) in loose.marks]
        if spans and loose.holder not in used:
            return [
                error("R003", f"this file has {loose.parts}, but no task that they belong to", min(spans), loose.help)
            ]
    return []
