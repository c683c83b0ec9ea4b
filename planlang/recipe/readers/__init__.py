"""Readers of the dialects in which recipes are written; each yields the same statements.

General layout: one file for each reader. ``partial_order`` reads classes with sub-actions and ordering constraints, in
an intersection, flat or equivalent, as ``subAction`` or ``subEvents``, ``finite_state`` classes with states and
transitions, ``action_table`` individuals chained by ``nextAction``, ``workflow`` individuals with ``hasStep`` and
relations of intervals. Inputs and outputs are read in any of them. The reader is chosen for each class or
individual by its statements, so that one file may mix dialects. ``register`` adds a reader for another dialect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product

from planlang.closure import grouped, leads_to
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error
from planlang.kept import kept
from planlang.ontology import BNode, Literal, Ontology, expand, shorten
from planlang.ontology.terms import OWL
from planlang.recipe.fillers import fillings
from planlang.recipe.model import Flow, Ordering, Reason
from planlang.recipe.readers import action_table, finite_state, partial_order, workflow
from planlang.recipe.readers.alternatives import with_alternatives
from planlang.recipe.statements import (
    REGISTERED_WORDS,
    Filling,
    LooseEnd,
    Statements,
    SubAction,
    facts,
    fillings_of,
    is_word,
    read_ends,
)
from planlang.records import dataclass

OUTPUTS = ("outputsCreated", "outputs")


def read_data_flow(ontology: Ontology, statements: Statements) -> Statements:
    """Add the data flows that the statements and their sub-actions state, and the orders that these imply."""
    mapped, loose = _mapped(ontology, statements)
    flows = (*statements.flows, *mapped, *_produced(ontology, statements))
    orders = () if statements.states is not None else _orders(statements, flows)
    return replace(
        statements,
        flows=flows,
        orderings=(*statements.orderings, *orders),
        loose=(*statements.loose, *loose),
    )


def _orders(statements: Statements, flows: tuple[Flow, ...]) -> Iterator[Ordering]:
    """Yield the orders that flows imply. Mappings always order; the use of a named thing does only if the steps are
    unordered.
    """
    if not flows:
        return
    follows = grouped((ordering.before, ordering.after) for ordering in statements.orderings)
    for flow in sorted(flows, key=lambda flow: flow.iri is None):
        before, after = flow.producer, flow.consumer
        if flow.iri is None and (after in follows.get(before, ()) or leads_to(follows, after, before)):
            continue
        follows.setdefault(before, []).append(after)
        yield Ordering(before, after, flow.iri, Reason.DATA_FLOW, flow.span)


def created_individuals(ontology: Ontology, statements: Statements) -> frozenset[str]:
    """Individuals (IRIs) that sub-actions create, which need not be defined elsewhere.

    They are named as outputs, or fill a property whose filler the class of the action creates (``makes`` of a
    Primitive).
    """
    return frozenset(name for _, name, _ in _outputs(ontology, statements))


def _mapped(ontology: Ontology, statements: Statements) -> tuple[list[Flow], list[LooseEnd]]:
    flows: list[Flow] = []
    loose: list[LooseEnd] = []
    fillings_of_task = [
        *fillings_of(
            one for one in ontology.restrictions(statements.iri) if is_word(one.property, "inputOutputConstraints")
        ),
        *facts(ontology, statements.iri, "inputOutputConstraints"),
    ]
    for filling in fillings_of_task:
        mapping = filling.term
        if not isinstance(mapping, (str, BNode)):
            continue
        words = ("createsOutput", "requiresInput", "resourceType")
        (producers, consumers, resources), span, missing = read_ends(ontology, mapping, filling.span, *words)
        loose += missing
        classes: Sequence[str | None] = resources or [None]
        flows += [
            Flow(producer, consumer, resource, _consumed(ontology, statements, consumer, resource), str(mapping), span)
            for producer, consumer, resource in product(producers, consumers, classes)
        ]
    return flows, loose


def _produced(ontology: Ontology, statements: Statements) -> list[Flow]:
    """Flows of named things that one sub-action creates and others use."""
    flows: dict[tuple[str, str, str], Flow] = {}
    outputs = list(_outputs(ontology, statements))
    if not outputs:
        return []
    for sub in statements.sub_actions:
        if sub.iri is None:
            continue
        for filling in _all(ontology, sub):
            for producer, name, span in outputs:
                if filling.term == name and producer != sub.iri and not is_word(filling.property, *OUTPUTS):
                    flow = Flow(producer, sub.iri, name, shorten(filling.property), span=span)
                    flows.setdefault((producer, sub.iri, name), flow)
    return [flows[key] for key in sorted(flows)]


def _outputs(ontology: Ontology, statements: Statements) -> Iterator[tuple[str, str, Span]]:
    is_inherited, produced = _states_outputs(ontology), _products_by_class(ontology)
    for sub in statements.sub_actions:
        if sub.iri is not None:
            for filling in _all(ontology, sub) if is_inherited else sub.fillings:
                term = filling.term
                if is_word(filling.property, *OUTPUTS) and isinstance(term, str) and not ontology.is_class(term):
                    yield sub.iri, term, filling.span
            products = frozenset().union(*(produced.get(cls, ()) for cls in ontology.ancestors(sub.iri)))
            for filling in _all(ontology, sub) if products else ():
                term = filling.term
                if filling.property in products and isinstance(term, str) and not ontology.defined(term):
                    yield sub.iri, term, filling.span


@kept
def _products_by_class(ontology: Ontology) -> dict[str, set[str]]:
    table: dict[str, set[str]] = {}
    for one in ontology.individuals(expand("Primitive")):
        names = [value.value for value in ontology.values(one, expand("makes")) if isinstance(value, Literal)]
        for action in ontology.values(one, expand("performsAction")) if names else ():
            table.setdefault(str(action), set()).update(map(expand, names))
    return table


@kept
def _states_outputs(ontology: Ontology) -> bool:
    """True if any document states outputs."""
    store = ontology.store
    restricted = map(store.name, set(map(store.objects.__getitem__, store.by(OWL.onProperty))))
    is_restricted = any(name is not None and is_word(name, *OUTPUTS) for name in restricted)
    return is_restricted or bool(ontology.properties_named(*OUTPUTS))


def _consumed(ontology: Ontology, statements: Statements, consumer: str, resource: str | None) -> str | None:
    """Property of the consumer that is filled with the resource, or with an instance or a subclass of it."""
    for sub in statements.sub_actions:
        if sub.iri == consumer and resource is not None:
            for filling in _all(ontology, sub):
                if isinstance(filling.term, str) and (
                    filling.term == resource or ontology.is_a(filling.term, resource)
                ):
                    return shorten(filling.property)
    return None


def _all(ontology: Ontology, sub: SubAction) -> Iterator[Filling]:
    assert sub.iri is not None
    for level in fillings(ontology, sub.iri, sub.fillings):
        yield from level


@dataclass(frozen=True, slots=True)
class Loose:
    """How to recognise parts of a recipe that no task refers to.

    ``parts`` names them in a message; ``marks`` are the local names of their properties, ``holder`` that of the
    property by which a task refers to them; ``help`` is the advice if no task does.
    """

    parts: str
    marks: tuple[str, ...]
    holder: str
    help: str


@dataclass(frozen=True, slots=True)
class Reader:
    """A reader of one dialect, or of several similar ones.

    ``tasks`` yields the classes or individuals (IRIs) of the main document that may state a recipe; ``read`` reads the
    statements of one, or gives None if it is not a recipe in this dialect. ``words`` are the local names of properties
    that only this reader reads: they fill no parameters, and typos in them are reported as misspellings.
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
"""All readers, in the order in which they are tried."""


def register(reader: Reader) -> None:
    """Add a reader for another dialect; it is tried after the existing ones."""
    READERS.append(reader)
    REGISTERED_WORDS.extend(reader.words)


def statements_of(ontology: Ontology, iri: str) -> Statements | None:
    """Read the statements of a class or an individual, with its data flow; None if it states no recipe."""
    for reader in READERS:
        statements = reader.read(ontology, iri)
        if statements is not None:
            return with_alternatives(ontology, read_data_flow(ontology, statements))
    return None


def tasks_of(ontology: Ontology) -> tuple[str, ...]:
    """Classes and individuals of the main document that may state a recipe, each once."""
    return tuple(dict.fromkeys(iri for reader in READERS for iri in reader.tasks(ontology)))


def loose_parts(ontology: Ontology) -> list[Diagnostic]:
    """Report (R003) parts of a recipe in the main document that no task refers to, if any.

    Only the first reader that recognises such parts reports them.
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
