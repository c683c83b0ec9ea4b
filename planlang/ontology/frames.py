"""Frames of Manchester syntax: what each rule of the grammar states, called while the text is parsed."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from lark import Token, Transformer

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.ontology.expressions import BOOLEAN, DATATYPE, FACETS, Expression, Statements
from planlang.ontology.terms import (
    CLASS,
    EQUIVALENT_CLASS,
    IMPORTS,
    INVERSE_OF,
    NAMED_INDIVIDUAL,
    ONTOLOGY,
    OWL,
    RDF,
    SUBCLASS_OF,
    SUBPROPERTY_OF,
    TYPE,
    XSD,
    BNode,
    Literal,
    Term,
)
from planlang.ontology.terms import DOMAIN as RDFS_DOMAIN
from planlang.ontology.terms import RANGE as RDFS_RANGE

DEEPEST = 100
"""Expressions inside each other."""

MOST_WARNINGS = 100
"""Warnings about one file."""

MOST_OPEN = 200_000
"""Words such as "not" and "some" in one item of a frame; the parser keeps them all until the item ends."""

BUILTIN = frozenset(("integer", "decimal", "float", "string"))
"""Datatypes that need no prefix, unless the file has classes of these names."""

_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_DESCRIPTION = re.compile(r"([^\s,]+)(?:\s+(some|only|value)\s+([^\s,]+))?")
_FACT = re.compile(r"([^\s,]+)\s+([^\s,]+)")
_FRAME = re.compile(r"(\w+):\s+(\S+)(?:\s+(?:SubClassOf|Types):(?=\s))?")
_FACTS = re.compile(r"\sFacts:\s")
"""The parts of what the grammar calls simple."""
_HEADS = {"Class": CLASS, "Individual": NAMED_INDIVIDUAL}
_Position = Callable[[int], Span]

Children = list[Any]


@dataclass(frozen=True, slots=True)
class Annotation:
    """A property with its value, and what is said about that in turn."""

    property: str
    value: Term
    span: Span
    inner: tuple[Annotation, ...]
    depth: int


def _bounded(parts: Sequence[Expression | Annotation], span: Span) -> int:
    """Return the nesting depth of an expression with these parts. Raises BadInput beyond :data:`DEEPEST`."""
    depth = 1 + max((part.depth for part in parts), default=0)
    if depth > DEEPEST:
        raise BadInput([error("O008", f"more than {DEEPEST} expressions or annotations inside each other", span)])
    return depth


class Frames(Transformer[Token, None]):
    """Turns what the parser recognises into statements, by the mapping of OWL 2 to RDF graphs.

    ``resolve`` makes an IRI of a written name; ``is_declared`` tells whether the file has a class of that name.
    """

    def __init__(
        self, statements: Statements, resolve: Callable[[str, Span], str], is_declared: Callable[[str], bool], file: str
    ) -> None:
        super().__init__()
        self._out = statements
        self._resolve = resolve
        self._is_declared = is_declared
        self._file = file
        self._subject: str | BNode = statements.named_node("ontology")
        self._subject_span = Span(file)
        self._kind = ONTOLOGY
        self._open = 0
        self.skipped: list[Diagnostic] = []

    # what the lexer tells

    def opens(self, token: Token) -> Token:
        """Count a word or sign that opens a nested part. Raises BadInput when there are too many."""
        self._open += 1
        if self._open > MOST_OPEN:
            message = f"more than {MOST_OPEN:,} expressions or annotations in one item"
            raise BadInput([error("O008", message, self._span(token))])
        return token

    def separates(self, token: Token) -> Token:
        """Count a comma, behind which another item begins."""
        self._open = 0
        return token

    # names and values

    def _span(self, token: Token) -> Span:
        return Span(self._file, token.line or 1, token.column or 1)

    def iri(self, children: Children) -> Expression:
        token = children[0]
        span = self._span(token)
        return Expression("name", span, self._resolve(str(token), span))

    annotation_property = annotation_target = fact_property = key = iri

    def named(self, children: Children) -> Expression:
        """Return a class or a datatype; some datatypes have names of their own."""
        token = children[0]
        if token in BUILTIN and not self._is_declared(str(token)):
            return Expression("name", self._span(token), XSD + token)
        return self.iri(children)

    def node(self, children: Children) -> Expression:
        return Expression("name", self._span(children[0]), self._out.named_node(str(children[0])[2:]))

    def plain_literal(self, children: Children) -> Expression:
        return self._literal(children[0])

    def language_literal(self, children: Children) -> Expression:
        return self._literal(children[0], language=str(children[1])[1:].lower())

    def typed_literal(self, children: Children) -> Expression:
        return self._literal(children[0], datatype=children[1].term)

    def _literal(self, token: Token, datatype: str | None = None, language: str | None = None) -> Expression:
        return Expression("name", self._span(token), Literal(_ESCAPE.sub(r"\1", str(token)[1:-1]), datatype, language))

    def number_literal(self, children: Children) -> Expression:
        text = str(children[0])
        if text[-1] in "fF":
            datatype, text = "float", text[:-1]
        else:
            datatype = "double" if "e" in text.lower() else "decimal" if "." in text else "integer"
        return Expression("name", self._span(children[0]), Literal(text, XSD + datatype))

    def boolean_literal(self, children: Children) -> Expression:
        return Expression("name", self._span(children[0]), Literal(str(children[0]), BOOLEAN))

    # expressions

    def _node(self, kind: str, span: Span, parts: list[Expression], **more: Any) -> Expression:
        return Expression(kind, span, parts=tuple(parts), depth=_bounded(parts, span), **more)

    def _operands(self, kind: str, children: Children) -> Expression:
        parts = [child for child in children if isinstance(child, Expression)]
        return self._node(kind, parts[0].span, parts)

    def union(self, children: Children) -> Expression:
        return self._operands("or", children)

    def intersection(self, children: Children) -> Expression:
        return self._operands("and", children)

    def complement(self, children: Children) -> Expression:
        return self._node("not", self._span(children[0]), children[1:])

    def inverse(self, children: Children) -> Expression:
        return self._node("inverse", self._span(children[0]), children[1:])

    inverse_key = inverse

    def one_of(self, children: Children) -> Expression:
        return self._node("one of", children[0].span, children)

    def facet(self, children: Children) -> tuple[str, Literal]:
        name, value = str(children[0]), children[1].term
        return (RDF + "langRange" if name == "langRange" else XSD + FACETS[name], value)

    def datatype_restriction(self, children: Children) -> Expression:
        return self._node("facets", children[0].span, children[:1], facets=tuple(children[1:]))

    def restriction(self, children: Children) -> Expression:
        expression: Expression = children[0]
        return expression

    def some(self, children: Children) -> Expression:
        return self._operands("some", children)

    def only(self, children: Children) -> Expression:
        return self._operands("only", children)

    def has_value(self, children: Children) -> Expression:
        return self._operands("value", children)

    def has_self(self, children: Children) -> Expression:
        return self._operands("Self", children)

    def cardinality(self, children: Children) -> Expression:
        prop, word, number = children[:3]
        if not str(number).isdecimal() or len(number) > 9:
            raise BadInput([error("O020", f"{word} needs a whole number, not {number}", self._span(number))])
        return self._node(str(word), prop.span, [prop, *children[3:]], number=int(number))

    # annotations

    def annotation(self, children: Children) -> Annotation:
        inner = tuple(children[0]) if isinstance(children[0], list) else ()
        prop, value = children[-2:]
        return Annotation(prop.term, value.term, prop.span, inner, _bounded(inner, prop.span))

    def annotations(self, children: Children) -> list[Annotation]:
        return children

    def entity_annotations(self, children: Children) -> None:
        self._annotate(self._subject, children[0], OWL + "Axiom")

    def _annotate(
        self, subject: str | BNode, annotations: Sequence[Annotation], kind: str = OWL + "Annotation"
    ) -> None:
        """State annotations of a subject; what is said about one in turn stands on a node of the given kind."""
        for note in annotations:
            self._out.state(subject, note.property, note.value, note.span)
            self._reify(subject, note.property, note.value, note.span, note.inner, kind)

    def _reify(
        self,
        subject: str | BNode,
        prop: str,
        value: Term,
        span: Span,
        annotations: Sequence[Annotation],
        kind: str = OWL + "Axiom",
    ) -> None:
        """Annotations of a triple stand on a node that repeats the triple."""
        if annotations:
            node = self._out.fresh()
            self._out.state(node, TYPE, kind, span)
            self._out.state(node, OWL + "annotatedSource", subject, span)
            self._out.state(node, OWL + "annotatedProperty", prop, span)
            self._out.state(node, OWL + "annotatedTarget", value, span)
            self._annotate(node, annotations)

    def _annotated(self, children: Children) -> tuple[list[Annotation], Expression]:
        return (children[0] if isinstance(children[0], list) else [], children[-1])

    annotated_description = annotated_iri = annotated_property = annotated_individual = _annotated

    def _items(self, children: Children) -> Children:
        return children

    descriptions = iris = properties = individuals = characteristic_list = facts = _items

    # the document

    def start(self, children: Children) -> None:
        """Everything has been stated by then."""

    prefix = ontology = frame = start

    def ontology_head(self, children: Children) -> None:
        self._subject_span = children[0].span if children else Span(self._file)
        if children:
            self._subject = children[0].term
        self._out.state(self._subject, TYPE, ONTOLOGY, self._subject_span)
        for version in children[1:]:
            self._out.state(self._subject, OWL + "versionIRI", version.term, version.span)

    def import_(self, children: Children) -> None:
        self._out.state(self._subject, IMPORTS, children[0].term, children[0].span)

    def ontology_annotations(self, children: Children) -> None:
        self._annotate(self._subject, children[0])

    def rule(self, children: Children) -> None:
        advice = "say what it means by classes and property chains, or leave it out"
        if len(self.skipped) < MOST_WARNINGS:
            self.skipped.append(warning("O023", "a rule is skipped", self._span(children[0]), advice))

    # heads

    def _head(self, children: Children, kind: str) -> None:
        name: Expression = children[-1]
        assert isinstance(name.term, (str, BNode))
        self._open = 0
        self._subject, self._subject_span, self._kind = name.term, name.span, kind
        if isinstance(name.term, str):
            self._out.state(name.term, TYPE, kind, name.span)
            if isinstance(children[0], list):
                self._reify(name.term, TYPE, kind, name.span, children[0])

    def class_head(self, children: Children) -> None:
        self._head(children, CLASS)

    def object_property_head(self, children: Children) -> None:
        self._head(children, OWL + "ObjectProperty")

    def data_property_head(self, children: Children) -> None:
        self._head(children, OWL + "DatatypeProperty")

    def annotation_property_head(self, children: Children) -> None:
        self._head(children, OWL + "AnnotationProperty")

    def datatype_head(self, children: Children) -> None:
        self._head(children, DATATYPE)

    def individual_head(self, children: Children) -> None:
        self._head(children, NAMED_INDIVIDUAL)

    # sections

    def _each(
        self, predicate: str, items: list[Token | tuple[list[Annotation], Expression]], *, data: bool = False
    ) -> None:
        for item in items:
            if isinstance(item, Token):
                for expression in self._simple_descriptions(item, self._positions(item), 0, len(item)):
                    self._out.place(self._subject, predicate, expression, data=data)
                continue
            notes, expression = item
            value = self._out.place(self._subject, predicate, expression, data=data)
            self._reify(self._subject, predicate, value, expression.span, notes)

    def simple_frame(self, children: Children) -> None:
        """Read a frame of a class or an individual that has simple descriptions and facts only."""
        token = children[0]
        position = self._positions(token)
        head, facts = _FRAME.match(token), _FACTS.search(token)
        assert head is not None
        word, name = head.groups()
        span = position(head.start(2))
        self._head([Expression("name", span, self._resolve(name, span))], _HEADS[word])
        predicate = SUBCLASS_OF if word == "Class" else TYPE
        end = facts.start() if facts is not None else len(token)
        for expression in self._simple_descriptions(token, position, head.end(), end):
            self._out.place(self._subject, predicate, expression)
        for fact in _FACT.finditer(token, facts.end()) if facts is not None else ():
            span = position(fact.start())
            predicate = self._resolve(fact[1], span)
            value = self._resolve(fact[2], position(fact.start(2)))
            self._out.state(self._subject, predicate, value, span)

    def _simple_descriptions(self, token: str, position: _Position, begin: int, end: int) -> Iterator[Expression]:
        """Yield the names and restrictions in a part of a token."""
        for found in _DESCRIPTION.finditer(token, begin, end):
            first, kind, second = found.groups()
            span = position(found.start())
            name = Expression("name", span, self._resolve(first, span))
            if kind is None:
                yield name
            else:
                filler_span = position(found.start(3))
                filler = Expression("name", filler_span, self._resolve(second, filler_span))
                yield Expression(kind, span, parts=(name, filler), depth=2)

    def _positions(self, token: Token) -> _Position:
        """Return a function from offsets in a token to positions; the offsets given to it must not decrease."""
        line, counted, begin = token.line or 1, 0, 1 - (token.column or 1)

        def position(offset: int) -> Span:
            nonlocal line, counted, begin
            end = token.rfind("\n", counted, offset)
            if end >= 0:
                line += token.count("\n", counted, offset)
                begin, counted = end + 1, offset
            return Span(self._file, line, offset - begin + 1)

        return position

    def sub_class_of(self, children: Children) -> None:
        self._each(SUBCLASS_OF, children[0])

    def equivalent_to(self, children: Children) -> None:
        self._each(EQUIVALENT_CLASS, children[0], data=self._kind == DATATYPE)

    def disjoint_with(self, children: Children) -> None:
        self._each(OWL + "disjointWith", children[0])

    def domain(self, children: Children) -> None:
        self._each(RDFS_DOMAIN, children[0])

    def range(self, children: Children) -> None:
        self._each(RDFS_RANGE, children[0], data=self._kind == OWL + "DatatypeProperty")

    annotation_domain, annotation_range = domain, range

    def sub_property_of(self, children: Children) -> None:
        self._each(SUBPROPERTY_OF, children[0])

    def equivalent_property(self, children: Children) -> None:
        self._each(OWL + "equivalentProperty", children[0])

    def disjoint_property(self, children: Children) -> None:
        self._each(OWL + "propertyDisjointWith", children[0])

    def inverse_of(self, children: Children) -> None:
        self._each(INVERSE_OF, children[0])

    def types_section(self, children: Children) -> None:
        self._each(TYPE, children[0])

    def same_as(self, children: Children) -> None:
        self._each(OWL + "sameAs", children[0])

    def different_from(self, children: Children) -> None:
        self._each(OWL + "differentFrom", children[0])

    def characteristic(self, children: Children) -> tuple[list[Annotation], Token]:
        return (children[0] if isinstance(children[0], list) else [], children[-1])

    def characteristics(self, children: Children) -> None:
        for notes, word in children[0]:
            kind, span = f"{OWL}{word}Property", self._span(word)
            self._out.state(self._subject, TYPE, kind, span)
            self._reify(self._subject, TYPE, kind, span, notes)

    def fact(self, children: Children) -> tuple[list[Annotation], bool, Expression, Expression]:
        annotations = children[0] if isinstance(children[0], list) else []
        negative = any(isinstance(child, Token) for child in children)
        return annotations, negative, children[-2], children[-1]

    def facts_section(self, children: Children) -> None:
        for notes, negative, prop, value in children[0]:
            assert isinstance(prop.term, str)
            if negative:
                self._negative(prop, value, notes)
            else:
                self._out.state(self._subject, prop.term, value.term, prop.span)
                self._reify(self._subject, prop.term, value.term, prop.span, notes)

    def _negative(self, prop: Expression, value: Expression, annotations: list[Annotation]) -> None:
        node = self._out.fresh()
        target = "targetValue" if isinstance(value.term, Literal) else "targetIndividual"
        self._out.state(node, TYPE, OWL + "NegativePropertyAssertion", prop.span)
        self._out.state(node, OWL + "sourceIndividual", self._subject, prop.span)
        self._out.place(node, OWL + "assertionProperty", prop)
        self._out.place(node, OWL + target, value)
        self._annotate(node, annotations)

    def _listed(self, predicate: str, children: Children) -> None:
        parts = [child for child in children if isinstance(child, Expression)]
        cell = self._out.place_list(self._subject, predicate, parts, parts[0].span)
        annotations = children[0] if isinstance(children[0], list) else []
        self._reify(self._subject, predicate, cell, parts[0].span, annotations)

    def disjoint_union_of(self, children: Children) -> None:
        self._listed(OWL + "disjointUnionOf", children)

    def has_key(self, children: Children) -> None:
        self._listed(OWL + "hasKey", children)

    def sub_property_chain(self, children: Children) -> None:
        self._listed(OWL + "propertyChainAxiom", children)

    # axioms about several things

    def _several(self, children: Children, predicate: str, kind: str = "") -> None:
        """Two are related directly; more by a node of a kind with a list, or one after the other without a kind."""
        parts = [child for child in children if isinstance(child, Expression)]
        annotations = children[0] if isinstance(children[0], list) else []
        if kind and len(parts) > 2:
            node = self._out.fresh()
            self._out.state(node, TYPE, OWL + kind, parts[0].span)
            self._out.place_list(node, OWL + "members", parts, parts[0].span)
            self._annotate(node, annotations)
            return
        for first, second in pairwise(parts):
            subject = first.term if isinstance(first.term, (str, BNode)) else self._out.fresh()
            if first.kind != "name":
                assert isinstance(subject, BNode)
                self._out.describe(subject, first)
            value = self._out.place(subject, predicate, second)
            self._reify(subject, predicate, value, first.span, annotations)

    def equivalent_classes(self, children: Children) -> None:
        self._several(children, EQUIVALENT_CLASS)

    def disjoint_classes(self, children: Children) -> None:
        self._several(children, OWL + "disjointWith", "AllDisjointClasses")

    def equivalent_properties(self, children: Children) -> None:
        self._several(children, OWL + "equivalentProperty")

    def disjoint_properties(self, children: Children) -> None:
        self._several(children, OWL + "propertyDisjointWith", "AllDisjointProperties")

    def same_individual(self, children: Children) -> None:
        self._several(children, OWL + "sameAs")

    def different_individuals(self, children: Children) -> None:
        self._several(children, OWL + "differentFrom", "AllDifferent")
