"""Axioms and annotations as triples, by the W3C Recommendation "OWL 2: Mapping to RDF Graphs"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

from planlang.diagnostics import BadInput, Span, error
from planlang.ontology.expressions import Expression, Statements
from planlang.ontology.terms import OWL, RDF, BNode, Literal, Term
from planlang.records import dataclass

DEEPEST = 100
"""Greatest nesting depth of expressions and annotations."""

_ESCAPE = re.compile(r"\\(.)", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Annotation:
    """Annotation: a property with its value, and annotations of the annotation itself."""

    property: str
    value: Term
    span: Span
    inner: tuple[Annotation, ...]
    depth: int


def bounded(parts: Sequence[Expression | Annotation], span: Span) -> int:
    """Compute the nesting depth of an expression with these parts. Raises BadInput beyond :data:`DEEPEST`."""
    depth = 1 + max((part.depth for part in parts), default=0)
    if depth > DEEPEST:
        raise BadInput([error("O008", f"expressions or annotations are nested more than {DEEPEST} deep", span)])
    return depth


def unquoted(text: str) -> str:
    """Remove the quotation marks of a string, and undo its escapes."""
    return _ESCAPE.sub(r"\1", text[1:-1])


class Axioms(Statements):
    """Collects the triples of axioms, with those of their annotations."""

    def annotate(self, subject: str | BNode, annotations: Sequence[Annotation], kind: str = OWL.Annotation) -> None:
        """State annotations of a subject; nested annotations are stated of a node of the given kind."""
        for note in annotations:
            self.state(subject, note.property, note.value, note.span)
            self.reify(subject, note.property, note.value, note.span, note.inner, kind)

    def reify(
        self,
        subject: str | BNode,
        prop: str,
        value: Term,
        span: Span,
        annotations: Sequence[Annotation],
        kind: str = OWL.Axiom,
    ) -> None:
        """State annotations of a triple, on a blank node that repeats the triple (reification)."""
        if annotations:
            node = self.fresh()
            self.state(node, RDF.type, kind, span)
            self.state(node, OWL.annotatedSource, subject, span)
            self.state(node, OWL.annotatedProperty, prop, span)
            self.state(node, OWL.annotatedTarget, value, span)
            self.annotate(node, annotations)

    def subject_of(self, expression: Expression) -> str | BNode:
        """State an expression that is the subject of an axiom, and return its node."""
        if isinstance(expression.term, (str, BNode)):
            return expression.term
        node = self.fresh()
        self.describe(node, expression)
        return node

    def relate(
        self,
        first: Expression,
        predicate: str,
        second: Expression,
        annotations: Sequence[Annotation] = (),
        *,
        data: bool = False,
    ) -> None:
        """State that two entities or expressions are related; ``data``: the second is known to be a data range."""
        subject = self.subject_of(first)
        value = self.place(subject, predicate, second, data=data)
        self.reify(subject, predicate, value, first.span, annotations)

    def relate_to_list(
        self, first: Expression, predicate: str, items: Sequence[Expression], annotations: Sequence[Annotation]
    ) -> None:
        """State that an entity or expression is related to an RDF list of others."""
        subject = self.subject_of(first)
        cell = self.place_list(subject, predicate, items, first.span)
        self.reify(subject, predicate, cell, first.span, annotations)

    def relate_all(
        self, parts: Sequence[Expression], predicate: str, kind: str | None, annotations: Sequence[Annotation]
    ) -> None:
        """Relate two entities directly; more of them by a node of type ``kind`` with a list, without one pairwise."""
        if kind is not None and len(parts) > 2:
            node = self.fresh()
            self.state(node, RDF.type, kind, parts[0].span)
            self.place_list(node, OWL.members, parts, parts[0].span)
            self.annotate(node, annotations)
            return
        for first, second in pairwise(parts):
            self.relate(first, predicate, second, annotations)

    def deny(
        self, subject: str | BNode, prop: Expression, value: Expression, annotations: Sequence[Annotation]
    ) -> None:
        """State a negative fact about a subject."""
        node = self.fresh()
        self.state(node, RDF.type, OWL.NegativePropertyAssertion, prop.span)
        self.state(node, OWL.sourceIndividual, subject, prop.span)
        self.place(node, OWL.assertionProperty, prop)
        self.place(node, OWL.targetValue if isinstance(value.term, Literal) else OWL.targetIndividual, value)
        self.annotate(node, annotations)
