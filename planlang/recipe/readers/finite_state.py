"""Dialect D3: a class with states and transitions.

``stateTransition T`` names an individual with ``fromState A``, ``toState B`` and ``causedBy`` outcomes;
``taskStartState`` and ``taskEndState`` name its start and end states. States are the sub-actions; loops are allowed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product

from planlang.diagnostics import Span
from planlang.ontology import BNode, Ontology, Restriction
from planlang.recipe.model import FINITE_STATE, Ending, Transition
from planlang.recipe.readers import partial_order
from planlang.recipe.statements import KINDS, LooseEnd, Statements, States, SubAction, ending_of, is_word, read_ends

tasks = partial_order.tasks


def read(ontology: Ontology, iri: str) -> Statements | None:
    """Read a class with states and transitions; None if it has no transition, start or end."""
    restrictions = [one for one in ontology.restrictions(iri) if one.kind in KINDS]
    if not any(is_word(one.property, "stateTransition", "taskStartState", "taskEndState") for one in restrictions):
        return None
    transitions, loose = _transitions(ontology, restrictions)
    starts, ends = (_states(restrictions, word) for word in ("taskStartState", "taskEndState"))
    subs = partial_order.in_stated_order(one for one in restrictions if partial_order.is_sub_action(one))
    sub_actions = [partial_order.read_sub_action(ontology, one, iri) for one in subs]
    orderings, open_constraints = partial_order.read_constraints(ontology, tuple(restrictions))
    if not sub_actions:
        sub_actions = _states_of_transitions(transitions, starts, ends, ontology.span(iri) or Span(""))
    states = States(tuple(start for start, _ in starts), tuple(end for end, _ in ends), transitions)
    return Statements(
        iri,
        FINITE_STATE,
        tuple(sub_actions),
        orderings,
        states=states,
        loose=(*loose, *open_constraints),
        foreign=partial_order.foreign_words(ontology, tuple(restrictions)),
    )


def _transitions(
    ontology: Ontology, restrictions: Iterable[Restriction]
) -> tuple[tuple[Transition, ...], tuple[LooseEnd, ...]]:
    """Read a transition for each pair of states and each outcome, and list transitions that lack a state."""
    transitions: list[Transition] = []
    loose: list[LooseEnd] = []
    for restriction in restrictions:
        event = restriction.filler
        if not is_word(restriction.property, "stateTransition") or not isinstance(event, (str, BNode)):
            continue
        words = ("fromState", "toState", "causedBy")
        (sources, targets, outcomes), span, missing = read_ends(ontology, event, restriction.span, *words)
        loose += missing
        causes: Sequence[str | None] = outcomes or [None]
        transitions += [
            Transition(source, target, ending_of(outcome) if outcome else Ending.DONE, outcome, str(event), span)
            for source, outcome, target in product(sources, causes, targets)
        ]
    transitions.sort(key=lambda one: (one.source, one.outcome or "", one.target))
    return tuple(transitions), tuple(loose)


def _states(restrictions: Iterable[Restriction], word: str) -> list[tuple[str, Span]]:
    return [
        (one.filler, one.span) for one in restrictions if is_word(one.property, word) and isinstance(one.filler, str)
    ]


def _states_of_transitions(
    transitions: tuple[Transition, ...], starts: list[tuple[str, Span]], ends: list[tuple[str, Span]], span: Span
) -> list[SubAction]:
    """States of a recipe without stated sub-actions: those that its transitions mention."""
    states: dict[str, Span] = dict(starts)
    for transition in transitions:
        states.setdefault(transition.source, transition.span or span)
        states.setdefault(transition.target, transition.span or span)
    for state, where in ends:
        states.setdefault(state, where)
    return [SubAction(state, (), where) for state, where in states.items()]
