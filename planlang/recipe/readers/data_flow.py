"""Side form: data flow, ``inputOutputConstraints value M`` where M is an ``InputOutputMapping``.

``createsOutput A``, ``requiresInput B``, ``resourceType R``: A makes something of class R, which B needs, so that A
comes before B. One action that creates something with a name of its own (``outputsCreated nextPose``) and another that
uses that very thing say the same. Where states follow each other things are passed without an order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import networkx as nx

from planlang.diagnostics import Span
from planlang.ontology import BNode, Ontology, shorten
from planlang.ontology.terms import OWL
from planlang.recipe.fillers import fillings
from planlang.recipe.model import Flow, Ordering, Reason
from planlang.recipe.statements import Filling, LooseEnd, Statements, SubAction, described, facts, filled, is_word

OUTPUTS = ("outputsCreated", "outputs")


def read_data_flow(ontology: Ontology, statements: Statements) -> Statements:
    """Return the statements with the data flows that they and their sub-actions state, and the implied orders."""
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
    """Yield the orders that flows imply: of a mapping always, of a thing that is used by name only if neither the order
    nor its opposite is stated."""
    if not flows:
        return
    graph = nx.DiGraph((ordering.before, ordering.after) for ordering in statements.orderings)
    for flow in sorted(flows, key=lambda flow: flow.iri is None):
        ends = (flow.producer, flow.consumer)
        graph.add_nodes_from(ends)
        if flow.iri is None and (graph.has_edge(*ends) or nx.has_path(graph, *ends[::-1])):
            continue
        graph.add_edge(*ends)
        yield Ordering(*ends, flow.iri, Reason.DATA_FLOW, flow.span)


def made(ontology: Ontology, statements: Statements) -> frozenset[str]:
    """Return the individuals (IRIs) that sub-actions create: they need not be defined anywhere else."""
    key = ("made", statements.iri)
    if key not in ontology.kept:
        ontology.kept[key] = frozenset(name for _, name, _ in _outputs(ontology, statements))
    found: frozenset[str] = ontology.kept[key]
    return found


def _mapped(ontology: Ontology, statements: Statements) -> tuple[list[Flow], list[LooseEnd]]:
    flows: list[Flow] = []
    loose: list[LooseEnd] = []
    stated = [
        *filled(
            one for one in ontology.restrictions(statements.iri) if is_word(one.property, "inputOutputConstraints")
        ),
        *facts(ontology, statements.iri, "inputOutputConstraints"),
    ]
    for filling in stated:
        mapping = filling.term
        if not isinstance(mapping, (str, BNode)):
            continue
        words = ("createsOutput", "requiresInput", "resourceType")
        (producers, consumers, resources), span, missing = described(ontology, mapping, filling.span, *words)
        loose += missing
        classes: Sequence[str | None] = resources or [None]
        flows += [
            Flow(producer, consumer, resource, _consumed(ontology, statements, consumer, resource), str(mapping), span)
            for producer, consumer, resource in product(producers, consumers, classes)
        ]
    return flows, loose


def _produced(ontology: Ontology, statements: Statements) -> list[Flow]:
    """Return the flows of things that one sub-action creates by name and others use."""
    found: dict[tuple[str, str, str], Flow] = {}
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
                    found.setdefault((producer, sub.iri, name), flow)
    return [found[key] for key in sorted(found)]


def _outputs(ontology: Ontology, statements: Statements) -> Iterator[tuple[str, str, Span]]:
    is_inherited = _states_outputs(ontology)
    for sub in statements.sub_actions:
        if sub.iri is not None:
            for filling in _all(ontology, sub) if is_inherited else sub.fillings:
                term = filling.term
                if is_word(filling.property, *OUTPUTS) and isinstance(term, str) and not ontology.is_class(term):
                    yield sub.iri, term, filling.span


def _states_outputs(ontology: Ontology) -> bool:
    """Return True if any document states what something creates."""
    if "states outputs" not in ontology.kept:
        store = ontology.store
        restricted = map(store.name, set(map(store.objects.__getitem__, store.by(OWL.onProperty))))
        is_restricted = any(name is not None and is_word(name, *OUTPUTS) for name in restricted)
        ontology.kept["states outputs"] = is_restricted or bool(ontology.properties_named(*OUTPUTS))
    return bool(ontology.kept["states outputs"])


def _consumed(ontology: Ontology, statements: Statements, consumer: str, resource: str | None) -> str | None:
    """Return the property of the consumer that is filled with the resource, or with something of its class."""
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
