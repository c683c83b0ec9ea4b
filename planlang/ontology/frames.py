"""Frames of Manchester syntax: the callbacks of the grammar's rules, which turn parsed frames into triples."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

from lark import Token

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.ontology.axioms import Annotation, Axioms, bounded, unquoted
from planlang.ontology.expressions import FACETS, QUANTIFIERS, Expression
from planlang.ontology.terms import OWL, RDF, RDFS, XSD, BNode, Literal, Term
from planlang.ontology.triples import check_room

MOST_WARNINGS = 100
"""Warnings about one file."""

MOST_OPEN = 200_000
"""Words such as "not" and "some" in one item of a frame; the parser holds all in memory until the item ends."""

BUILTIN = frozenset(("integer", "decimal", "float", "string"))
"""Datatypes without prefix, unless the file has classes of these names."""

_DESCRIPTION = re.compile(r"([^\s,]+)(?:\s+(some|only|value)\s+([^\s,]+))?")
_FACT = re.compile(r"([^\s,]+)\s+([^\s,]+)")
_FRAME = re.compile(r"(\w+):\s+(\S+)(?:\s+(?:SubClassOf|Types):(?=\s))?")
_FACTS = re.compile(r"\sFacts:\s")
"""Patterns of the parts of simple frames (see the grammar's SIMPLE tokens)."""
_SIMPLE = {"Class": (OWL.Class, RDFS.subClassOf), "Individual": (OWL.NamedIndividual, RDF.type)}
"""Keyword of a simple frame -> type of the entity that it declares, predicate of its descriptions."""

_OF_VALUES = frozenset(((OWL.equivalentClass, RDFS.Datatype), (RDFS.range, OWL.DatatypeProperty)))
"""Predicate and type of its subject where descriptions are always data ranges."""

_Position = Callable[[int], tuple[int, int]]

Children = list[Any]


def _operator(kind: str) -> Callable[[Frames, Children], Expression]:
    """Make the callback of an expression of this kind, whose parts are the expressions among the children."""
    return lambda frames, children: frames.operands(kind, children)


def _head(kind: str) -> Callable[[Frames, Children], None]:
    """Make the callback of a frame's head, which declares an entity of this kind."""
    return lambda frames, children: frames.begin(children, kind)


def _section(predicate: str) -> Callable[[Frames, Children], None]:
    """Make the callback of a section, whose items are values of a property."""
    return lambda frames, children: frames.each(predicate, children[0])


def _list_section(predicate: str) -> Callable[[Frames, Children], None]:
    """Make the callback of a section whose items form one RDF list."""
    return lambda frames, children: frames.listed(predicate, children)


def _axiom(predicate: str, kind: str | None = None) -> Callable[[Frames, Children], None]:
    """Make the callback of an axiom about several entities; see :meth:`Frames.several`."""
    return lambda frames, children: frames.several(children, predicate, kind)


def _split(children: Children) -> tuple[list[Annotation], list[Expression]]:
    """Separate the leading annotations, if any, from the expressions."""
    notes = children[0] if children and isinstance(children[0], list) else []
    return notes, [child for child in children if isinstance(child, Expression)]


class Frames:
    """Turns parsed frames into triples, by the W3C Recommendation "OWL 2: Mapping to RDF Graphs".

    Each rule of the grammar has a method, which takes the results of the rule's parts. ``resolve`` maps a written name
    to its IRI; ``is_declared`` checks whether the file has a class of that name.
    """

    def __init__(
        self, statements: Axioms, resolve: Callable[[str, Span], str], is_declared: Callable[[str], bool], file: str
    ) -> None:
        self._out = statements
        self._resolve = resolve
        self._is_declared = is_declared
        self._file = file
        self._subject: str | BNode = statements.named_node("ontology")
        self._kind = OWL.Ontology
        self._open = 0
        self._numbers: dict[str, int] = {}
        """Name as written in a simple frame -> number of its IRI."""
        self.skipped: list[Diagnostic] = []

    # called by the lexer

    def count(self, token: Token) -> Token:
        """Count a word that opens a nested part; a comma ends the item. Raises BadInput if there are too many."""
        self._open = 0 if token == "," else self._open + 1
        if self._open > MOST_OPEN:
            message = f"more than {MOST_OPEN:,} expressions or annotations in one item"
            raise BadInput([error("O008", message, self._span(token))])
        return token

    # names and values

    def _span(self, token: Token) -> Span:
        return Span(self._file, token.line or 1, token.column or 1)

    def _value(self, token: Token, term: Term) -> Expression:
        return Expression("name", self._span(token), term)

    def iri(self, children: Children) -> Expression:
        return self._value(children[0], self._resolve(str(children[0]), self._span(children[0])))

    annotation_property = annotation_target = fact_property = key = iri

    def named(self, children: Children) -> Expression:
        """Read the name of a class or a datatype; :data:`BUILTIN` datatypes need no prefix."""
        token = children[0]
        if token in BUILTIN and not self._is_declared(str(token)):
            return self._value(token, XSD + token)
        return self.iri(children)

    def node(self, children: Children) -> Expression:
        return self._value(children[0], self._out.named_node(str(children[0])[2:]))

    def plain_literal(self, children: Children) -> Expression:
        return self._value(children[0], Literal(unquoted(children[0])))

    def language_literal(self, children: Children) -> Expression:
        return self._value(children[0], Literal(unquoted(children[0]), None, str(children[1])[1:].lower()))

    def typed_literal(self, children: Children) -> Expression:
        return self._value(children[0], Literal(unquoted(children[0]), children[1].term))

    def number_literal(self, children: Children) -> Expression:
        text = str(children[0])
        if text[-1] in "fF":
            datatype, text = XSD.float, text[:-1]
        else:
            datatype = XSD.double if "e" in text.lower() else XSD.decimal if "." in text else XSD.integer
        return self._value(children[0], Literal(text, datatype))

    def boolean_literal(self, children: Children) -> Expression:
        return self._value(children[0], Literal(str(children[0]), XSD.boolean))

    # expressions

    def _node(self, kind: str, span: Span, parts: list[Expression], **more: Any) -> Expression:
        return Expression(kind, span, parts=tuple(parts), depth=bounded(parts, span), **more)

    def operands(self, kind: str, children: Children) -> Expression:
        """Make an expression of a kind from the expressions among the children."""
        _, parts = _split(children)
        return self._node(kind, parts[0].span, parts)

    union, intersection, one_of = _operator("or"), _operator("and"), _operator("one of")
    some, only, has_value, has_self = _operator("some"), _operator("only"), _operator("value"), _operator("Self")

    def complement(self, children: Children) -> Expression:
        return self._node("not", self._span(children[0]), children[1:])

    def inverse(self, children: Children) -> Expression:
        return self._node("inverse", self._span(children[0]), children[1:])

    inverse_key = inverse

    def facet(self, children: Children) -> tuple[str, Literal]:
        name, value = str(children[0]), children[1].term
        return (RDF.langRange if name == "langRange" else XSD + FACETS[name], value)

    def datatype_restriction(self, children: Children) -> Expression:
        return self._node("facets", children[0].span, children[:1], facets=tuple(children[1:]))

    def restriction(self, children: Children) -> Expression:
        expression: Expression = children[0]
        return expression

    def cardinality(self, children: Children) -> Expression:
        prop, word, number = children[:3]
        if not str(number).isdecimal() or len(number) > 9:
            advice = f"write `{word} 1` or another whole number of up to 9 digits"
            raise BadInput([error("O020", f"{word} needs a whole number, not {number}", self._span(number), advice)])
        return self._node(str(word), prop.span, [prop, *children[3:]], number=int(number))

    # annotations

    def annotation(self, children: Children) -> Annotation:
        inner = tuple(children[0]) if isinstance(children[0], list) else ()
        prop, value = children[-2:]
        return Annotation(prop.term, value.term, prop.span, inner, bounded(inner, prop.span))

    def entity_annotations(self, children: Children) -> None:
        self._out.annotate(self._subject, children[0], OWL.Axiom)

    def annotated_iri(self, children: Children) -> tuple[list[Annotation], Any]:
        return (children[0] if isinstance(children[0], list) else [], children[-1])

    annotated_description = annotated_property = annotated_individual = characteristic = annotated_iri

    def annotations(self, children: Children) -> Children:
        return children

    descriptions = iris = properties = individuals = characteristic_list = facts = annotations

    # the document

    def start(self, children: Children) -> None:
        """Do nothing: the parts of the rule have stated everything."""

    prefix = ontology = frame = start

    def ontology_head(self, children: Children) -> None:
        span = children[0].span if children else Span(self._file)
        if children:
            self._subject = children[0].term
        self._out.state(self._subject, RDF.type, OWL.Ontology, span)
        for version in children[1:]:
            self._out.state(self._subject, OWL.versionIRI, version.term, version.span)

    def import_(self, children: Children) -> None:
        self._out.state(self._subject, OWL.imports, children[0].term, children[0].span)

    def ontology_annotations(self, children: Children) -> None:
        self._out.annotate(self._subject, children[0])

    def rule(self, children: Children) -> None:
        advice = "express it by classes and property chains, or remove it"
        if len(self.skipped) < MOST_WARNINGS:
            message = "rules (SWRL) are not supported; this one is ignored"
            self.skipped.append(warning("O023", message, self._span(children[0]), advice))

    # frames

    def begin(self, children: Children, kind: str) -> None:
        """Begin the frame of an entity, which is declared if it has a name."""
        name: Expression = children[-1]
        self._open = 0
        self._subject, self._kind = self._out.subject_of(name), kind
        if isinstance(name.term, str):
            self._out.state(name.term, RDF.type, kind, name.span)
            self._out.reify(name.term, RDF.type, kind, name.span, _split(children)[0])

    class_head, datatype_head, individual_head = _head(OWL.Class), _head(RDFS.Datatype), _head(OWL.NamedIndividual)
    object_property_head, data_property_head = _head(OWL.ObjectProperty), _head(OWL.DatatypeProperty)
    annotation_property_head = _head(OWL.AnnotationProperty)

    # simple frames, which are most of a large file, are read by term numbers: objects would take three times as long

    def simple_frame(self, children: Children) -> None:
        """Read a frame of a class or an individual that has only simple descriptions and facts."""
        token = children[0]
        position, add = self._positions(token), self._out.triples.add
        head, facts = _FRAME.match(token), _FACTS.search(token)
        assert head is not None
        word, name = head.groups()
        kind, predicate = _SIMPLE[word]
        self._open = 0
        line, column = position(head.start(2))
        subject = self._number(name, line, column)
        add(subject, self._out.triples.number(RDF.type), self._out.triples.number(kind), line, column)
        check_room(self._out.triples, line, column)
        end = facts.start() if facts is not None else len(token)
        self._simple_descriptions(subject, predicate, token, position, head.end(), end)
        for fact in _FACT.finditer(token, facts.end()) if facts is not None else ():
            line, column = position(fact.start())
            prop = self._number(fact[1], line, column)
            add(subject, prop, self._number(fact[2], *position(fact.start(2))), line, column)
            check_room(self._out.triples, line, column)

    def _simple_descriptions(
        self, subject: int, predicate: str, token: str, position: _Position, begin: int, end: int
    ) -> None:
        """State the names and restrictions in the range ``begin`` to ``end`` of a token as values of a property."""
        triples, add = self._out.triples, self._out.triples.add
        terms = (predicate, RDF.type, OWL.Restriction, OWL.onProperty)
        prop, rdf_type, restriction, on_property = map(triples.number, terms)
        for description in _DESCRIPTION.finditer(token, begin, end):
            line, column = position(description.start())
            first, kind, second = description.groups()
            number = self._number(first, line, column)
            if kind is None:
                add(subject, prop, number, line, column)
            else:
                filler_line, filler_column = position(description.start(3))
                filler, node = self._number(second, filler_line, filler_column), triples.fresh()
                add(subject, prop, node, line, column)
                add(node, rdf_type, restriction, line, column)
                add(node, on_property, number, line, column)
                add(node, triples.number(QUANTIFIERS[kind]), filler, filler_line, filler_column)
            check_room(triples, line, column)

    def _number(self, name: str, line: int, column: int) -> int:
        number = self._numbers.get(name)
        if number is None:
            iri = self._resolve(name, Span(self._file, line, column))
            number = self._numbers[name] = self._out.triples.number(iri)
        return number

    def _positions(self, token: Token) -> _Position:
        """Make a function from offsets in a token to (line, column); offsets of its calls must not decrease."""
        line, counted, begin = token.line or 1, 0, 1 - (token.column or 1)

        def position(offset: int) -> tuple[int, int]:
            nonlocal line, counted, begin
            end = token.rfind("\n", counted, offset)
            if end >= 0:
                line += token.count("\n", counted, offset)
                begin = end + 1
            counted = offset
            return line, offset - begin + 1

        return position

    # sections

    def each(self, predicate: str, items: list[Token | tuple[list[Annotation], Expression]]) -> None:
        """State each item of a section as a value of ``predicate``."""
        data = (predicate, self._kind) in _OF_VALUES
        for item in items:
            if isinstance(item, Token):
                subject = self._out.triples.number(self._subject)
                self._simple_descriptions(subject, predicate, item, self._positions(item), 0, len(item))
                continue
            notes, expression = item
            value = self._out.place(self._subject, predicate, expression, data=data)
            self._out.reify(self._subject, predicate, value, expression.span, notes)

    sub_class_of, types_section = _section(RDFS.subClassOf), _section(RDF.type)
    equivalent_to, disjoint_with = _section(OWL.equivalentClass), _section(OWL.disjointWith)
    domain = annotation_domain = _section(RDFS.domain)
    range = annotation_range = _section(RDFS.range)
    sub_property_of, inverse_of = _section(RDFS.subPropertyOf), _section(OWL.inverseOf)
    equivalent_property, disjoint_property = _section(OWL.equivalentProperty), _section(OWL.propertyDisjointWith)
    same_as, different_from = _section(OWL.sameAs), _section(OWL.differentFrom)

    def characteristics(self, children: Children) -> None:
        for notes, word in children[0]:
            kind, span = f"{OWL}{word}Property", self._span(word)
            self._out.state(self._subject, RDF.type, kind, span)
            self._out.reify(self._subject, RDF.type, kind, span, notes)

    def fact(self, children: Children) -> tuple[list[Annotation], bool, Expression, Expression]:
        notes, (prop, value) = _split(children)
        return notes, any(isinstance(child, Token) for child in children), prop, value

    def facts_section(self, children: Children) -> None:
        for notes, negative, prop, value in children[0]:
            assert isinstance(prop.term, str)
            if negative:
                self._out.deny(self._subject, prop, value, notes)
            else:
                self._out.state(self._subject, prop.term, value.term, prop.span)
                self._out.reify(self._subject, prop.term, value.term, prop.span, notes)

    def listed(self, predicate: str, children: Children) -> None:
        """State the items of a section as one RDF list."""
        annotations, parts = _split(children)
        cell = self._out.place_list(self._subject, predicate, parts, parts[0].span)
        self._out.reify(self._subject, predicate, cell, parts[0].span, annotations)

    disjoint_union_of, has_key = _list_section(OWL.disjointUnionOf), _list_section(OWL.hasKey)
    sub_property_chain = _list_section(OWL.propertyChainAxiom)

    # axioms about several things

    def several(self, children: Children, predicate: str, kind: str | None) -> None:
        """Relate entities; see :meth:`planlang.ontology.axioms.Axioms.relate_all`."""
        annotations, parts = _split(children)
        self._out.relate_all(parts, predicate, kind, annotations)

    equivalent_classes, equivalent_properties = _axiom(OWL.equivalentClass), _axiom(OWL.equivalentProperty)
    disjoint_classes = _axiom(OWL.disjointWith, OWL.AllDisjointClasses)
    disjoint_properties = _axiom(OWL.propertyDisjointWith, OWL.AllDisjointProperties)
    same_individual = _axiom(OWL.sameAs)
    different_individuals = _axiom(OWL.differentFrom, OWL.AllDifferent)
