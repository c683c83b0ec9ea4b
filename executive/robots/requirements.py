"""Requirements of actions and capabilities, read from their classes, and the tree of findings about a robot."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from enum import Enum
from typing import Any

from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology import Literal, Ontology, Term, expand
from planlang.ontology.expression_text import expression_of, text_of
from planlang.ontology.expressions import Expression
from planlang.records import dataclass


class Availability(Enum):
    """Availability of a part or capability on a robot."""

    AVAILABLE = "available"
    MISSING = "missing"
    UNKNOWN = "unknown"

    @classmethod
    def of(cls, is_there: bool | None) -> Availability:
        """Return the availability of what is there, is not there, or may be there (None)."""
        return cls.UNKNOWN if is_there is None else cls.AVAILABLE if is_there else cls.MISSING

    @property
    def decided(self) -> bool | None:
        """Whether it is there; None if that is unknown."""
        return {Availability.AVAILABLE: True, Availability.MISSING: False}.get(self)


class FindingKind(Enum):
    """Kind of a node of the tree."""

    TASK = "task"
    ACTION = "action"
    ALTERNATIVES = "alternatives"
    CAPABILITY = "capability"
    COMPONENT = "component"
    RECIPE = "recipe"
    MODEL = "recognition model"
    MAP = "map"
    ENTRY = "entry"
    """An entry of a knowledge base that cannot be used."""


NEEDED = (FindingKind.CAPABILITY, FindingKind.COMPONENT)
"""Kinds that a robot has or lacks; the other kinds are parts of the task, or knowledge."""
_UNLABELLED = (FindingKind.TASK, FindingKind.ACTION, FindingKind.ALTERNATIVES)


@dataclass(frozen=True, slots=True)
class Finding:
    """A node of the tree of findings.

    ``iri`` is None for an expression; ``span`` is where the robot claims it, ``required`` where the requirement is
    stated. A node that does not count only explains another: a part of a combination, or a circular requirement.
    """

    kind: FindingKind
    text: str
    iri: str | None
    state: Availability
    reason: str = ""
    span: Span | None = None
    below: tuple[Finding, ...] = ()
    required: Span | None = None
    counts: bool = True

    def walk(self, path: tuple[Finding, ...] = ()) -> Iterator[tuple[Finding, tuple[Finding, ...]]]:
        """Yield this finding and all below it that count, each with the findings above it, outermost first."""
        yield self, path
        for one in self.below:
            if one.counts:
                yield from one.walk((*path, self))

    def lines(self) -> Iterator[str]:
        """Draw the tree, line by line."""
        yield from self._lines("", "", set())

    def _lines(self, first: str, rest: str, drawn: set[tuple[str, str]]) -> Iterator[str]:
        key = (self.kind.value, self.iri or self.text)
        repeated = bool(self.below) and self.kind is FindingKind.CAPABILITY and key in drawn
        drawn.add(key)
        label = self.text if self.kind in _UNLABELLED else f"{self.kind.value} {self.text}"
        reason = f": {self.reason}" if self.reason else ""
        where = f" ({self.span})" if self.span is not None and self.kind in NEEDED else ""
        yield f"{first}{label} - {self.state.value}{reason}{where}{'; see above' if repeated else ''}"
        if repeated:
            return
        for one in self.below:
            corner, beam = ("`- ", "   ") if one is self.below[-1] else ("|- ", "|  ")
            yield from one._lines(rest + corner, rest + beam, drawn)

    def as_json(self) -> dict[str, Any]:
        """Convert the tree to JSON data."""
        data: dict[str, Any] = {"kind": self.kind.value, "name": self.text, "iri": self.iri, "state": self.state.value}
        if self.reason:
            data["reason"] = self.reason
        for key, span in (("stated_at", self.span), ("required_at", self.required)):
            if span is not None:
                data[key] = str(span)
        if self.below:
            data["requires"] = [one.as_json() for one in self.below]
        return data


def together(states: Iterable[Availability], *, any_of: bool = False) -> Availability:
    """Combine states into the worst, or with ``any_of`` the best of them; no states are AVAILABLE."""
    states_present = set(states)
    order = [Availability.MISSING, Availability.UNKNOWN, Availability.AVAILABLE]
    if any_of:
        order.reverse()
    return next((state for state in order if state in states_present), Availability.AVAILABLE)


PROPERTIES = {
    FindingKind.CAPABILITY: expand("srdl2-cap:dependsOnCapability"),
    FindingKind.COMPONENT: expand("srdl2-comp:dependsOnComponent"),
}
WORDS = {
    "dependsOnCapability": FindingKind.CAPABILITY,
    "hasCapabilityDependency": FindingKind.CAPABILITY,
    "dependsOnComponent": FindingKind.COMPONENT,
}
"""Kinds by local names of the properties, that of 2010 included: SRDL files use several namespaces."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """A requirement, stated by a restriction: ``kind`` is CAPABILITY or COMPONENT, ``quantifier`` as in Restriction.

    ``number`` is that of a cardinality, else 1.
    """

    kind: FindingKind
    quantifier: str
    expression: Expression
    number: int
    span: Span

    @property
    def name(self) -> str | None:
        """IRI of the class or individual; None for any other expression."""
        term = self.expression.term
        return term if isinstance(term, str) else None

    @property
    def text(self) -> str:
        """The requirement in Manchester syntax, cardinalities included."""
        words = text_of(self.expression)
        return f"{self.quantifier} {self.number} {words}" if self.quantifier in ("min", "max", "exactly") else words


def requirements_of(ontology: Ontology, cls: str) -> tuple[Requirement, ...]:
    """List the direct requirements of a class: restrictions of it and its ancestors, nearest first, each once.

    ``only`` is skipped, as it requires nothing to exist. So are expressions that cannot be read: the checks of the
    ontology report them.
    """
    kinds = {below: kind for kind, prop in PROPERTIES.items() for below in ontology.subproperties(prop)}
    unique: dict[tuple[FindingKind, str, Term, int], Requirement] = {}
    for restriction in ontology.inherited_restrictions(cls):
        kind = kinds.get(restriction.property) or WORDS.get(local_name(restriction.property))
        if kind is None or restriction.kind == "only" or isinstance(restriction.filler, Literal):
            continue
        expression = expression_of(ontology, restriction.filler, restriction.span)
        if expression is None:
            continue
        number = 1 if restriction.cardinality is None else restriction.cardinality
        key = (kind, restriction.kind, restriction.filler, number)
        unique.setdefault(key, Requirement(kind, restriction.kind, expression, number, restriction.span))
    return tuple(unique.values())


def requirements(ontology: Ontology, actions: Iterable[str]) -> tuple[Mapping[str, tuple[str, ...]], ...]:
    """Collect the capabilities and components that action classes require, dependencies of capabilities included.

    Returns two mappings, from the IRI of a class (the text of any other expression) to the classes that lead to it.
    """
    required: dict[FindingKind, dict[str, tuple[str, ...]]] = {kind: {} for kind in PROPERTIES}
    queue: list[tuple[str, tuple[str, ...]]] = [(action, (action,)) for action in dict.fromkeys(actions)]
    for cls, path in queue:
        for needed in requirements_of(ontology, cls):
            key = needed.name or needed.text
            if key not in required[needed.kind]:
                required[needed.kind][key] = path
                if needed.kind is FindingKind.CAPABILITY and needed.name is not None:
                    queue.append((needed.name, (*path, needed.name)))
    return required[FindingKind.CAPABILITY], required[FindingKind.COMPONENT]
