"""What the bundled data says about action classes: primitives, goals and recoveries (primitives.omn, recovery.omn)."""

from __future__ import annotations

from dataclasses import dataclass

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error
from planlang.ontology import Literal, Ontology, Term, expand


@dataclass(frozen=True, slots=True)
class Primitive:
    """An action class that a process module performs.

    ``resources`` are roles (base, head, torso, arm, gripper); ``implies`` are classes of actions that are performed
    on the way; ``releases`` are the properties whose filler the action lets go of.
    """

    action: str
    module: str
    resources: tuple[str, ...] = ()
    implies: tuple[str, ...] = ()
    releases: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Goal:
    """The condition that an action class brings about, e.g. ``holding(objectActedOn)``."""

    action: str
    predicate: str
    properties: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RecoveryRule:
    """How to recover from a failure of an action: strategy, how often, and what to raise when that is used up."""

    name: str
    actions: tuple[str, ...]
    failures: tuple[str, ...]
    strategy: str
    attempts: int
    escalates_to: str | None
    rank: int
    span: Span | None = None
    problems: tuple[Diagnostic, ...] = ()
    """Errors (R037) of numbers that are none; the rule has the default instead."""


def texts(ontology: Ontology, subject: str, property_name: str) -> tuple[str, ...]:
    """Values of a property as written: text of literals, local names of IRIs."""
    return tuple(_text(term) for term in ontology.values(subject, property_name))


def read_primitives(ontology: Ontology) -> dict[str, Primitive]:
    """All primitives, by the IRI of their class."""
    table: dict[str, Primitive] = {}
    for individual in ontology.individuals(expand("Primitive")):
        for action in ontology.values(individual, "performsAction"):
            if isinstance(action, str):
                table[action] = Primitive(
                    action,
                    _first(texts(ontology, individual, "processModule")) or "",
                    texts(ontology, individual, "usesResource"),
                    tuple(term for term in ontology.values(individual, "impliesAction") if isinstance(term, str)),
                    texts(ontology, individual, "releases"),
                )
    return table


def read_goals(ontology: Ontology) -> dict[str, Goal]:
    """All goals, by the IRI of their action class. A condition is written ``predicate(property, ...)``."""
    table: dict[str, Goal] = {}
    for individual in ontology.individuals(expand("Goal")):
        for action in ontology.values(individual, "ofAction"):
            for condition in texts(ontology, individual, "condition"):
                predicate, _, inside = condition.partition("(")
                properties = tuple(part.strip() for part in inside.rstrip(") ").split(",") if part.strip())
                if isinstance(action, str):
                    table[action] = Goal(action, predicate.strip(), properties)
    return table


def read_recoveries(ontology: Ontology) -> tuple[RecoveryRule, ...]:
    """All recovery rules, in the order of the files."""
    rules = []
    for individual in ontology.individuals(expand("Recovery")):
        problems: list[Diagnostic] = []
        strategy = _first(texts(ontology, individual, "strategy"))
        if strategy is None:
            continue
        rules.append(
            RecoveryRule(
                local_name(individual),
                tuple(term for term in ontology.values(individual, "recoversAction") if isinstance(term, str)),
                texts(ontology, individual, "recoversFailure"),
                strategy,
                _count(ontology, individual, "attempts", 1, problems),
                _first(texts(ontology, individual, "escalatesTo")),
                _count(ontology, individual, "rank", 0, problems),
                ontology.span(individual),
                tuple(problems),
            )
        )
    return tuple(rules)


def recoveries_of(ontology: Ontology, rules: tuple[RecoveryRule, ...], cls: str) -> list[tuple[str, RecoveryRule]]:
    """The rules that hold for an action class, as pairs (failure, rule), nearest class first, then by rank.

    A rule for the same failure nearer by replaces the farther; ``attempts 0`` switches it off.
    """
    chosen: dict[str, RecoveryRule] = {}
    for ancestor in ontology.ancestors(cls):
        nearer = set(chosen)
        for rule in sorted(rules, key=lambda rule: rule.rank):
            if ancestor in rule.actions:
                for failure in rule.failures:
                    if failure not in nearer:
                        chosen.setdefault(failure, rule)
    return [(failure, rule) for failure, rule in chosen.items() if rule.attempts > 0]


def _count(ontology: Ontology, subject: str, property_name: str, default: int, problems: list[Diagnostic]) -> int:
    for triple in ontology.triples(subject, expand(property_name)):
        try:
            number = triple.object.number() if isinstance(triple.object, Literal) else -1
        except ValueError:
            number = -1
        if number >= 0 and float(number).is_integer():
            return int(number)
        said = triple.object.value if isinstance(triple.object, Literal) else _text(triple.object)
        message = (
            f"{property_name} of the recovery `{local_name(subject)}` is {said!r}, which is no whole number from 0 on"
        )
        problems.append(error("R037", message, triple.span, f"write a number, such as {default}"))
    return default


def _text(term: Term) -> str:
    if isinstance(term, Literal):
        return term.value
    return local_name(term) if isinstance(term, str) else ""


def _first(values: tuple[str, ...]) -> str | None:
    return values[0] if values else None
