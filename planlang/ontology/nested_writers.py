"""Writes graphs as N-Triples, Turtle and RDF/XML; blank nodes and lists are nested where they have a single use."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from xml.sax.saxutils import escape, quoteattr

from planlang.closure import grouped
from planlang.ontology.canonical import Names, Sorting, Subjects, labelled
from planlang.ontology.terms import RDF, BNode, Literal, Term, Triple

_ILLEGAL_IN_IRI = re.compile(r'[\x00-\x20<>"{}|^`\\]')
_ESCAPED_IN_TEXT = re.compile(r'[\x00-\x1f\x7f"\\]')
_SHORT = {"\t": r"\t", "\b": r"\b", "\n": r"\n", "\r": r"\r", "\f": r"\f", '"': r"\"", "\\": r"\\"}


def ntriples(triples: Iterable[Triple]) -> str:
    """Write triples in their order, with the labels of blank nodes unchanged."""
    return "".join(f"{term(t.subject)} {iri(t.predicate)} {term(t.object)} .\n" for t in triples)


def term(value: Term) -> str:
    """Write a term in full, as in N-Triples and Turtle."""
    match value:
        case BNode(label):
            return f"_:{label}"
        case Literal(words, datatype, language):
            kind = f"@{language}" if language else f"^^{iri(datatype)}" if datatype else ""
            return text(words) + kind
        case _:
            return iri(value)


def iri(value: str) -> str:
    """Write an IRI in angle brackets, with illegal characters escaped."""
    return f"<{_ILLEGAL_IN_IRI.sub(_escape, value)}>"


def text(value: str) -> str:
    """Write a string in quotation marks, on one line."""
    return f'"{_ESCAPED_IN_TEXT.sub(lambda found: _SHORT.get(found[0]) or _escape(found), value)}"'


def _escape(found: re.Match[str]) -> str:
    return f"\\u{ord(found[0]):04X}"


DEEPEST_IN_TURTLE = 40
"""Greatest nesting depth of written blank nodes; deeper ones get labels."""


def turtle(
    triples: Iterable[Triple], prefixes: Mapping[str, str], own: str | None = None, *, order: Sorting = Sorting.TERMS
) -> str:
    """Write a graph as Turtle; the same graph gives the same text. ``own`` is the ontology IRI.

    In the order of the file, unused prefixes are kept, too.
    """
    writer = _TurtleWriter(labelled(triples, order=order), Names(prefixes, own), order=order)
    body = "\n".join(writer.paragraphs())
    spaces = writer.names.used(prefixes if order is Sorting.FILE else None)
    head = "".join(f"@prefix {name}: {iri(space)} .\n" for name, space in spaces)
    return "\n".join(part for part in (head, body) if part)


class _TurtleWriter:
    def __init__(self, triples: list[Triple], names: Names, *, order: Sorting) -> None:
        self.names = names
        self._order = order
        self._subjects = Subjects(triples)
        self._about = self._subjects.about
        self._inside = self._nested(self._subjects.once)

    def _nested(self, once: frozenset[BNode]) -> frozenset[BNode]:
        """Find the blank nodes to nest: not too deep, and not on a cycle, which no other subject leads to."""
        nested: set[BNode] = set()
        level = [subject for subject in self._about if subject not in once]
        for _ in range(DEEPEST_IN_TURTLE):
            following: list[str | BNode] = []
            for subject in level:  # grows by the cells of lists, which do not count as deeper
                for triple in self._about.get(subject, ()):
                    if isinstance(triple.object, BNode) and triple.object in once and triple.object not in nested:
                        nested.add(triple.object)
                        (level if triple.predicate == RDF.rest else following).append(triple.object)
            level = following
        return frozenset(nested)

    def paragraphs(self) -> Iterator[str]:
        for subject, triples in self._about.items():
            if not (isinstance(subject, BNode) and subject in self._inside):
                yield f"{self._term(subject)} {self._properties(triples, 1)} .\n"

    def _properties(self, triples: list[Triple], depth: int) -> str:
        """Write ``property value, value ; property value``: rdf:type first, then by property or as in the file."""
        in_order = _sorted(triples, order=self._order)
        values = grouped((triple.predicate, self._value(triple.object, depth)) for triple in in_order)
        if self._order is Sorting.TERMS:
            values = {prop: sorted(texts) for prop, texts in values.items()}
        indent = "\n" + "    " * depth
        parts = (
            f"{'a' if prop == RDF.type else self._iri(prop)} {(',' + indent + '    ').join(texts)}"
            for prop, texts in values.items()
        )
        return f" ;{indent}".join(parts)

    def _value(self, value: Term, depth: int) -> str:
        if not (isinstance(value, BNode) and value in self._inside):
            return self._term(value)
        listed = self._subjects.list_at(value, self._inside.__contains__)
        if listed is not None:
            return f"( {' '.join(self._value(item, depth + 1) for item in listed[0])} )"
        triples = self._about.get(value)
        if not triples:
            return "[]"
        indent = "\n" + "    " * depth
        return f"[{indent}    {self._properties(triples, depth + 1)}{indent}]"

    def _term(self, value: Term) -> str:
        match value:
            case BNode():
                return term(value)
            case Literal(words, datatype, _) if datatype:
                return f"{term(Literal(words))}^^{self._iri(datatype)}"
            case Literal():
                return term(value)
            case _:
                return self._iri(value)

    def _iri(self, value: str) -> str:
        found = self.names.split(value)
        return f"{found[0]}:{found[1]}" if found else iri(value)


def _sorted(triples: list[Triple], *, order: Sorting) -> list[Triple]:
    """Sort the triples of a subject: types first, the others by property, or in the order of the file."""
    return sorted(triples, key=lambda one: (one.predicate != RDF.type, "" if order is Sorting.FILE else one.predicate))


DEEPEST_IN_XML = 30
"""Greatest nesting depth of written blank nodes; deeper ones get labels."""

_LETTER = "A-Za-z_\u00c0-\u00d6\u00d8-\u00f6\u00f8-\u02ff"
_END = re.compile(rf"[{_LETTER}][{_LETTER}0-9.\u00b7-]*$")
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_SYNTAX = frozenset(RDF + name for name in ("RDF", "ID", "about", "parseType", "resource", "nodeID", "datatype", "li",
                                           "Description", "bagID", "aboutEach", "aboutEachPrefix"))  # fmt: skip


def rdfxml(
    triples: Iterable[Triple], prefixes: Mapping[str, str], own: str | None = None, *, order: Sorting = Sorting.TERMS
) -> tuple[str, list[Triple]]:
    """Write a graph as RDF/XML; also return the triples that it cannot express.

    These have a property whose IRI does not end in an XML name, or a string with characters that XML does not allow.
    The same graph gives the same text. ``own`` is the ontology IRI.
    """
    given = labelled(triples, order=order)
    lost = [triple for triple in given if not _can_be_written(triple)]
    names = Names(prefixes, own)
    writer = _RdfXmlWriter([triple for triple in given if _can_be_written(triple)], names, order=order)
    body = "".join(writer.elements())
    spaces = {"rdf": RDF} | writer.spaces
    for name, space in names.used(prefixes) if order is Sorting.FILE else ():
        if not name.lower().startswith("xml"):
            spaces.setdefault(name, space)
    named = ((f"xmlns:{name}" if name else "xmlns", space) for name, space in sorted(spaces.items()))
    head = "".join(f"\n    {name}={quoteattr(space)}" for name, space in named)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<rdf:RDF{head}>\n{body}</rdf:RDF>\n', lost


def _can_be_written(triple: Triple) -> bool:
    return is_legal(triple) and _is_element(triple.predicate)


def is_legal(triple: Triple) -> bool:
    """Check whether XML can contain the characters of a triple."""
    terms = (triple.subject, triple.predicate, triple.object)
    return not any(_ILLEGAL.search(text) for term in terms for text in _texts(term))


def _is_element(term: Term) -> bool:
    """Check whether an IRI can name an element: it ends in an XML name, and is no part of RDF/XML's syntax."""
    if not isinstance(term, str) or term in _SYNTAX:
        return False
    found = _END.search(term)
    return found is not None and found.start() > 0


def _texts(term: Term) -> tuple[str, ...]:
    match term:
        case BNode(label):
            return (label,)
        case Literal(value, datatype, _):
            return (value, datatype or "")
        case _:
            return (term,)


class _RdfXmlWriter:
    def __init__(self, triples: list[Triple], names: Names, *, order: Sorting) -> None:
        self._order = order
        self.spaces: dict[str, str] = {}
        self._names = {space: name for name, space in names.known() if name and not name.lower().startswith("xml")}
        self._names[RDF] = "rdf"
        self._subjects = Subjects(triples)
        self._about, self._once = self._subjects.about, self._subjects.once
        self._written: set[BNode] = set()

    def elements(self) -> Iterator[str]:
        roots = [subject for subject in self._about if subject not in self._once]
        for subject in roots:
            yield from self._node(subject, 1)
        for subject in self._about:  # nodes on cycles, and those that were too deep
            if isinstance(subject, BNode) and subject in self._once and subject not in self._written:
                yield from self._node(subject, 1)

    def _node(self, subject: str | BNode, depth: int, *, is_nested: bool = False) -> Iterator[str]:
        if isinstance(subject, BNode):
            self._written.add(subject)
        triples = self._about.get(subject, [])
        kind = next((t for t in triples if t.predicate == RDF.type and _is_element(t.object)), None)
        tag = self._tag(str(kind.object)) if kind is not None else "rdf:Description"
        pad = "    " * depth
        name = (
            "" if is_nested else f" rdf:about={quoteattr(subject)}" if isinstance(subject, str) else _node_id(subject)
        )
        rest = [triple for triple in triples if triple is not kind]
        if not rest:
            yield f"{pad}<{tag}{name}/>\n"
            return
        yield f"{pad}<{tag}{name}>\n"
        for triple in _sorted(rest, order=self._order):
            yield from self._property(triple, depth + 1)
        yield f"{pad}</{tag}>\n"

    def _property(self, triple: Triple, depth: int) -> Iterator[str]:
        tag, pad, value = self._tag(triple.predicate), "    " * depth, triple.object
        match value:
            case Literal(words, datatype, language):
                kind = f" xml:lang={quoteattr(language)}" if language else ""
                kind = f" rdf:datatype={quoteattr(datatype)}" if datatype else kind
                yield f"{pad}<{tag}{kind}>{escape(words, {chr(13): '&#13;'})}</{tag}>\n"
            case BNode() if value in self._once and value not in self._written and depth < 2 * DEEPEST_IN_XML:
                items = self._items(value)
                if items is None:
                    yield f"{pad}<{tag}>\n"
                    yield from self._node(value, depth + 1, is_nested=True)
                    yield f"{pad}</{tag}>\n"
                    return
                yield f'{pad}<{tag} rdf:parseType="Collection">\n'
                for item in items:
                    yield from self._item(item, depth + 1)
                yield f"{pad}</{tag}>\n"
            case BNode():
                yield f"{pad}<{tag}{_node_id(value)}/>\n"
            case _:
                yield f"{pad}<{tag} rdf:resource={quoteattr(value)}/>\n"

    def _item(self, item: str | BNode, depth: int) -> Iterator[str]:
        pad = "    " * depth
        if isinstance(item, str):
            yield f"{pad}<rdf:Description rdf:about={quoteattr(item)}/>\n"
        elif item in self._once and item not in self._written and depth < 2 * DEEPEST_IN_XML:
            yield from self._node(item, depth, is_nested=True)
        else:
            yield f"{pad}<rdf:Description{_node_id(item)}/>\n"

    def _items(self, cell: BNode) -> list[str | BNode] | None:
        """Items of a list that can be written as a collection; None if it cannot, or has literals."""
        found = self._subjects.list_at(cell, lambda one: one in self._once and one not in self._written)
        items = [item for item in found[0] if not isinstance(item, Literal)] if found is not None else []
        if found is None or len(items) < len(found[0]):
            return None
        self._written.update(found[1])
        return items

    def _tag(self, iri: str) -> str:
        found = _END.search(iri)
        assert found is not None
        space, local = iri[: found.start()], found[0]
        if space not in self._names:
            number = 1
            while f"ns{number}" in self._names.values():
                number += 1
            self._names[space] = f"ns{number}"
        self.spaces[self._names[space]] = space
        return f"{self._names[space]}:{local}"


def _node_id(node: BNode) -> str:
    return f" rdf:nodeID={quoteattr(node.label)}"
