"""Which syntax a file is written in, told by how it begins."""

from __future__ import annotations

import re
from enum import Enum

from planlang.diagnostics import BadInput, Span, error
from planlang.ontology.parsed import Parsed
from planlang.ontology.xml_text import decode


class Syntax(Enum):
    """The syntaxes of OWL that are read. N-Triples is read as Turtle, of which it is a part."""

    RDFXML = "RDF/XML"
    MANCHESTER = "Manchester syntax"
    TURTLE = "Turtle"


_MANCHESTER = re.compile(
    r"(?:Prefix|Namespace|Ontology|Import|Annotations|Class|ObjectProperty|DataProperty|AnnotationProperty|Datatype"
    r"|Individual|EquivalentClasses|DisjointClasses|EquivalentProperties|DisjointProperties|SameIndividual"
    r"|DifferentIndividuals):(?=\s|$|<)"
)
_NOTHING_SAID = re.compile(r"(?:[^\S\r\n]*(?:#[^\r\n]*)?(?:\r\n?|\n))*(?:[^\S\r\n]*#[^\r\n]*\Z)?")
_TURTLE = re.compile(
    r"""@prefix\b|@base\b|(?i:prefix|base)\s
      | <(?:[^<>\s]*://|urn:|tag:|file:|[#/]|>)  # an IRI; no element of XML is written so
      | _:[\w] | [\[(]
      | (?:[^\W\d_][\w.-]*)?:(?!//)[^\s:]*\s+(?:a\s|<|[\w.-]*:)""",
    re.VERBOSE,
)


def syntax_of(content: bytes, file: str) -> Syntax:
    """The syntax of a file's content. Raises BadInput if it is none of those that are read."""
    return syntax_of_text(decode(content, file), file)


def syntax_of_text(text: str, file: str) -> Syntax:
    """The syntax of a text; see :func:`syntax_of`."""
    beginning = _NOTHING_SAID.match(text)
    assert beginning is not None
    position = beginning.end()
    start = text[position : position + 10_000].lstrip()[:2000]
    if _MANCHESTER.match(start):
        return Syntax.MANCHESTER
    if _TURTLE.match(start):
        return Syntax.TURTLE
    if start.startswith("<"):
        return Syntax.RDFXML
    if not start:
        raise BadInput([error("O002", "the file holds nothing but comments", Span(file))])
    span = Span(file, text.count("\n", 0, position) + 1)
    advice = "an ontology is RDF/XML (rdf:RDF), Turtle (@prefix) or in Manchester syntax (Prefix:, Ontology:, Class:)"
    raise BadInput([error("O001", "this is neither RDF/XML, Turtle nor Manchester syntax", span, advice)])


def read_syntax(content: bytes, file: str, *, base: str, label: str) -> Parsed:
    """The triples of a file in any of the syntaxes. Raises BadInput as their readers do."""
    text = decode(content, file)
    match syntax_of_text(text, file):
        case Syntax.RDFXML:
            from planlang.ontology.rdfxml import read_rdfxml as read
        case Syntax.MANCHESTER:
            from planlang.ontology.manchester import read_manchester as read
        case Syntax.TURTLE:
            from planlang.ontology.turtle import read_turtle as read
    return read(text, file, base=base, label=label)
