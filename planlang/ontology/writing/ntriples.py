"""N-Triples (W3C Recommendation, 25 February 2014): one triple in each line."""

from __future__ import annotations

import re
from collections.abc import Iterable

from planlang.ontology.terms import BNode, Literal, Term, Triple

_ILLEGAL_IN_IRI = re.compile(r'[\x00-\x20<>"{}|^`\\]')
_ESCAPED_IN_TEXT = re.compile(r'[\x00-\x1f\x7f"\\]')
_SHORT = {"\t": r"\t", "\b": r"\b", "\n": r"\n", "\r": r"\r", "\f": r"\f", '"': r"\"", "\\": r"\\"}


def ntriples(triples: Iterable[Triple]) -> str:
    """The triples in their order; the labels of nameless nodes as they are."""
    return "".join(f"{term(t.subject)} {iri(t.predicate)} {term(t.object)} .\n" for t in triples)


def term(value: Term) -> str:
    """A term as N-Triples and Turtle write it in full."""
    match value:
        case BNode(label):
            return f"_:{label}"
        case Literal(words, datatype, language):
            kind = f"@{language}" if language else f"^^{iri(datatype)}" if datatype else ""
            return text(words) + kind
        case _:
            return iri(value)


def iri(value: str) -> str:
    """An IRI in angle brackets; characters that it must not have are escaped."""
    return f"<{_ILLEGAL_IN_IRI.sub(_escape, value)}>"


def text(value: str) -> str:
    """A text in quotation marks, on one line."""
    return f'"{_ESCAPED_IN_TEXT.sub(lambda found: _SHORT.get(found[0]) or _escape(found), value)}"'


def _escape(found: re.Match[str]) -> str:
    return f"\\u{ord(found[0]):04X}"
