"""Turtle, with nameless nodes and lists where they are used, if that is one place; N-Triples, a triple a line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping

from planlang.ontology.terms import RDF, BNode, Literal, Term, Triple
from planlang.ontology.writing.names import Names
from planlang.ontology.writing.nodes import Subjects, labelled

_ILLEGAL_IN_IRI = re.compile(r'[\x00-\x20<>"{}|^`\\]')
_ESCAPED_IN_TEXT = re.compile(r'[\x00-\x1f\x7f"\\]')
_SHORT = {"\t": r"\t", "\b": r"\b", "\n": r"\n", "\r": r"\r", "\f": r"\f", '"': r"\"", "\\": r"\\"}


def ntriples(triples: Iterable[Triple]) -> str:
    """Return the triples in their order; the labels of nameless nodes as they are."""
    return "".join(f"{term(t.subject)} {iri(t.predicate)} {term(t.object)} .\n" for t in triples)


def term(value: Term) -> str:
    """Return a term as N-Triples and Turtle write it in full."""
    match value:
        case BNode(label):
            return f"_:{label}"
        case Literal(words, datatype, language):
            kind = f"@{language}" if language else f"^^{iri(datatype)}" if datatype else ""
            return text(words) + kind
        case _:
            return iri(value)


def iri(value: str) -> str:
    """Return an IRI in angle brackets; characters that it must not have are escaped."""
    return f"<{_ILLEGAL_IN_IRI.sub(_escape, value)}>"


def text(value: str) -> str:
    """Return a text in quotation marks, on one line."""
    return f'"{_ESCAPED_IN_TEXT.sub(lambda found: _SHORT.get(found[0]) or _escape(found), value)}"'


def _escape(found: re.Match[str]) -> str:
    return f"\\u{ord(found[0]):04X}"


DEEPEST = 40
"""Nameless nodes written inside each other; what is deeper has a label."""


def turtle(triples: Iterable[Triple], prefixes: Mapping[str, str], own: str | None = None) -> str:
    """Return the text of a graph; the same graph gives the same text. ``own`` is the name of the ontology."""
    writer = _Writer(labelled(triples), Names(prefixes, own))
    body = "\n".join(writer.paragraphs())
    head = "".join(f"@prefix {name}: {iri(space)} .\n" for name, space in writer.names.used())
    return "\n".join(part for part in (head, body) if part)


class _Writer:
    def __init__(self, triples: list[Triple], names: Names) -> None:
        self.names = names
        self._subjects = Subjects(triples)
        self._about = self._subjects.about
        self._inside = self._nested(self._subjects.once)

    def _nested(self, once: frozenset[BNode]) -> frozenset[BNode]:
        """Nodes that are written where they are used: reached from a subject of their own, not too deep, no circle."""
        nested: set[BNode] = set()
        level = [subject for subject in self._about if subject not in once]
        for _ in range(DEEPEST):
            following: list[str | BNode] = []
            for subject in level:  # grows by the cells of lists, which are no deeper
                for triple in self._about.get(subject, ()):
                    if isinstance(triple.object, BNode) and triple.object in once and triple.object not in nested:
                        nested.add(triple.object)
                        (level if triple.predicate == RDF.rest else following).append(triple.object)
            level = following
        return frozenset(nested)

    def paragraphs(self) -> Iterator[str]:
        for subject, said in self._about.items():
            if not (isinstance(subject, BNode) and subject in self._inside):
                yield f"{self._term(subject)} {self._said(said, 1)} .\n"

    def _said(self, said: list[Triple], depth: int) -> str:
        """``property value, value ; property value``: rdf:type first, then by property."""
        values: dict[str, list[str]] = {}
        for triple in sorted(said, key=lambda one: (one.predicate != RDF.type, one.predicate)):
            values.setdefault(triple.predicate, []).append(self._value(triple.object, depth))
        indent = "\n" + "    " * depth
        parts = (
            f"{'a' if prop == RDF.type else self._iri(prop)} {(',' + indent + '    ').join(sorted(texts))}"
            for prop, texts in values.items()
        )
        return f" ;{indent}".join(parts)

    def _value(self, value: Term, depth: int) -> str:
        if not (isinstance(value, BNode) and value in self._inside):
            return self._term(value)
        listed = self._subjects.list_at(value, self._inside.__contains__)
        if listed is not None:
            return f"( {' '.join(self._value(item, depth + 1) for item in listed[0])} )"
        said = self._about.get(value)
        if not said:
            return "[]"
        indent = "\n" + "    " * depth
        return f"[{indent}    {self._said(said, depth + 1)}{indent}]"

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
