"""RDF/XML: an expat handler that gives every triple its position.

General layout: :func:`read_rdfxml` decodes the file and drives expat; ``_Handler`` keeps one frame per open element,
and the kind of the innermost frame says what the next element means: a node, a property, an item of a list, text.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.ontology.entities import EntityTable
from planlang.ontology.iris import resolve
from planlang.ontology.parsed import MOST_TRIPLES, Parsed, counted
from planlang.ontology.terms import FIRST, NIL, ONTOLOGY, RDF, REST, TYPE, BNode, Literal, Term, Triple
from planlang.ontology.xml_repairs import repair
from planlang.ontology.xml_text import decode, explain

DEEPEST = 100
"""Elements inside each other."""

MOST_WARNINGS = 100
"""Warnings about one file that are shown; further ones are counted."""

MOST_PREFIXES = 1000
"""Prefixes of a file that are remembered."""

_XML = "http://www.w3.org/XML/1998/namespace"
_SYNTAX = frozenset(
    RDF + name
    for name in ("RDF", "ID", "about", "parseType", "resource", "nodeID", "datatype", "li", "Description", "bagID",
                 "aboutEach", "aboutEachPrefix")
)  # fmt: skip
_OUTDATED = frozenset(RDF + name for name in ("bagID", "aboutEach", "aboutEachPrefix"))
_NOT_NODES = _SYNTAX - {RDF + "Description"}
_NOT_PROPERTIES = (_SYNTAX - {RDF + "li"}) | _OUTDATED
_LEGAL_NAME = re.compile(r"[^\W\d][\w.\-\u00b7]*")
_MISPLACED = {"ID", "about", "resource", "datatype", "nodeID", "parseType", "type"}


@dataclass(slots=True)
class _Frame:
    kind: str
    """"document", "rdf", "node", "property", "collection", "literal" or "skipped"."""
    base: str
    language: str | None
    span: Span
    subject: str | BNode | None = None
    predicate: str = ""
    datatype: str | None = None
    reified: str | None = None
    filled: bool = False
    last_cell: BNode | None = None
    items: int = 0
    text: list[str] = field(default_factory=list)
    names: int = 0


def read_rdfxml(content: bytes, file: str, *, base: str, label: str = "b") -> Parsed:
    """The triples of an RDF/XML file. ``base`` is its address unless it says ``xml:base``.

    ``label`` begins the labels of nameless nodes. Raises BadInput with the position of the first thing that is not XML,
    that is out of bounds, or that refers outside the file.
    """
    text = decode(content, file)
    try:
        return _parse(text, file, base, label)
    except BadInput as problem:
        if problem.diagnostics[0].code != "O005":
            raise
        repaired = repair(text, file)
        if not repaired.diagnostics:
            raise
        try:
            parsed = _parse(repaired.text, file, base, label)
        except BadInput as remaining:
            raise BadInput([*repaired.diagnostics, *remaining.diagnostics]) from None
        parsed.diagnostics[:0] = repaired.diagnostics
        return parsed


def _parse(text: str, file: str, base: str, label: str) -> Parsed:
    parser = expat.ParserCreate(namespace_separator=" ")
    handler = _Handler(parser, text, file, base, label)
    try:
        parser.Parse(text, True)
    except expat.ExpatError as problem:
        open_lines = [frame.span.line for frame in handler.frames[1:]]
        raise BadInput([explain(problem, text, file, open_lines, handler.entities.names)]) from None
    return Parsed(handler.triples, counted(handler.diagnostics, handler.unsaid), handler.prefixes)


class _Handler:
    def __init__(self, parser: expat.XMLParserType, text: str, file: str, base: str, label: str) -> None:
        self.parser = parser
        self.file = file
        self.text = text
        self.label = label
        self.triples: list[Triple] = []
        self.diagnostics: list[Diagnostic] = []
        self.unsaid = 0
        self.frames = [_Frame("document", base, None, Span(file))]
        self.nodes: dict[str, BNode] = {}
        self.fresh = 0
        self.ids: dict[str, Span] = {}
        self.entities = EntityTable(text, file)
        self.resolved: dict[tuple[str, str], str] = {}
        self.prefixes: dict[str, str] = {}
        parser.ordered_attributes = True
        parser.StartElementHandler = self.start
        parser.EndElementHandler = self.end
        parser.StartNamespaceDeclHandler = self.namespace
        parser.CharacterDataHandler = self.characters
        parser.StartDoctypeDeclHandler = self.doctype
        parser.EndDoctypeDeclHandler = self.entities.check
        parser.EntityDeclHandler = self.entity
        parser.SkippedEntityHandler = self.skipped_entity

    # positions and messages

    def here(self) -> Span:
        return Span(self.file, self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1)

    def warn(self, code: str, message: str, span: Span, help: str | None = None) -> None:
        if len(self.diagnostics) < MOST_WARNINGS:
            self.diagnostics.append(warning(code, message, span, help))
        else:
            self.unsaid += 1

    # document type

    def doctype(self, name: str, system: str | None, public: str | None, internal: bool) -> None:
        if system or public:
            advice = "declare the entities in the file itself"
            raise BadInput([error("O009", f"an external document type is refused: {system}", self.here(), advice)])

    def entity(
        self,
        name: str,
        is_parameter: bool,
        value: str | None,
        base: str | None,
        system: str | None,
        public: str | None,
        notation: str | None,
    ) -> None:
        if is_parameter:
            raise BadInput([error("O009", f"a parameter entity is refused: %{name};", self.here())])
        if value is None:
            advice = "write its value into the file"
            raise BadInput([error("O009", f"an external entity is refused: &{name}; {system}", self.here(), advice)])
        self.entities.declare(name, value, self.here())

    def skipped_entity(self, name: str, is_parameter: bool) -> None:
        raise BadInput([error("O009", f"an entity that is not in the file is refused: &{name};", self.here())])

    def namespace(self, prefix: str | None, namespace: str | None) -> None:
        if namespace and len(self.prefixes) < MOST_PREFIXES:
            self.prefixes.setdefault(prefix or "", namespace)

    # elements

    def start(self, tag: str, attributes: list[str]) -> None:
        parent = self.frames[-1]
        span = self.here()
        if len(self.frames) > DEEPEST:
            raise BadInput([error("O008", f"more than {DEEPEST} elements inside each other", span)])
        if len(self.triples) > MOST_TRIPLES:
            raise BadInput([error("O003", f"the file has more than {MOST_TRIPLES:,} triples", span)])
        name = tag.replace(" ", "", 1)
        if parent.kind == "literal":
            self._literal_start(parent, tag, attributes)
            self.frames.append(_Frame("literal", parent.base, parent.language, span, text=parent.text, names=1))
            return
        if parent.kind == "skipped":
            self.frames.append(_Frame("skipped", parent.base, parent.language, span))
            return
        given, base, language = self._attributes(attributes, parent, span)
        if parent.kind == "document" and name == RDF + "RDF":
            self.frames.append(_Frame("rdf", base, language, span))
        elif parent.kind in ("document", "rdf"):
            if parent.kind == "document":
                self._must_be_rdf(tag, span)
            self._node(name, tag, given, base, language, span)
        elif parent.kind == "node":
            self._property(parent, name, tag, given, base, language, span)
        elif parent.kind == "collection":
            item = self._node(name, tag, given, base, language, span)
            self._append(parent, item, span)
        elif parent.filled:
            self.warn("O010", "a property has one value; a second element in it is skipped", span)
            self.frames.append(_Frame("skipped", base, language, span))
        else:
            self._fill(parent, name, tag, given, base, language, span)

    def _must_be_rdf(self, tag: str, span: Span) -> None:
        namespace, _, local = tag.rpartition(" ")
        if tag.replace(" ", "") == ONTOLOGY:
            message, advice = "this is OWL/XML, another syntax", "save it as RDF/XML or in Manchester syntax"
        elif not namespace or namespace == "http://www.w3.org/1999/xhtml":
            message = f"this is XML, but not RDF: its first element is {local}"
            advice = "an ontology begins with rdf:RDF or in Manchester syntax"
        else:
            return
        raise BadInput([error("O001", message, span, advice)])

    def _fill(
        self, parent: _Frame, name: str, tag: str, given: dict[str, str], base: str, language: str | None, span: Span
    ) -> None:
        """The node element that is the value of a property: the triple first, then what is said about the node."""
        parent.filled = True
        place = len(self.triples)
        node = self._node(name, tag, given, base, language, span)
        if node is not None:
            said = self.triples[place:]
            del self.triples[place:]
            self._state(parent, node)
            self.triples += said

    def end(self, tag: str) -> None:
        frame = self.frames.pop()
        if frame.kind == "literal":
            if frame.names:
                frame.text.append(f"</{tag.rpartition(' ')[2]}>")
            else:
                self._state(frame, Literal("".join(frame.text), RDF + "XMLLiteral"))
        elif frame.kind == "collection":
            if frame.last_cell is None:
                self._state(frame, NIL)
            else:
                self.triples.append(Triple(frame.last_cell, REST, NIL, frame.span))
        elif frame.kind == "property" and not frame.filled:
            self._state(frame, Literal("".join(frame.text), frame.datatype, None if frame.datatype else frame.language))
        elif frame.kind == "property" and (stray := "".join(frame.text).strip()):
            self.warn("O010", f"text beside an element is skipped: {stray[:40]!r}", frame.span)

    def characters(self, data: str) -> None:
        frame = self.frames[-1]
        if frame.kind == "literal":
            frame.text.append(escape(data))
        elif frame.kind == "property":
            frame.text.append(data)
        elif frame.kind != "skipped" and (stray := data.strip()):
            start = self.here()
            span = Span(self.file, start.line, start.column + len(data) - len(data.lstrip()))
            self.warn("O010", f"text between elements is skipped: {stray[:40]!r}", span)

    # nodes and properties

    def _attributes(self, attributes: list[str], parent: _Frame, span: Span) -> tuple[dict[str, str], str, str | None]:
        """Attributes by IRI, and the base and language that hold from here on."""
        given: dict[str, str] = {}
        base, language = parent.base, parent.language
        for key, value in zip(attributes[::2], attributes[1::2], strict=True):
            namespace, _, local = key.rpartition(" ")
            if namespace == _XML:
                if local == "base":
                    base = self._resolve(base, value).partition("#")[0] if value else base
                elif local == "lang":
                    language = value.lower() or None
            elif namespace:
                given[namespace + local] = value
            elif local in _MISPLACED:
                given[RDF + local] = value
                self.warn("O010", f"{local} is read as rdf:{local}", span, f"write rdf:{local}")
            else:
                self.warn("O010", f"an attribute without prefix is skipped: {local}", span)
        return given, base, language

    def _node(
        self, name: str, tag: str, given: dict[str, str], base: str, language: str | None, span: Span
    ) -> str | BNode | None:
        if " " not in tag or name in _NOT_NODES:
            shown = tag.rpartition(" ")[2]
            self.warn("O010", f"{shown} is no class that a thing can have; the element is skipped", span)
            self.frames.append(_Frame("skipped", base, language, span))
            return None
        subject: str | BNode
        if (value := given.get(RDF + "ID")) is not None:
            subject = self._identifier(value, base, span)
        elif (value := given.get(RDF + "about")) is not None:
            subject = self._resolve(base, value)
        elif (value := given.get(RDF + "nodeID")) is not None:
            subject = self._named_node(value)
        elif (value := given.get(RDF + "resource")) is not None:
            self.warn("O010", "rdf:resource of a thing is read as rdf:about", span, "write rdf:about")
            subject = self._resolve(base, value)
        else:
            subject = self._fresh()
        if name != RDF + "Description":
            self.triples.append(Triple(subject, TYPE, name, span))
        self._property_attributes(subject, given, base, language, span)
        self.frames.append(_Frame("node", base, language, span, subject=subject))
        return subject

    def _property(
        self,
        parent: _Frame,
        name: str,
        tag: str,
        given: dict[str, str],
        base: str,
        language: str | None,
        span: Span,
    ) -> None:
        if name == RDF + "li":
            parent.items += 1
            name = f"{RDF}_{parent.items}"
        elif " " not in tag or name in _NOT_PROPERTIES:
            self.warn("O010", f"{tag.rpartition(' ')[2]} is no property; the element is skipped", span)
            self.frames.append(_Frame("skipped", base, language, span))
            return
        frame = _Frame("property", base, language, span, parent.subject, name)
        if (value := given.pop(RDF + "ID", None)) is not None:
            frame.reified = self._identifier(value, base, span)
        self.frames.append(frame)
        parse_type = given.pop(RDF + "parseType", None)
        datatype = given.pop(RDF + "datatype", None)
        if RDF + "about" in given and RDF + "resource" not in given:
            self.warn("O010", "rdf:about of a property is read as rdf:resource", span, "write rdf:resource")
            given[RDF + "resource"] = given[RDF + "about"]
        if parse_type == "Collection":
            frame.kind = "collection"
        elif parse_type == "Resource":
            node = self._fresh()
            self._state(frame, node)
            frame.kind, frame.subject = "node", node
        elif parse_type is not None:
            frame.kind = "literal"
            if parse_type != "Literal":
                self.warn("O010", f"parseType {parse_type!r} is read as Literal", span)
        elif (value := given.get(RDF + "resource")) is not None:
            self._empty(frame, self._resolve(base, value), given)
        elif (value := given.get(RDF + "nodeID")) is not None:
            self._empty(frame, self._named_node(value), given)
        elif any(key not in _SYNTAX for key in given):
            self._empty(frame, self._fresh(), given)
        elif datatype is not None:
            frame.datatype = self._resolve(base, datatype)

    def _empty(self, frame: _Frame, node: str | BNode, given: dict[str, str]) -> None:
        frame.filled = True
        self._state(frame, node)
        self._property_attributes(node, given, frame.base, frame.language, frame.span)

    def _property_attributes(
        self, subject: str | BNode, given: dict[str, str], base: str, language: str | None, span: Span
    ) -> None:
        for key, value in given.items():
            if key == TYPE:
                self.triples.append(Triple(subject, TYPE, self._resolve(base, value), span))
            elif key in _OUTDATED:
                self.warn("O010", f"rdf:{key.removeprefix(RDF)} is no longer part of RDF and is skipped", span)
            elif key not in _SYNTAX:
                self.triples.append(Triple(subject, key, Literal(value, None, language), span))

    def _state(self, frame: _Frame, value: Term) -> None:
        assert frame.subject is not None
        self.triples.append(Triple(frame.subject, frame.predicate, value, frame.span))
        if frame.reified is not None:
            for part, term in (
                (TYPE, RDF + "Statement"),
                (RDF + "subject", frame.subject),
                (RDF + "predicate", frame.predicate),
                (RDF + "object", value),
            ):
                self.triples.append(Triple(frame.reified, part, term, frame.span))

    def _append(self, frame: _Frame, item: str | BNode | None, span: Span) -> None:
        if item is None:
            return
        cell = self._fresh()
        if frame.last_cell is None:
            self._state(frame, cell)
        else:
            self.triples.append(Triple(frame.last_cell, REST, cell, span))
        self.triples.append(Triple(cell, FIRST, item, span))
        frame.last_cell = cell

    def _literal_start(self, parent: _Frame, tag: str, attributes: list[str]) -> None:
        parts = [tag.rpartition(" ")[2]]
        if parent.names == 0 and " " in tag:
            parts.append(f"xmlns={quoteattr(tag.rpartition(' ')[0])}")
        parts += (
            f"{key.rpartition(' ')[2]}={quoteattr(value)}"
            for key, value in zip(attributes[::2], attributes[1::2], strict=True)
        )
        parent.text.append(f"<{' '.join(parts)}>")

    # names

    def _resolve(self, base: str, reference: str) -> str:
        known = self.resolved.get((base, reference))
        if known is None:
            known = self.resolved[base, reference] = resolve(base, reference)
        return known

    def _identifier(self, value: str, base: str, span: Span) -> str:
        if not _LEGAL_NAME.fullmatch(value):
            self.warn("O010", f"rdf:ID is no XML name: {value!r}", span, "read as it is; rdf:about takes any IRI")
        iri = self._resolve(base, "#" + value)
        earlier = self.ids.setdefault(iri, span)
        if earlier is not span:
            advice = "both are read as one; write rdf:about where you refer to it again"
            self.warn("O011", f"rdf:ID {value!r} is given twice, first in line {earlier.line}", span, advice)
        return iri

    def _fresh(self) -> BNode:
        self.fresh += 1
        return BNode(f"{self.label}{self.fresh}")

    def _named_node(self, value: str) -> BNode:
        return self.nodes.setdefault(value, BNode(f"{self.label}.{value}"))
