"""RDF/XML: one element for each subject, nameless nodes and lists where they are used, if that is one place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from xml.sax.saxutils import escape, quoteattr

from planlang.ontology.terms import RDF, BNode, Literal, Term, Triple
from planlang.ontology.writing.names import Names
from planlang.ontology.writing.nodes import Subjects, labelled

DEEPEST = 30
"""Nameless nodes written inside each other; what is deeper has a label."""

_LETTER = "A-Za-z_\u00c0-\u00d6\u00d8-\u00f6\u00f8-\u02ff"
_END = re.compile(rf"[{_LETTER}][{_LETTER}0-9.\u00b7-]*$")
_ILLEGAL = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_SYNTAX = frozenset(RDF + name for name in ("RDF", "ID", "about", "parseType", "resource", "nodeID", "datatype", "li",
                                           "Description", "bagID", "aboutEach", "aboutEachPrefix"))  # fmt: skip


def rdfxml(triples: Iterable[Triple], prefixes: Mapping[str, str], own: str | None = None) -> tuple[str, list[Triple]]:
    """Return the text of a graph, and the triples that RDF/XML cannot express.

    These have a property whose IRI does not end in a name, or a text with characters that XML does not have. The same
    graph gives the same text. ``own`` is the name of the ontology.
    """
    given = labelled(triples)
    lost = [triple for triple in given if not _can_be_written(triple)]
    writer = _Writer([triple for triple in given if _can_be_written(triple)], Names(prefixes, own))
    body = "".join(writer.elements())
    spaces = {"rdf": RDF} | writer.spaces
    head = "".join(f"\n    xmlns:{name}={quoteattr(space)}" for name, space in sorted(spaces.items()))
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<rdf:RDF{head}>\n{body}</rdf:RDF>\n', lost


def _can_be_written(triple: Triple) -> bool:
    terms = (triple.subject, triple.predicate, triple.object)
    texts = [text for term in terms for text in _texts(term)]
    return not any(_ILLEGAL.search(text) for text in texts) and _is_element(triple.predicate)


def _is_element(term: Term) -> bool:
    """Return True for an IRI that can name an element: it ends in a name, and has no other meaning there."""
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


class _Writer:
    def __init__(self, triples: list[Triple], names: Names) -> None:
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
        for subject in self._about:  # circles, and what was too deep
            if isinstance(subject, BNode) and subject in self._once and subject not in self._written:
                yield from self._node(subject, 1)

    def _node(self, subject: str | BNode, depth: int, *, is_nested: bool = False) -> Iterator[str]:
        if isinstance(subject, BNode):
            self._written.add(subject)
        said = self._about.get(subject, [])
        kind = next((t for t in said if t.predicate == RDF.type and _is_element(t.object)), None)
        tag = self._tag(str(kind.object)) if kind is not None else "rdf:Description"
        pad = "    " * depth
        name = (
            "" if is_nested else f" rdf:about={quoteattr(subject)}" if isinstance(subject, str) else _node_id(subject)
        )
        rest = [triple for triple in said if triple is not kind]
        if not rest:
            yield f"{pad}<{tag}{name}/>\n"
            return
        yield f"{pad}<{tag}{name}>\n"
        for triple in sorted(rest, key=lambda one: (one.predicate != RDF.type, one.predicate)):
            yield from self._property(triple, depth + 1)
        yield f"{pad}</{tag}>\n"

    def _property(self, triple: Triple, depth: int) -> Iterator[str]:
        tag, pad, value = self._tag(triple.predicate), "    " * depth, triple.object
        match value:
            case Literal(words, datatype, language):
                kind = f" xml:lang={quoteattr(language)}" if language else ""
                kind = f" rdf:datatype={quoteattr(datatype)}" if datatype else kind
                yield f"{pad}<{tag}{kind}>{escape(words, {chr(13): '&#13;'})}</{tag}>\n"
            case BNode() if value in self._once and value not in self._written and depth < 2 * DEEPEST:
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
        elif item in self._once and item not in self._written and depth < 2 * DEEPEST:
            yield from self._node(item, depth, is_nested=True)
        else:
            yield f"{pad}<rdf:Description{_node_id(item)}/>\n"

    def _items(self, cell: BNode) -> list[str | BNode] | None:
        """Return the items of a list that can be written as one; None if it cannot, or has values."""
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
