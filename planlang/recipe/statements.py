"""What a file states about one task, in a form common to all dialects, and the words of the recipe vocabulary."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from itertools import chain
from typing import NamedTuple

from planlang.designators import local_name, local_part
from planlang.diagnostics import Span
from planlang.ontology import BNode, Ontology, Restriction, Term, shorten
from planlang.recipe.model import Dialect, Ending, Flow, Ordering, Overlap, StateMachine, Transition
from planlang.records import dataclass

KINDS = ("some", "value", "min", "exactly")
"""Kinds of restrictions that state a filler."""


class Filling(NamedTuple):
    """A property (IRI) of an action and the term that fills it; ``number`` of them, if a cardinality says so.

    ``kind`` is that of the restriction that states it, "value" for a fact.
    """

    property: str
    term: Term
    span: Span
    number: int = 1
    kind: str = "value"


@dataclass(frozen=True, slots=True)
class SubAction:
    """A sub-action as the file states it: a class or an individual, with the properties filled where it is mentioned.

    ``iri`` is None for an anonymous expression. ``times`` is the number of repetitions. For a union of classes,
    ``alternatives`` are its members in order, each with the name (IRI) of a recipe whose only step it is.
    """

    iri: str | None
    fillings: tuple[Filling, ...]
    span: Span
    times: int = 1
    alternatives: tuple[tuple[str, SubAction], ...] = ()


@dataclass(frozen=True, slots=True)
class LooseEnd:
    """An incomplete statement: ``what`` names it, ``missing`` are the properties without a filler."""

    what: str
    missing: tuple[str, ...]
    span: Span


@dataclass(frozen=True, slots=True)
class States:
    """Start states, end states (IRIs) and transitions of a finite-state recipe; each may be missing."""

    starts: tuple[str, ...]
    ends: tuple[str, ...]
    transitions: tuple[Transition, ...]

    def machine(self) -> StateMachine | None:
        """State machine that begins in the first start state; None if there is no start state."""
        return StateMachine(self.starts[0], self.ends, self.transitions) if self.starts else None


@dataclass(frozen=True, slots=True)
class Statements:
    """A recipe as the file states it for the task ``iri``, valid or not, in the order of the file.

    ``states`` is None unless it is a finite-state recipe. ``foreign`` are properties of other namespaces that were read
    as those of the vocabulary with the same local name, ``phases`` processes (IRIs) that go on while steps run.
    """

    iri: str
    dialect: Dialect
    sub_actions: tuple[SubAction, ...]
    orderings: tuple[Ordering, ...] = ()
    overlaps: tuple[Overlap, ...] = ()
    phases: tuple[str, ...] = ()
    flows: tuple[Flow, ...] = ()
    states: States | None = None
    loose: tuple[LooseEnd, ...] = ()
    fillings: tuple[Filling, ...] = ()
    foreign: tuple[Filling, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The sub-actions (IRIs), each once."""
        return tuple(dict.fromkeys(sub.iri for sub in self.sub_actions if sub.iri is not None))

    def mentioned(self) -> tuple[str, ...]:
        """List the sub-actions, and everything else that is ordered, receives data, or is a state."""
        states = self.states or States((), (), ())
        pairs = (
            *((one.before, one.after) for one in self.orderings),
            *((one.first, one.second) for one in self.overlaps),
            *((one.producer, one.consumer) for one in self.flows),
            *((one.source, one.target) for one in states.transitions),
        )
        names_in_order = dict.fromkeys((*self.names, *chain.from_iterable(pairs), *states.starts, *states.ends))
        return tuple(name for name in names_in_order if name not in self.phases)


def is_word(iri: str, *names: str) -> bool:
    """Check whether a property is one of these of the recipe vocabulary.

    Only local names are compared, because some recipes have the vocabulary in a namespace of their own.
    """
    return _local(iri) in names


_local = lru_cache(maxsize=10_000)(local_part)  # recipes use few properties, and each statement asks for one


def is_foreign(iri: str) -> bool:
    """True for a property that the bundled vocabulary does not have under this IRI."""
    return shorten(iri) == iri


def facts(ontology: Ontology, subject: str | BNode, *names: str) -> list[Filling]:
    """List the distinct facts of an individual whose property has one of these local names, in document order."""
    fillings = [Filling(triple.predicate, triple.object, triple.span) for triple in ontology.said(subject, *names)]
    if len(fillings) < 2:
        return fillings
    return list({(filling.property, filling.term): filling for filling in reversed(fillings)}.values())[::-1]


def named_iris(fillings: Iterable[Filling]) -> list[tuple[str, Span]]:
    """IRIs among the fillers, with their positions."""
    return [
        (filling.term, filling.span)
        for filling in fillings
        if isinstance(filling.term, str) and not isinstance(filling.term, BNode)
    ]


def read_ends(
    ontology: Ontology, term: str | BNode, span: Span, *words: str
) -> tuple[list[list[str]], Span, tuple[LooseEnd, ...]]:
    """Read a constraint that is mentioned at ``span``: the fillers (IRIs) of each of ``words``, and where they stand.

    The first two words are required: a loose end reports those without a filler.
    """
    fillers = [[name for name, _ in named_iris(facts(ontology, term, word))] for word in words]
    where = (ontology.span(term) if isinstance(term, str) else None) or span
    missing = tuple(word for word, iris in zip(words[:2], fillers, strict=False) if not iris)
    loose = LooseEnd(str(term), missing, span if len(missing) == 2 else where)
    return fillers, where, (loose,) if missing else ()


def fillings_of(restrictions: Iterable[Restriction]) -> tuple[Filling, ...]:
    """Fillings that restrictions state."""
    return tuple(
        Filling(one.property, one.filler, one.span, one.cardinality or 1, one.kind)
        for one in restrictions
        if one.kind in KINDS and one.cardinality != 0
    )


ON_ACTIONS = (
    "subAction", "subEvents", "orderingConstraints", "inputOutputConstraints", "stateTransition", "taskStartState",
    "taskEndState", "nextAction", "previousAction", "conditionEvaluated", "isTaskOf", "hasStep", "definesTask",
)  # fmt: skip
"""Properties (local names, in any namespace) that state the steps of actions and their order."""

ON_INDIVIDUALS = (
    "occursBeforeInOrdering", "occursAfterInOrdering", "isStepOf", "stepOf", "isPlanFor", "isTaskDefinedIn",
    "isDefinedIn", "hasPlan", "hasPhase", "isPhaseOf", "adtMainObject", "adtPrimaryObject", "adtSecondaryObject",
    "taskContext", "instruction",
)  # fmt: skip
"""Properties of constraints, workflows and action data tables that describe no object and no place."""

WORDS = (
    *ON_ACTIONS, *ON_INDIVIDUALS,
    "createsOutput", "requiresInput", "resourceType", "outputsCreated", "fromState", "toState", "causedBy",
    "hasTask", "classifies", "isClassifiedBy", "isRoleOf", "hasRole", "hasBindingRole", "hasBindingFiller",
)  # fmt: skip
"""All properties that the readers of dialects read."""

CONSTRAINT_CLASSES = ("PartialOrdering-Strict", "PartialOrdering", "InputOutputMapping")
"""Classes of constraints. Readers look at the properties of a constraint, so its class may be in any namespace."""

NAMING = (
    "subAction", "subEvents", "orderingConstraints", "occursBeforeInOrdering", "occursAfterInOrdering",
    "inputOutputConstraints", "createsOutput", "requiresInput", "stateTransition", "fromState", "toState", "causedBy",
    "taskStartState", "taskEndState", "nextAction", "previousAction", "hasStep", "definesTask",
)  # fmt: skip
"""Properties whose values are IRIs of actions, constraints, states or outcomes, never literals."""

REGISTERED_WORDS: list[str] = []
"""Properties that readers of added dialects read; see :func:`planlang.recipe.readers.register`."""

MEANINGS: dict[Ending, tuple[str, ...]] = {
    Ending.FAILED: (
        "failed", "fail", "fails", "failure", "failures", "failing", "error", "errors", "aborted", "abort", "aborts",
        "timeout", "unsuccessful", "preempted", "cancelled", "canceled", "notok", "nok",
    ),
    Ending.DONE: (
        "ok", "okay", "completed", "complete", "completes", "completion", "successful", "successfully", "succeeded",
        "succeed", "succeeds", "success", "done", "finished", "finish", "finishes",
    ),
    Ending.TRUE: ("true", "yes", "obtain", "obtains", "hold", "holds"),
    Ending.FALSE: ("false", "no", "not"),
}  # fmt: skip
"""Words in the names of outcomes, by their meaning; the usual one of similar words comes first."""

_IN_NAMES = re.compile(r"[A-Z]?[a-z]+|[A-Z]+|\d+")


def words_of(outcome: str) -> tuple[str, ...]:
    """Split the local name of an outcome into words, as written."""
    return tuple(_IN_NAMES.findall(local_name(outcome)))


def ending_of(outcome: str) -> Ending:
    """Classify an outcome by the words in its local name, such as COMPLETED_OK or CONDITION_FALSE."""
    words = {word.lower() for word in words_of(outcome)}
    endings = {ending for ending, meaning in MEANINGS.items() if not words.isdisjoint(meaning)}
    if Ending.FAILED in endings:
        return Ending.FAILED
    if Ending.FALSE in endings:
        return Ending.FAILED if Ending.DONE in endings else Ending.FALSE
    return Ending.TRUE if Ending.TRUE in endings else Ending.DONE if Ending.DONE in endings else Ending.OTHER
