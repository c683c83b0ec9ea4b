"""Class expressions as trees, and the triples that state them."""

from __future__ import annotations

from collections.abc import Sequence

from planlang.diagnostics import Span
from planlang.ontology.terms import OWL, RDF, RDFS, XSD, BNode, Literal, Term
from planlang.ontology.triples import Triples, check_room
from planlang.records import dataclass

FACETS = {
    "<": "maxExclusive",
    "<=": "maxInclusive",
    ">": "minExclusive",
    ">=": "minInclusive",
    "length": "length",
    "minLength": "minLength",
    "maxLength": "maxLength",
    "pattern": "pattern",
}
_CARDINALITIES = {"min": ("minCardinality", "minQualifiedCardinality"),
                  "max": ("maxCardinality", "maxQualifiedCardinality"),
                  "exactly": ("cardinality", "qualifiedCardinality")}  # fmt: skip
QUANTIFIERS = {"some": OWL.someValuesFrom, "only": OWL.allValuesFrom, "value": OWL.hasValue}
_JUNCTIONS = {"and": OWL.intersectionOf, "or": OWL.unionOf}


@dataclass(frozen=True, slots=True)
class Expression:
    """Node of an expression tree.

    ``kind`` is "name", "inverse", "and", "or", "not", "one of", "facets", "some", "only", "value", "Self", "min", "max"
    or "exactly"; ``term`` is the IRI or literal of a "name"; ``parts`` are the operands (of a restriction: properties,
    filler); ``depth`` is the height of the tree, 1 for a name. ``data``: the syntax says that it is a data range, or
    a restriction of data.
    """

    kind: str
    span: Span
    term: Term | None = None
    parts: tuple[Expression, ...] = ()
    number: int = 0
    facets: tuple[tuple[str, Literal], ...] = ()
    depth: int = 1
    data: bool = False

    @property
    def is_range(self) -> bool:
        """True if the syntax says that this is a data range."""
        return self.data and self.kind in ("and", "or", "not", "one of", "facets")


class Statements:
    """Collects triples in the order of the text, and labels blank nodes."""

    def __init__(self, file: str, label: str, data_properties: frozenset[str], datatypes: frozenset[str]) -> None:
        self.triples = Triples(file, label)
        self._label = label
        self._data_properties = data_properties
        self._datatypes = datatypes

    def fresh(self) -> BNode:
        """Make a new blank node."""
        node = self.triples.term(self.triples.fresh())
        assert isinstance(node, BNode)
        return node

    def named_node(self, name: str) -> BNode:
        """Blank node that the file calls ``_:name``."""
        return BNode(f"{self._label}.{name}")

    def state(self, subject: str | BNode, predicate: str, value: Term, span: Span) -> Term:
        """Add one triple and return its object. Raises BadInput if there are too many."""
        self.triples.state(subject, predicate, value, span)
        check_room(self.triples, span.line, span.column)
        return value

    def place(self, subject: str | BNode, predicate: str, expression: Expression, *, data: bool = False) -> Term:
        """State an expression as a value of a property, followed by its own triples, and return its node.

        ``data``: it is known to be a data range.
        """
        if expression.kind == "name":
            assert expression.term is not None
            return self.state(subject, predicate, expression.term, expression.span)
        node = self.fresh()
        self.state(subject, predicate, node, expression.span)
        self.describe(node, expression, data=data)
        return node

    def place_list(
        self, subject: str | BNode, predicate: str, items: Sequence[Expression], span: Span, *, data: bool = False
    ) -> Term:
        """State the RDF list of the items as a value of a property, and return its first cell."""
        if not items:
            return self.state(subject, predicate, RDF.nil, span)
        first = cell = self.fresh()
        self.state(subject, predicate, cell, span)
        for index, item in enumerate(items):
            self.place(cell, RDF.first, item, data=data)
            following: str | BNode = self.fresh() if index + 1 < len(items) else RDF.nil
            self.state(cell, RDF.rest, following, item.span)
            if isinstance(following, BNode):
                cell = following
        return first

    def is_data(self, expression: Expression) -> bool:
        """Check whether an expression is a data range, not a class."""
        match expression.kind:
            case "name":
                name = expression.term
                is_standard = isinstance(name, str) and (name.startswith(XSD) or name == RDFS.Literal)
                return is_standard or isinstance(name, Literal) or name in self._datatypes
            case "facets":
                return True
            case "and" | "or" | "not" | "one of":
                return expression.data or any(self.is_data(part) for part in expression.parts)
        return False

    def describe(self, node: BNode, expression: Expression, *, data: bool = False) -> None:
        """State the triples of an expression about its blank node; ``data``: it is known to be a data range."""
        kind, span = expression.kind, expression.span
        match kind:
            case "inverse":
                self.place(node, OWL.inverseOf, expression.parts[0])
                return
            case "facets":
                self._describe_facets(node, expression)
                return
            case "and" | "or" | "not" | "one of":
                data = data or self.is_data(expression)
                self.state(node, RDF.type, RDFS.Datatype if data else OWL.Class, span)
                if kind == "not":
                    complement = OWL.datatypeComplementOf if data else OWL.complementOf
                    self.place(node, complement, expression.parts[0], data=data)
                else:
                    self.place_list(node, _JUNCTIONS.get(kind, OWL.oneOf), expression.parts, span, data=data)
                return
        self.state(node, RDF.type, OWL.Restriction, span)
        if len(expression.parts) > 2:
            self.place_list(node, OWL.onProperties, expression.parts[:-1], span)
        else:
            self.place(node, OWL.onProperty, expression.parts[0])
        if kind in QUANTIFIERS:
            data = expression.data or expression.parts[0].term in self._data_properties
            self.place(node, QUANTIFIERS[kind], expression.parts[-1], data=data)
        elif kind == "Self":
            self.state(node, OWL.hasSelf, Literal("true", XSD.boolean), span)
        else:
            self._describe_cardinality(node, expression)

    def _describe_cardinality(self, node: BNode, expression: Expression) -> None:
        plain, qualified = _CARDINALITIES[expression.kind]
        number = Literal(str(expression.number), XSD.nonNegativeInteger)
        if len(expression.parts) == 1:
            self.state(node, OWL + plain, number, expression.span)
            return
        self.state(node, OWL + qualified, number, expression.span)
        prop, filler = expression.parts
        data = expression.data or self.is_data(filler) or prop.term in self._data_properties
        self.place(node, OWL + ("onDataRange" if data else "onClass"), filler, data=data)

    def _describe_facets(self, node: BNode, expression: Expression) -> None:
        self.state(node, RDF.type, RDFS.Datatype, expression.span)
        self.place(node, OWL.onDatatype, expression.parts[0])
        cell = self.fresh()
        self.state(node, OWL.withRestrictions, cell, expression.span)
        for index, (facet, value) in enumerate(expression.facets):
            holder = self.fresh()
            self.state(cell, RDF.first, holder, expression.span)
            self.state(holder, facet, value, expression.span)
            following: str | BNode = self.fresh() if index + 1 < len(expression.facets) else RDF.nil
            self.state(cell, RDF.rest, following, expression.span)
            if isinstance(following, BNode):
                cell = following
