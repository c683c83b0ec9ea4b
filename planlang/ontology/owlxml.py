"""OWL/XML: an expat handler that keeps the parts of each open element; ``structures`` says what they mean."""

from __future__ import annotations

from typing import Any, NamedTuple
from xml.parsers import expat

from planlang.diagnostics import BadInput, Span, error
from planlang.files import decode
from planlang.ontology.axioms import DEEPEST
from planlang.ontology.expressions import Expression
from planlang.ontology.structures import Names, Structures
from planlang.ontology.terms import OWL, RDF, XSD, Literal
from planlang.ontology.triples import Parsed
from planlang.ontology.xml_text import EntityTable, explain, with_repairs

_XML = "http://www.w3.org/XML/1998/namespace "
_WITH_TEXT = frozenset(("IRI", "AbbreviatedIRI", "Literal", "Import"))


def read_owlxml(content: bytes | str, file: str, *, base: str, label: str = "b") -> Parsed:
    """Read a file in OWL/XML. ``base`` is its address unless it has ``xml:base`` or an ontology IRI.

    ``label`` is the prefix of blank-node labels. Raises BadInput with all errors, each with its position; XML that is
    not well-formed ends reading.
    """
    return with_repairs(lambda text: _parse(text, file, base, label), decode(content, file), file)


def _parse(text: str, file: str, base: str, label: str) -> Parsed:
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True
    handler = _Handler(parser, text, file, base, label)
    try:
        parser.Parse(text, True)
    except expat.ExpatError as problem:
        opened = [one.span for one in handler.opened]
        raise BadInput([explain(problem, text, file, opened, handler.entities.names)]) from None
    if handler.structures.problems:
        raise BadInput(sorted(handler.structures.problems, key=lambda one: one.span or Span(file)))
    return Parsed(handler.structures.out.triples, handler.structures.warnings, handler.names.prefixes)


class _Open(NamedTuple):
    """Open element: its name, attributes and position, its parts and its text so far."""

    word: str
    given: dict[str, str]
    span: Span
    parts: list[Any]
    text: list[str]


class _Handler:
    def __init__(self, parser: expat.XMLParserType, text: str, file: str, base: str, label: str) -> None:
        self.names = Names.of(base, '<Prefix name="{}" IRI="{}"/>')
        self.structures = Structures(
            file, label, self.names, lambda word, parts: f"<{word}>{' with ' if parts else ''}{', '.join(parts)}"
        )
        self.opened: list[_Open] = []
        self.entities = EntityTable(text, file, self._here)
        self._file = file
        self._parser = parser
        parser.StartElementHandler = self._begin
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self._characters
        self.entities.guard(parser)

    def _here(self) -> Span:
        return Span(self._file, self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _begin(self, tag: str, given: dict[str, str]) -> None:
        namespace, _, word = tag.rpartition(" ")
        span = self._here()
        if len(self.opened) > DEEPEST:
            raise BadInput([error("O008", f"elements are nested more than {DEEPEST} deep", span)])
        if not self.opened and namespace != OWL:
            stated = f"the namespace {namespace}" if namespace else "no namespace"
            advice = f'OWL/XML has <Ontology xmlns="{OWL}">'
            raise BadInput([error("O001", f"the element Ontology has {stated}", span, advice)])
        if namespace not in ("", OWL):
            word = f"{namespace}{word}"
        opened = _Open(word, given, span, [], [])
        if not self.opened:
            self._ontology(opened)
        elif (address := given.get(_XML + "base")) is not None:
            self.names.base = self.names.full(address)
        self.opened.append(opened)

    def _ontology(self, opened: _Open) -> None:
        given = opened.given
        if address := given.get(_XML + "base"):
            self.names.base = self.names.full(address)
        iri, version = (given.get(key) for key in ("ontologyIRI", "versionIRI"))
        full, its_version = (self.names.full(name) if name else None for name in (iri, version))
        if full is not None and not address:
            self.names.base = full
        self.structures.begin(full, its_version, opened.span)

    def _characters(self, data: str) -> None:
        if self.opened and (self.opened[-1].word in _WITH_TEXT):
            self.opened[-1].text.append(data)
        elif not data.isspace():
            span = self.opened[-1].span if self.opened else self._here()
            self.structures.fail(f"text between elements: {data.strip()[:40]!r}", span, "remove it")

    def _end(self, _: str) -> None:
        opened = self.opened.pop()
        if not self.opened:
            return
        part = self._part(opened)
        if len(self.opened) > 1:
            if part is None:
                outer = self.opened[-1].word
                part = self.structures.fail(f"a Prefix is inside of {outer}", opened.span, "move it before the axioms")
            self.opened[-1].parts.append(part)
        elif part is not None:
            self.structures.add(part, opened.span)

    def _part(self, opened: _Open) -> Any:
        """Make what a closed element is; None for a prefix."""
        word, given, span, parts, _ = opened
        if word == "Prefix":
            self.names.prefixes[given.get("name", "")] = self.names.full(given.get("IRI", ""))
            return None
        if word == "Literal":
            return self._literal(opened)
        if word == "AnonymousIndividual":
            node = given.get("nodeID", "").removeprefix("_:")
            return Expression(
                "name", span, self.structures.out.named_node(node) if node else self.structures.out.fresh()
            )
        name = self._name(opened)
        if word in ("IRI", "AbbreviatedIRI"):
            return name or self.structures.fail(f"{word} without a name", span)
        if name is not None:
            parts = [name, *parts]
        if (number := given.get("cardinality")) is not None:
            parts = [Expression("name", span, Literal(number, XSD.nonNegativeInteger)), *parts]
        if (facet := given.get("facet")) is not None:
            parts = [Expression("name", span, self.names.full(facet)), *parts]
        return self.structures.close(word, parts, span)

    def _name(self, opened: _Open) -> Expression | None:
        """Name in an attribute or the text of an element; None if it has none."""
        given, span = opened.given, opened.span
        text = "".join(opened.text).strip()
        if (iri := given.get("IRI")) is not None:
            return self._full(iri, span)
        if (short := given.get("abbreviatedIRI")) is not None or (opened.word == "AbbreviatedIRI" and (short := text)):
            return self.structures.name(short, span)
        return self._full(text, span) if text else None

    def _full(self, iri: str, span: Span) -> Expression:
        """Name with a full IRI; some tools write abbreviated ones there."""
        prefix, colon, local = iri.partition(":")
        if not colon or local.startswith("//") or prefix not in self.names.prefixes:
            return Expression("name", span, self.names.full(iri))
        advice = f'write abbreviatedIRI="{iri}"'
        message = f"the IRI {iri} begins with a declared prefix; such IRIs are read as abbreviated ones"
        self.structures.warn_once("O010", message, span, advice)
        return self.structures.name(iri, span)

    def _literal(self, opened: _Open) -> Expression:
        datatype = opened.given.get("datatypeIRI")
        language = opened.given.get(_XML + "lang", "").lower() or None
        full = None if datatype is None else self.names.full(datatype)
        kind = None if language or full == RDF.PlainLiteral else full
        return Expression("name", opened.span, Literal("".join(opened.text), kind, language))
