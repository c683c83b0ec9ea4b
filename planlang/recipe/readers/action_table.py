"""Dialect D4: action data tables, individuals with a chunk as ``subAction``; ``nextAction`` leads from it to the next.

A chunk is an individual of a class of actions. ``nextAction`` and ``previousAction`` are the only orders; what no
chain leads to but ``subAction`` names is unordered. The objects of a table have roles: the main object is acted on, the
secondary one is where it goes.
"""

from __future__ import annotations

from collections.abc import Iterator

from planlang.ontology import Ontology, expand
from planlang.recipe.model import Ordering
from planlang.recipe.statements import Filling, Statements, SubAction, facts, named

_SUBS = ("subAction", "subEvents")
_ROLES = {
    "objectActedOn": ("adtMainObject", "adtPrimaryObject"),
    "toLocation": ("adtSecondaryObject",),
}
"""Property of the action -> roles of an object in a table; the first that is filled counts."""


def tasks(ontology: Ontology) -> Iterator[str]:
    """The individuals of the main document that have sub-actions."""
    for triple in ontology.using(*_SUBS):
        if isinstance(triple.subject, str) and ontology.main(triple.subject):
            yield triple.subject


def read(ontology: Ontology, iri: str) -> Statements | None:
    """The chunks of a table in the order of the chain; None if the individual has no sub-action."""
    firsts = facts(ontology, iri, *_SUBS)
    if not firsts:
        return None
    chunks = dict(sorted(named(firsts)))
    orderings: dict[tuple[str, str], Ordering] = {}
    reached = list(chunks)
    for chunk in reached:
        neighbours: list[tuple[str, Filling]] = []
        for fact in facts(ontology, chunk, "nextAction", "previousAction"):
            if isinstance(fact.term, str):
                neighbours.append((fact.term, fact))
        for triple in ontology.triples(o=chunk):
            if isinstance(triple.subject, str) and triple.predicate.endswith(("#nextAction", "#previousAction")):
                neighbours.append((triple.subject, Filling(_inverse(triple.predicate), triple.subject, triple.span)))
        for other, fact in neighbours:
            pair = (chunk, other) if fact.property.endswith("#nextAction") else (other, chunk)
            orderings.setdefault(pair, Ordering(*pair, span=fact.span))
            if other not in chunks:
                chunks[other] = fact.span
                reached.append(other)
    return Statements(
        iri,
        "D4",
        tuple(SubAction(chunk, (), span) for chunk, span in chunks.items()),
        tuple(orderings[pair] for pair in sorted(orderings)),
        fillings=tuple(
            Filling(expand(property_name), fact.term, fact.span)
            for property_name, roles in _ROLES.items()
            for fact in next(filter(None, (facts(ontology, iri, role) for role in roles)), ())
        ),
    )


def _inverse(predicate: str) -> str:
    if predicate.endswith("#nextAction"):
        return predicate.removesuffix("nextAction") + "previousAction"
    return predicate.removesuffix("previousAction") + "nextAction"
