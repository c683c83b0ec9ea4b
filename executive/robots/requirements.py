"""What actions and capabilities require: components and other capabilities, as their classes say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum

from executive.robots.finding import FindingKind
from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology import BNode, Literal, Ontology, Term, expand
from planlang.ontology.expressions import Expression
from planlang.ontology.writing.expression_text import expression_of, text_of

PROPERTIES = {
    FindingKind.CAPABILITY: expand("srdl2-cap:dependsOnCapability"),
    FindingKind.COMPONENT: expand("srdl2-comp:dependsOnComponent"),
}
WORDS = {
    "dependsOnCapability": FindingKind.CAPABILITY,
    "hasCapabilityDependency": FindingKind.CAPABILITY,
    "dependsOnComponent": FindingKind.COMPONENT,
}
"""The same by local names, and that of 2010: SRDL has them in several namespaces."""


class Semantics(Enum):
    """How requirements are read, and when a capability is there.

    CLOSURE: through equivalent classes in both directions, closed under dependencies of capabilities; a claim counts
    when the components are there. ORIGINAL, for comparison, is what KnowRob's SRDL did: what stands in equivalent
    classes is not seen, a capability's own requirements of capabilities are not followed, a claim is believed, and what
    depends on nothing is there.
    """

    CLOSURE = "closure"
    ORIGINAL = "original"


@dataclass(frozen=True, slots=True)
class Requirement:
    """One restriction: ``kind`` is CAPABILITY or COMPONENT, ``quantifier`` as in Restriction.

    ``number`` is that of a cardinality, else 1.
    """

    kind: FindingKind
    quantifier: str
    expression: Expression
    number: int
    span: Span

    @property
    def name(self) -> str | None:
        """IRI of the class or individual, None for any other expression."""
        term = self.expression.term
        return term if isinstance(term, str) else None

    @property
    def text(self) -> str:
        """What is required, in Manchester syntax, with the number if it is not one."""
        words = text_of(self.expression)
        return f"{self.quantifier} {self.number} {words}" if self.quantifier in ("min", "max", "exactly") else words


def requirements_of(ontology: Ontology, cls: str, semantics: Semantics = Semantics.CLOSURE) -> tuple[Requirement, ...]:
    """What a class requires directly: restrictions of it and its ancestors, nearest first, each once.

    ``only`` requires nothing: it says what else may not be needed. Expressions that cannot be read are left out, the
    checks of the ontology tell of them.
    """
    kinds = {below: kind for kind, prop in PROPERTIES.items() for below in ontology.subproperties(prop)}
    found: dict[tuple[FindingKind, str, Term, int], Requirement] = {}
    for restriction in ontology.inherited_restrictions(cls):
        kind = kinds.get(restriction.property)
        if kind is None and semantics is Semantics.CLOSURE:
            kind = WORDS.get(local_name(restriction.property))
        if kind is None or restriction.kind == "only" or isinstance(restriction.filler, Literal):
            continue
        if semantics is Semantics.ORIGINAL and (
            restriction.form == "equivalent" or isinstance(restriction.filler, BNode)
        ):
            continue
        expression = expression_of(ontology, restriction.filler, restriction.span)
        if expression is None:
            continue
        number = 1 if restriction.cardinality is None else restriction.cardinality
        key = (kind, restriction.kind, restriction.filler, number)
        found.setdefault(key, Requirement(kind, restriction.kind, expression, number, restriction.span))
    return tuple(found.values())


def requirements(ontology: Ontology, actions: Iterable[str]) -> tuple[Mapping[str, tuple[str, ...]], ...]:
    """Capabilities and components that action classes require, closed: each -> the classes that lead to it.

    Keys are IRIs of classes; of other expressions their text.
    """
    found: dict[FindingKind, dict[str, tuple[str, ...]]] = {kind: {} for kind in PROPERTIES}
    queue: list[tuple[str, tuple[str, ...]]] = [(action, (action,)) for action in dict.fromkeys(actions)]
    for cls, path in queue:
        for needed in requirements_of(ontology, cls):
            key = needed.name or needed.text
            if key not in found[needed.kind]:
                found[needed.kind][key] = path
                if needed.kind is FindingKind.CAPABILITY and needed.name is not None:
                    queue.append((needed.name, (*path, needed.name)))
    return found[FindingKind.CAPABILITY], found[FindingKind.COMPONENT]
