"""Writes graphs in OWL/XML: the axioms of functional syntax, which has the same words, as elements."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple
from xml.sax.saxutils import escape, quoteattr

from lark import Token

from planlang.ontology.axioms import unquoted
from planlang.ontology.canonical import Sorting
from planlang.ontology.functional import GRAMMAR, literal_of
from planlang.ontology.functional_writer import functional
from planlang.ontology.nested_writers import is_legal
from planlang.ontology.structures import AXIOMS, ENTITIES, EXPRESSIONS, fitted
from planlang.ontology.terms import OWL, XSD, BNode, Literal, Triple

_OF_KIND = {"class": "Class", "range": "Datatype", "property": "ObjectProperty", "chain": "ObjectProperty",
            "individual": "NamedIndividual", "value": "IRI"}  # fmt: skip
"""Kind of a part -> element of a name there."""
_OF_NAME = {"DisjointUnion": "Class", "DatatypeDefinition": "Datatype", "DatatypeRestriction": "Datatype",
            "ObjectInverseOf": "ObjectProperty"}  # fmt: skip
"""Word whose names are no properties of data -> their element."""


def owlxml(
    triples: Iterable[Triple], prefixes: Mapping[str, str], *, order: Sorting = Sorting.TERMS
) -> tuple[str, list[Triple]]:
    """Write a graph; also return the triples that OWL/XML cannot express.

    Equal graphs give equal texts if sorted. In the order of the file, unused prefixes are kept, too.
    """
    given = list(triples)
    text, lost = functional([triple for triple in given if is_legal(triple)], prefixes, order=order)
    writer = _Writer()
    GRAMMAR.parse(text, writer)
    return writer.text(), [*(triple for triple in given if not is_legal(triple)), *lost]


class _Word(NamedTuple):
    """A word with its parts: names, nodes, literals and words."""

    word: str
    parts: list[Any]


class _Writer:
    """Callbacks of the grammar of functional syntax."""

    def __init__(self) -> None:
        self._prefixes: dict[str, str] = {}
        self._names: list[str] = []
        self._lines: list[str] = []

    def text(self) -> str:
        attributes = zip(("xmlns", "ontologyIRI", "versionIRI"), (str(OWL), *self._names), strict=False)
        head = "".join(f"\n    {name}={quoteattr(value)}" for name, value in attributes)
        known = "".join(
            f"  <Prefix name={quoteattr(name)} IRI={quoteattr(iri)}/>\n" for name, iri in self._prefixes.items()
        )
        return f'<?xml version="1.0" encoding="UTF-8"?>\n<Ontology{head}>\n{known}{"".join(self._lines)}</Ontology>\n'

    # called by the parser

    def count(self, token: Token) -> Token:
        return token

    def iri(self, children: list[Token]) -> str:
        (token,) = children
        if token.startswith("<"):
            return token[1:-1]
        prefix, _, local = token.partition(":")
        return self._prefixes[prefix] + local

    def node(self, children: list[Token]) -> BNode:
        return BNode(str(children[0]))

    def number(self, children: list[Token]) -> Literal:
        return Literal(str(children[0]), XSD.nonNegativeInteger)

    def plain_literal(self, children: list[Token]) -> Literal:
        return Literal(unquoted(children[0]))

    def language_literal(self, children: list[Token]) -> Literal:
        return Literal(unquoted(children[0]), None, str(children[1])[1:])

    def typed_literal(self, children: list[Any]) -> Literal:
        return literal_of(unquoted(children[0]), children[1])

    def prefix(self, children: list[Token]) -> None:
        self._prefixes[children[0][:-1]] = children[1][1:-1]

    def head(self, children: list[Any]) -> None:
        self._names = children[1:]

    def element(self, children: list[Any]) -> _Word:
        return _Word(children[0][:-1].rstrip(), children[1:-1])

    def part(self, children: list[Any]) -> None:
        self._lines += _element(children[0], "  ")

    def end(self, children: list[Token]) -> None:
        pass

    def start(self, children: list[Any]) -> None:
        pass


def _element(one: _Word, pad: str) -> Iterator[str]:
    word, parts = one
    if word == "Import":
        yield f"{pad}<Import>{escape(parts[0])}</Import>\n"
        return
    if word in ENTITIES:
        yield f"{pad}<{word} IRI={quoteattr(parts[0])}/>\n"
        return
    number = ""
    if word.endswith("Cardinality"):
        number, parts = f' cardinality="{parts[0].value}"', parts[1:]
    notes = [part for part in parts if _is_note(part)]
    rest = [part for part in parts if not _is_note(part)]
    yield f"{pad}<{word}{number}>\n"
    for part in notes:
        yield from _element(part, f"{pad}  ")
    yield from _parts(word, rest, f"{pad}  ")
    yield f"{pad}</{word}>\n"


def _is_note(part: Any) -> bool:
    return isinstance(part, _Word) and part.word == "Annotation"


def _parts(word: str, parts: Sequence[Any], pad: str) -> Iterator[str]:
    if word == "HasKey":  # the properties of objects, then those of data, each in parentheses
        groups = [("Class", parts[:1]), ("ObjectProperty", parts[1].parts), ("DataProperty", parts[2].parts)]
        named = [(part, kind) for kind, group in groups for part in group]
    elif word == "DatatypeRestriction":
        named = [(parts[0], "Datatype")]
    else:
        named = list(zip(parts, _elements_of_names(word, len(parts)), strict=True))
    for part, kind in named:
        yield from _part(part, kind, pad)
    for facet, value in zip(parts[1::2], parts[2::2], strict=True) if word == "DatatypeRestriction" else ():
        yield f"{pad}<FacetRestriction facet={quoteattr(facet)}>\n"
        yield from _part(value, "", f"{pad}  ")
        yield f"{pad}</FacetRestriction>\n"


def _part(part: Any, kind: str, pad: str) -> Iterator[str]:
    match part:
        case _Word():
            yield from _element(part, pad)
        case BNode(label):
            yield f"{pad}<AnonymousIndividual nodeID={quoteattr(label)}/>\n"
        case Literal(value, datatype, language):
            of = f" xml:lang={quoteattr(language)}" if language else ""
            of = f" datatypeIRI={quoteattr(datatype)}" if datatype else of
            yield f"{pad}<Literal{of}>{escape(value, {chr(13): '&#13;'})}</Literal>\n"
        case _:
            yield f"{pad}<IRI>{escape(part)}</IRI>\n" if kind == "IRI" else f"{pad}<{kind} IRI={quoteattr(part)}/>\n"


def _elements_of_names(word: str, count: int) -> Iterator[str]:
    """Yield the element of a name at each place of a word's parts."""
    if word == "Declaration":
        yield ""
        return
    if "Annotation" in word:
        is_pair = word == "SubAnnotationPropertyOf"
        yield from ["AnnotationProperty", *["AnnotationProperty" if is_pair else "IRI"] * (count - 1)]
        return
    of_name = _OF_NAME.get(word, "DataProperty")
    wanted = (EXPRESSIONS.get(word) or AXIOMS[word]).parts.removeprefix("number ")
    yield from (_OF_KIND.get(kind, of_name) for kind in fitted(wanted, count) or ())
