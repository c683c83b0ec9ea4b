"""Class expressions and data ranges: read from triples, and written in Manchester syntax."""

from __future__ import annotations

import re
from collections.abc import Container

from planlang.diagnostics import Span
from planlang.ontology.canonical import CannotSay, Graph, Names
from planlang.ontology.expressions import FACETS, Expression
from planlang.ontology.ontology import Ontology
from planlang.ontology.terms import OWL, RDF, RDFS, XSD, BNode, Literal, Term, Triple, shorten

DEEPEST = 90
"""Greatest nesting depth; less than the reader's, so that what is written can be read again."""

FORMS = {
    OWL.intersectionOf: "and",
    OWL.unionOf: "or",
    OWL.oneOf: "one of",
    OWL.complementOf: "not",
    OWL.datatypeComplementOf: "not",
}
_FILLERS = {OWL.someValuesFrom: "some", OWL.allValuesFrom: "only", OWL.hasValue: "value",
            OWL.hasSelf: "Self"}  # fmt: skip
_NUMBERS = {OWL + prefix + "ardinality": word
            for word, prefixes in (("min", ("minC", "minQualifiedC")), ("max", ("maxC", "maxQualifiedC")),
                                   ("exactly", ("c", "qualifiedC")))
            for prefix in prefixes}  # fmt: skip
_FACETS = {XSD + name: word for word, name in FACETS.items()} | {RDF.langRange: "langRange"}

_RESERVED = """not o or and that inverse some only value Self min max exactly true false integer decimal float string
 length minLength maxLength pattern langRange Functional InverseFunctional Reflexive Irreflexive Asymmetric Symmetric
 Transitive"""

RESERVED = frozenset(_RESERVED.split())
"""Names that would be read as keywords of the language, and need a prefix."""

_IRI = re.compile(r'[^<>"{}|^`\\\s]+')
_BARE = {
    XSD.integer: re.compile(r"[+-]?[0-9]+"),
    XSD.decimal: re.compile(r"[+-]?[0-9]+\.[0-9]+"),
    XSD.float: re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]+)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"),
}
_UNSAYABLE = re.compile("[\x00\ud800-\udfff]")


class Words:
    """Writes terms and expressions as text. Raises CannotSay for what the syntax cannot express."""

    def __init__(self, names: Names) -> None:
        self._names = names

    def name(self, iri: str) -> str:
        found = self._names.split(iri)
        if found is None:
            return self.full(iri)
        prefix, local = found
        return local if not prefix and local not in RESERVED and not local[0].isdigit() else f"{prefix}:{local}"

    def full(self, iri: str) -> str:
        if not _IRI.fullmatch(iri):
            raise CannotSay(f"{iri!r:.80} is no IRI")
        return f"<{iri}>"

    def term(self, term: Term) -> str:
        match term:
            case BNode(label):
                return f"_:{label}"
            case Literal():
                return self.literal(term)
            case _:
                return self.name(term)

    def literal(self, literal: Literal) -> str:
        form = _BARE.get(literal.datatype or "")
        if form is not None and form.fullmatch(literal.value):
            return literal.value + ("f" if literal.datatype == XSD.float else "")
        quoted = self.quoted(literal)
        return f"{quoted}^^{self.name(literal.datatype)}" if literal.datatype else quoted

    def quoted(self, literal: Literal) -> str:
        """Write a literal without its datatype."""
        if _UNSAYABLE.search(literal.value):
            raise CannotSay("a string with a character that no file may have")
        quoted = '"' + literal.value.replace("\\", "\\\\").replace('"', '\\"') + '"'
        return f"{quoted}@{literal.language}" if literal.language else quoted

    def text(self, expression: Expression, *, inside: bool = False) -> str:
        """Write an expression; ``inside`` another one with parentheses, unless it is unambiguous without."""
        kind, parts = expression.kind, expression.parts
        match kind:
            case "name":
                assert expression.term is not None
                return self.term(expression.term)
            case "one of":
                return "{" + ", ".join(map(self.text, parts)) + "}"
            case "facets":
                facets = (f"{_FACETS[name]} {self.literal(value)}" for name, value in expression.facets)
                return f"{self.text(parts[0])}[{', '.join(facets)}]"
            case "inverse":
                return f"inverse {self.text(parts[0])}"
            case "and" | "or":
                written = f" {kind} ".join(self.text(part, inside=True) for part in parts)
            case "not":
                negated = self.text(parts[0], inside=True)
                return f"not ({negated})" if parts[0].kind == "not" else f"not {negated}"
            case "Self":
                written = f"{self.text(parts[0])} Self"
            case "some" | "only" | "value":
                written = f"{self.text(parts[0])} {kind} {self.text(parts[1], inside=True)}"
            case _:
                fillers = "".join(f" {self.text(part, inside=True)}" for part in parts[1:])
                written = f"{self.text(parts[0])} {kind} {expression.number}{fillers}"
        return f"({written})" if inside else written


class Expressions:
    """Reads expressions from a graph, and marks their triples as written.

    Raises CannotSay for a blank node that is no expression.
    """

    def __init__(self, graph: Graph, data_properties: Container[Term] = ()) -> None:
        self._graph = graph
        self._data_properties = data_properties

    def of(self, triple: Triple) -> Expression:
        """Read the expression that is a triple's object."""
        self._graph.write(triple)
        return self._read(triple.object, triple, DEEPEST)

    def about(self, subject: str | BNode, at: Triple) -> Expression:
        """Read the expression stated of a subject."""
        return self._node(subject, at, DEEPEST)

    def _read(self, term: Term, at: Triple, depth: int) -> Expression:
        if not isinstance(term, BNode):
            return Expression("name", at.span, term)
        if len(self._graph.uses(term)) != 1:
            raise CannotSay("an expression that is used twice")
        return self._node(term, at, depth)

    def _node(self, node: str | BNode, at: Triple, depth: int) -> Expression:
        if depth == 0:
            raise CannotSay("expressions nested too deep")
        graph = self._graph
        if (prop := graph.one(node, OWL.onProperty)) is not None:
            graph.write(prop, *self._types(node, (OWL.Restriction,)))
            return self._restriction(node, self._read(prop.object, prop, depth - 1), at, depth)
        if (base := graph.one(node, OWL.inverseOf)) is not None and isinstance(base.object, str):
            graph.write(base)
            return Expression("inverse", at.span, parts=(Expression("name", at.span, base.object),))
        if (base := graph.one(node, OWL.onDatatype)) is not None and isinstance(base.object, str):
            graph.write(base, *self._types(node, (RDFS.Datatype,)))
            return self._facets(node, base.object, at)
        forms = [(kind, triple) for form, kind in FORMS.items() for triple in graph.about(node, form)]
        if len(forms) != 1:
            raise CannotSay("a blank node that is no expression")
        kind, triple = forms[0]
        types = self._types(node, (OWL.Class, RDFS.Datatype))
        graph.write(triple, *types)
        data = any(one.object == RDFS.Datatype for one in types)
        if kind == "not":
            return Expression(kind, at.span, parts=(self._read(triple.object, triple, depth - 1),), data=data)
        items = [item.object for item in graph.items(triple)]
        if not items:
            raise CannotSay(f"no members of {kind}")
        if len(items) == 1 and kind != "one of":
            return self._item(items[0], at, depth, kind)  # equivalent, and the syntax has no junction of one
        parts = tuple(self._item(item, at, depth, kind) for item in items)
        return Expression(kind, at.span, parts=parts, data=data)

    def _item(self, item: Term, at: Triple, depth: int, kind: str) -> Expression:
        if kind == "one of":
            return Expression("name", at.span, item)
        if isinstance(item, Literal):
            raise CannotSay("a value among classes")
        return self._read(item, at, depth - 1)

    def _types(self, node: str | BNode, kinds: tuple[str, ...]) -> list[Triple]:
        """Triples that declare a blank node as one of these kinds of expression; at most one."""
        if not isinstance(node, BNode):
            return []
        return [triple for triple in self._graph.about(node, RDF.type) if triple.object in kinds][:1]

    def _restriction(self, node: str | BNode, prop: Expression, at: Triple, depth: int) -> Expression:
        graph = self._graph
        fillers = [t for t in graph.about(node) if t.predicate in _FILLERS]
        numbers = [t for t in graph.about(node) if t.predicate in _NUMBERS]
        if len(fillers) + len(numbers) != 1 or prop.kind not in ("name", "inverse"):
            raise CannotSay("a restriction with no filler, or with several")
        graph.write(*fillers, *numbers)
        data = prop.term in self._data_properties
        if fillers:
            (triple,) = fillers
            kind = _FILLERS[triple.predicate]
            if kind == "Self":
                if triple.object != Literal("true", XSD.boolean):
                    raise CannotSay("hasSelf that is not true")
                return Expression(kind, at.span, parts=(prop,))
            if kind == "value":
                return Expression(
                    kind,
                    at.span,
                    parts=(prop, Expression("name", at.span, triple.object)),
                    data=isinstance(triple.object, Literal),
                )
            if isinstance(triple.object, Literal):
                raise CannotSay("a value where a class belongs")
            filler = self._read(triple.object, triple, depth - 1)
            return Expression(kind, at.span, parts=(prop, filler), data=data or filler.is_range)
        (triple,) = numbers
        text = triple.object.value if isinstance(triple.object, Literal) else ""
        if not re.fullmatch(r"[0-9]{1,9}", text):
            raise CannotSay("a cardinality that is not a number")
        parts = [prop]
        qualifiers = [t for name in ("onClass", "onDataRange") for t in graph.about(node, OWL + name)]
        if ("ualified" in triple.predicate) != (len(qualifiers) == 1):
            raise CannotSay("a cardinality with no class, or with several")
        for qualifier in qualifiers:
            graph.write(qualifier)
            parts.append(self._read(qualifier.object, qualifier, depth - 1))
            data = data or qualifier.predicate == OWL.onDataRange
        kind = _NUMBERS[triple.predicate]
        return Expression(kind, at.span, parts=tuple(parts), number=int(text), data=data)

    def _facets(self, node: str | BNode, base: str, at: Triple) -> Expression:
        graph = self._graph
        listed = graph.one(node, OWL.withRestrictions)
        if listed is None:
            raise CannotSay("a datatype without its restrictions")
        graph.write(listed)
        facets: list[tuple[str, Literal]] = []
        for item in graph.items(listed):
            stated = graph.about(item.object) if isinstance(item.object, BNode) else []
            if len(stated) != 1 or stated[0].predicate not in _FACETS or not isinstance(stated[0].object, Literal):
                raise CannotSay("an unknown facet")
            graph.write(*stated)
            facets.append((stated[0].predicate, stated[0].object))
        if not facets:
            raise CannotSay("a datatype without restrictions")
        named = Expression("name", at.span, base)
        return Expression("facets", at.span, parts=(named,), facets=tuple(facets), data=True)


_ROOT, _IS = "urn:expression", "urn:is"


def expression_of(ontology: Ontology, term: Term, span: Span) -> Expression | None:
    """Read the class expression or data range of a term, at ``span``; None if it is malformed or cyclic."""
    if not isinstance(term, BNode):
        return Expression("name", span, term)
    triples = [Triple(_ROOT, _IS, term, span)]
    seen: set[BNode] = {term}
    queue = [term]
    for node in queue:
        for triple in ontology.triples(s=node):
            triples.append(triple)
            if isinstance(triple.object, BNode) and triple.object not in seen:
                seen.add(triple.object)
                queue.append(triple.object)
    graph = Graph(triples)
    try:
        (root,) = graph.about(_ROOT)
        return Expressions(graph).of(root)
    except CannotSay:
        return None


def text_of(expression: Expression) -> str:
    """Write an expression in Manchester syntax for messages, with names of the vocabulary without prefix."""
    return _Short(Names({})).text(expression)


class _Short(Words):
    def name(self, iri: str) -> str:
        return shorten(iri).rpartition("#")[2] or iri
