"""What a recipe's file says about one task, before it is judged: the same for every dialect."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import NamedTuple

from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology import BNode, Ontology, Restriction, Term, shorten
from planlang.recipe.model import Flow, Ordering, Overlap, StateMachine

KINDS = ("some", "value", "min", "exactly")
"""Kinds of restrictions that say that there is something."""


class Filling(NamedTuple):
    """A property (IRI) of an action and the term that fills it."""

    property: str
    term: Term
    span: Span


@dataclass(frozen=True, slots=True)
class SubAction:
    """A sub-action as the file states it: a class or an individual, and what is filled in where it is mentioned.

    ``iri`` is None for an expression that names nothing. ``times`` is how often it is to be performed.
    """

    iri: str | None
    fillings: tuple[Filling, ...]
    span: Span
    times: int = 1


@dataclass(frozen=True, slots=True)
class LooseEnd:
    """A statement that lacks something: ``what`` names it, ``missing`` are the properties that nothing fills."""

    what: str
    missing: tuple[str, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class Statements:
    """What is stated about the task ``iri``, right or wrong, in the order of the file.

    ``starts`` and ``ends`` are the states in which a finite-state recipe begins and is done; ``states`` are all that
    it names. ``machine`` is None if it is none, or if it names no state to begin with. ``foreign`` are properties
    (IRIs) that were taken for those of the vocabulary with the same name.
    """

    iri: str
    dialect: str
    sub_actions: tuple[SubAction, ...]
    orderings: tuple[Ordering, ...] = ()
    overlaps: tuple[Overlap, ...] = ()
    flows: tuple[Flow, ...] = ()
    machine: StateMachine | None = None
    starts: tuple[str, ...] = ()
    ends: tuple[str, ...] = ()
    loose: tuple[LooseEnd, ...] = ()
    fillings: tuple[Filling, ...] = ()
    foreign: tuple[Filling, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The sub-actions (IRIs), each once."""
        return tuple(dict.fromkeys(sub.iri for sub in self.sub_actions if sub.iri is not None))

    @property
    def is_finite_state(self) -> bool:
        """True for a finite-state recipe."""
        return self.dialect == "D3"

    def mentioned(self) -> tuple[str, ...]:
        """The sub-actions, and everything else that is ordered, passed something, or a state."""
        transitions = self.machine.transitions if self.machine is not None else ()
        pairs = (
            *((one.before, one.after) for one in self.orderings),
            *((one.first, one.second) for one in self.overlaps),
            *((one.producer, one.consumer) for one in self.flows),
            *((one.source, one.target) for one in transitions),
        )
        return tuple(dict.fromkeys((*self.names, *chain.from_iterable(pairs), *self.starts, *self.ends)))


def is_word(iri: str, *names: str) -> bool:
    """True for these properties of the recipe vocabulary.

    They are told by their local names, as some recipes have them in a namespace of their own.
    """
    return _local(iri) in names


_local = lru_cache(maxsize=10_000)(local_name)  # of properties: few, and asked of all that is stated


def is_foreign(iri: str) -> bool:
    """True for a property that the bundled vocabulary does not have under this IRI."""
    return shorten(iri) == iri


def facts(ontology: Ontology, subject: str | BNode, *names: str) -> list[Filling]:
    """The facts of an individual whose property has one of these local names, in document order."""
    found = [Filling(triple.predicate, triple.object, triple.span) for triple in ontology.said(subject, *names)]
    if len(found) < 2:
        return found
    return list({(filling.property, filling.term): filling for filling in reversed(found)}.values())[::-1]


def named(fillings: Iterable[Filling]) -> list[tuple[str, Span]]:
    """The IRIs among what is filled in, with their places."""
    return [
        (filling.term, filling.span)
        for filling in fillings
        if isinstance(filling.term, str) and not isinstance(filling.term, BNode)
    ]


def filled(restrictions: Iterable[Restriction]) -> tuple[Filling, ...]:
    """What restrictions fill in."""
    return tuple(
        Filling(restriction.property, restriction.filler, restriction.span)
        for restriction in restrictions
        if restriction.kind in KINDS
    )
