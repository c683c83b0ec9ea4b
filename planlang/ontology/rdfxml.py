"""RDF/XML: an expat handler that gives every triple its position.

General layout: :func:`read_rdfxml` decodes the file and drives expat; ``_Handler`` keeps one frame per open element,
and the kind of the innermost frame decides what the next element is: a node, a property, an item of a list, text. The
handlers run once per element of large files, so they compare term numbers and integer kinds, not strings.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.files import decode
from planlang.ontology.terms import RDF, BNode, Literal, resolve
from planlang.ontology.triples import MOST_TRIPLES, Parsed, Triples, counted
from planlang.ontology.xml_text import EntityTable, explain, must_be_rdf, with_repairs

DEEPEST = 100
"""Greatest nesting depth of elements."""

MOST_WARNINGS = 100
"""Warnings about one file that are shown; further ones are counted."""

MOST_PREFIXES = 1000
"""Prefixes of a file that are remembered."""

_XML = "http://www.w3.org/XML/1998/namespace"
_ROOT, _DESCRIPTION, _LI = RDF + "RDF", RDF + "Description", RDF + "li"
_ID, _ABOUT, _RESOURCE, _NODE_ID = RDF + "ID", RDF + "about", RDF + "resource", RDF + "nodeID"
_PARSE_TYPE, _DATATYPE = RDF + "parseType", RDF + "datatype"
_OUTDATED = frozenset(RDF + name for name in ("bagID", "aboutEach", "aboutEachPrefix"))
_SYNTAX = _OUTDATED | {_ROOT, _ID, _ABOUT, _PARSE_TYPE, _RESOURCE, _NODE_ID, _DATATYPE, _LI, _DESCRIPTION}
_NOT_NODES = _SYNTAX - {_DESCRIPTION}
_NOT_PROPERTIES = _SYNTAX - {_LI}
_LEGAL_NAME = re.compile(r"[^\W\d][\w.\-\u00b7]*")
_MISPLACED = {"ID", "about", "resource", "datatype", "nodeID", "parseType", "type"}

_ONLY_RESOURCE, _ONLY_ABOUT = f"{RDF} resource", f"{RDF} about"
_DOCUMENT, _RDF, _NODE, _PROPERTY, _COLLECTION, _LITERAL, _SKIPPED = range(7)
_WITH_TEXT = frozenset((_PROPERTY, _LITERAL, _SKIPPED))
"""Kinds of elements in which text is allowed, or ignored."""
_AROUND_THINGS = frozenset((_RDF, _COLLECTION))
_NOTHING: dict[str, str] = {}


class _Frame:
    """Open element: its kind, the base IRI and language inside it, its position. Terms are numbers; -1 is none.

    A property has its ``subject`` and is ``filled`` once its value is known; ``text`` holds its characters,
    ``last_cell`` the last cell of its list so far, ``reified`` the node of its rdf:ID.
    """

    __slots__ = ("base", "column", "datatype", "filled", "items", "kind", "language", "last_cell", "line", "names",
                 "predicate", "reified", "subject", "text")  # fmt: skip

    def __init__(self, kind: int, base: str, language: str | None, line: int, column: int, subject: int = -1) -> None:
        self.kind, self.base, self.language = kind, base, language
        self.line, self.column, self.subject = line, column, subject
        if kind == _NODE:
            self.items = 0
        elif kind != _SKIPPED:
            self.filled = False
            self.text: list[str] = []
            self.predicate = -1
            self.datatype: str | None = None
            self.reified = self.last_cell = -1
            self.names = False


def read_rdfxml(content: bytes | str, file: str, *, base: str, label: str = "b") -> Parsed:
    """Read an RDF/XML file. ``base`` is its address unless it has ``xml:base``.

    ``label`` is the prefix of blank-node labels. Raises BadInput at the first position that is not well-formed XML,
    exceeds a limit, or refers outside the file.
    """
    return with_repairs(lambda text: _parse(text, file, base, label), decode(content, file), file)


def _parse(text: str, file: str, base: str, label: str) -> Parsed:
    """Parse with buffered text, which is fast; if misplaced text has to be reported, again unbuffered for positions."""
    try:
        return _parsed(text, file, base, label, in_pieces=False)
    except _Stray:
        return _parsed(text, file, base, label, in_pieces=True)


def _parsed(text: str, file: str, base: str, label: str, *, in_pieces: bool) -> Parsed:
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = not in_pieces
    handler = _Handler(parser, text, file, base, label)
    try:
        parser.Parse(text, True)
    except expat.ExpatError as problem:
        opened = [Span(file, frame.line, frame.column) for frame in handler.frames[1:]]
        raise BadInput([explain(problem, text, file, opened, handler.entities.names)]) from None
    if not all(map(str.isspace, handler.gaps)):
        raise _Stray
    return Parsed(handler.triples, counted(handler.diagnostics, handler.not_shown), handler.prefixes)


class _Stray(Exception):
    """Text was found where none is allowed."""


class _Handler:
    def __init__(self, parser: expat.XMLParserType, text: str, file: str, base: str, label: str) -> None:
        self.parser = parser
        self.file = file
        self.triples = Triples(file, label)
        self.diagnostics: list[Diagnostic] = []
        self.not_shown = 0
        self.frames = [_Frame(_DOCUMENT, base, None, 1, 1)]
        self.ids: dict[str, Span] = {}
        self.entities = EntityTable(text, file, self.here)
        self.resolved: dict[str, dict[str, int]] = {}
        """Base -> relative IRI -> number of the resolved IRI."""
        self.tags: dict[str, str] = {}
        self.keys: dict[str, str] = {}
        """IRIs of elements (``tags``) and of attributes that state triples (``keys``), by their names in expat."""
        self.prefixes: dict[str, str] = {}
        self.classes: dict[str, int] = {}
        """Number of the class of a node element, by its name in expat; -1 for rdf:Description."""
        self.plain: dict[str, int] = {}
        """Number of a property's IRI, by its name in expat, except rdf:li, whose IRI depends on its position."""
        self.complete = _Frame(_PROPERTY, base, None, 1, 1)
        """Frame shared by all properties with only rdf:resource: they are the most frequent, and never nested."""
        self.complete.filled = True
        self.gaps: set[str] = set()
        """Distinct texts where only white space is allowed; unused if text is unbuffered."""
        self.between = self.gaps.add if parser.buffer_text else self.characters
        """Handler of text between elements; ``set.add``, as a Python call for each would take most of the time."""
        self.type, self.first, self.rest = map(self.triples.number, (RDF.type, RDF.first, RDF.rest))
        parser.ordered_attributes = True
        parser.StartElementHandler = self._starting()
        parser.EndElementHandler = self._ending()
        parser.StartNamespaceDeclHandler = self.namespace
        parser.CharacterDataHandler = self.between
        self.entities.guard(parser)

    def here(self) -> Span:
        return Span(self.file, self.parser.CurrentLineNumber, self.parser.CurrentColumnNumber + 1)

    def warn(self, code: str, message: str, span: Span, help: str | None = None) -> None:
        if len(self.diagnostics) < MOST_WARNINGS:
            self.diagnostics.append(warning(code, message, span, help))
        else:
            self.not_shown += 1

    def namespace(self, prefix: str | None, namespace: str | None) -> None:
        if namespace and len(self.prefixes) < MOST_PREFIXES:
            self.prefixes.setdefault(prefix or "", namespace)

    def _starting(self) -> Callable[[str, list[str]], None]:
        """Make the handler of start tags.

        Most elements of large files are properties with only rdf:resource, nodes with only rdf:about, and blank items
        of lists. These are read here, with all names in local variables; :meth:`_start` reads the others.
        """
        frames, triples, parser, plain, complete = self.frames, self.triples, self.parser, self.plain, self.complete
        predicates, objects = triples.predicates.append, triples.objects.append
        lines, columns, state = triples.lines.append, triples.columns.append, triples.subjects.append
        resolved, resolve, start, push, between = self.resolved, self._resolve, self._start, frames.append, self.between
        subjects, classes, kind_of = triples.subjects, self.classes, self.type
        fresh, append = triples.fresh, self._append

        def begin(tag: str, attributes: list[str]) -> None:
            parent = frames[-1]
            kind = parent.kind
            line, column = parser.CurrentLineNumber, parser.CurrentColumnNumber + 1
            if len(frames) > DEEPEST or len(subjects) > MOST_TRIPLES:
                self._too_much()
            if kind == _NODE:
                predicate = plain.get(tag, -1)
                if predicate >= 0 and len(attributes) == 2 and attributes[0] == _ONLY_RESOURCE:
                    base, reference = parent.base, attributes[1]
                    known = resolved.get(base)
                    value = known.get(reference) if known is not None else None
                    complete.base, complete.language = base, parent.language
                    complete.line, complete.column = line, column
                    push(complete)
                    state(parent.subject)
                    predicates(predicate)
                    objects(resolve(base, reference) if value is None else value)
                    lines(line)
                    columns(column)
                    return
            elif kind in _AROUND_THINGS:
                cls, is_item = classes.get(tag, -1), kind == _COLLECTION
                if cls >= 0 and (not attributes if is_item else len(attributes) == 2 and attributes[0] == _ONLY_ABOUT):
                    base = parent.base
                    subject = fresh() if is_item else resolve(base, attributes[1])
                    frame = _Frame(_NODE, base, parent.language, line, column, subject)
                    push(frame)
                    state(subject)
                    predicates(kind_of)
                    objects(cls)
                    lines(line)
                    columns(column)
                    if is_item:
                        append(parent, frame)
                    return
            start(parent, tag, attributes, line, column)
            parser.CharacterDataHandler = self.characters if frames[-1].kind in _WITH_TEXT else between

        return begin

    def _too_much(self) -> None:
        if len(self.frames) > DEEPEST:
            raise BadInput([error("O008", f"elements are nested more than {DEEPEST} deep", self.here())])
        raise BadInput([error("O003", f"the file has more than {MOST_TRIPLES:,} triples", self.here())])

    def _start(self, parent: _Frame, tag: str, attributes: list[str], line: int, column: int) -> None:
        frames, kind = self.frames, parent.kind
        if kind == _LITERAL:
            parent.text.append(_opening_tag(tag, attributes, parent))
            frame = _Frame(_LITERAL, parent.base, parent.language, line, column)
            frame.text, frame.names = parent.text, True
            frames.append(frame)
            return
        if kind == _SKIPPED:
            frames.append(_Frame(_SKIPPED, parent.base, parent.language, line, column))
            return
        name = self.tags.get(tag)
        if name is None:
            name = self.tags[tag] = tag.replace(" ", "", 1)
        given, base, language = _NOTHING, parent.base, parent.language
        if attributes:
            given, base, language = self._attributes(attributes, parent)
        if kind == _NODE:
            self._property(_Frame(_PROPERTY, base, language, line, column, parent.subject), parent, name, tag, given)
            return
        frame = _Frame(_NODE, base, language, line, column)
        if kind == _RDF:
            self._node(frame, name, tag, given)
        elif kind == _COLLECTION:
            if self._node(frame, name, tag, given):
                self._append(parent, frame)
        elif kind == _PROPERTY:
            self._fill(parent, frame, name, tag, given)
        elif name == _ROOT:
            frames.append(_Frame(_RDF, base, language, line, column))
        else:
            must_be_rdf(tag, self.here())
            self._node(frame, name, tag, given)

    def _fill(self, parent: _Frame, frame: _Frame, name: str, tag: str, given: dict[str, str]) -> None:
        """Read the node element that is the value of a property: its triple comes before the node's statements."""
        if parent.filled:
            self.warn("O010", "a second value in a property is ignored", self.here(), "repeat the property for it")
            frame.kind = _SKIPPED
            self.frames.append(frame)
            return
        parent.filled = True
        row = len(self.triples)
        if self._node(frame, name, tag, given):
            self._state(parent, frame.subject, row)

    def _ending(self) -> Callable[[str], None]:
        """Make the handler of end tags."""
        frames, parser, complete, end = self.frames, self.parser, self.complete, self._end
        pop, characters, between = frames.pop, self.characters, self.between

        def close(tag: str) -> None:
            frame = pop()
            if frame is complete and not frame.text:
                return
            kind = frame.kind
            if kind != _NODE and (kind != _PROPERTY or not frame.filled or frame.text):
                end(frame, tag)
            if frames[-1].kind in _WITH_TEXT:
                parser.CharacterDataHandler = characters
            elif kind in _WITH_TEXT:
                parser.CharacterDataHandler = between

        return close

    def _end(self, frame: _Frame, tag: str) -> None:
        kind = frame.kind
        if kind == _PROPERTY:
            if not frame.filled:
                language = None if frame.datatype else frame.language
                self._state(frame, self.triples.number(Literal("".join(frame.text), frame.datatype, language)))
            elif stray := "".join(frame.text).strip():
                self._misplaced("beside an element", stray, Span(self.file, frame.line, frame.column))
            if frame is self.complete:
                frame.text.clear()
        elif kind == _LITERAL:
            if frame.names:
                frame.text.append(f"</{tag.rpartition(' ')[2]}>")
            else:
                self._state(frame, self.triples.number(Literal("".join(frame.text), RDF.XMLLiteral)))
        elif kind == _COLLECTION:
            end = self.triples.number(RDF.nil)
            if frame.last_cell < 0:
                self._state(frame, end)
            else:
                self.triples.add(frame.last_cell, self.rest, end, frame.line, frame.column)

    def characters(self, data: str) -> None:
        frame = self.frames[-1]
        kind = frame.kind
        if kind == _PROPERTY:
            frame.text.append(data)
        elif kind == _LITERAL:
            frame.text.append(escape(data))
        elif kind != _SKIPPED and not data.isspace():
            if self.parser.buffer_text:
                raise _Stray
            stray, start = data.strip(), self.here()
            span = Span(self.file, start.line, start.column + len(data) - len(data.lstrip()))
            self._misplaced("between elements", stray, span)

    def _misplaced(self, where: str, text: str, span: Span) -> None:
        advice = "remove it, or write it as the value of a property"
        self.warn("O010", f"text {where} is ignored: {text[:40]!r}", span, advice)

    # nodes and properties

    def _attributes(self, attributes: list[str], parent: _Frame) -> tuple[dict[str, str], str, str | None]:
        """Map attributes to their IRIs; the result has the base and language inside the element, too."""
        given: dict[str, str] = {}
        base, language = parent.base, parent.language
        pairs = iter(attributes)
        for key, value in zip(pairs, pairs, strict=True):
            name = self.keys.get(key)
            if name is not None:
                given[name] = value
                continue
            namespace, _, local = key.rpartition(" ")
            if namespace == _XML:
                if local == "base":
                    base = resolve(base, value).partition("#")[0] if value else base
                elif local == "lang":
                    language = value.lower() or None
            elif namespace:
                self.keys[key] = namespace + local
                given[namespace + local] = value
            elif local in _MISPLACED:
                given[RDF + local] = value
                self.warn("O010", f"{local} is read as rdf:{local}", self.here(), f"write rdf:{local}")
            else:
                self.warn("O010", f"an attribute without prefix is ignored: {local}", self.here(), "give it a prefix")
        return given, base, language

    def _node(self, frame: _Frame, name: str, tag: str, given: dict[str, str]) -> bool:
        """Open a node element and set the subject of its frame; False if it cannot be one and is ignored."""
        self.frames.append(frame)
        cls = self.classes.get(tag)
        if cls is None:
            if name in _NOT_NODES or " " not in tag:
                message = f"{tag.rpartition(' ')[2]} is no class; the element is ignored"
                self.warn("O010", message, self.here(), "use the name of a class with its prefix")
                frame.kind = _SKIPPED
                return False
            cls = self.classes[tag] = -1 if name == _DESCRIPTION else self.triples.number(name)
        if (value := given.get(_ID)) is not None:
            subject = self._identifier(value, frame.base)
        elif (value := given.get(_ABOUT)) is not None:
            subject = self._resolve(frame.base, value)
        elif (value := given.get(_NODE_ID)) is not None:
            subject = self._named_node(value)
        elif (value := given.get(_RESOURCE)) is not None:
            self.warn("O010", "rdf:resource of an individual is read as rdf:about", self.here(), "write rdf:about")
            subject = self._resolve(frame.base, value)
        else:
            subject = self.triples.fresh()
        frame.subject = subject
        if cls >= 0:
            self.triples.add(subject, self.type, cls, frame.line, frame.column)
        if given and not (len(given) == 1 and _ABOUT in given):
            self._property_attributes(subject, given, frame)
        return True

    def _property(self, frame: _Frame, parent: _Frame, name: str, tag: str, given: dict[str, str]) -> None:
        self.frames.append(frame)
        if name == _LI:
            parent.items += 1
            name = f"{RDF}_{parent.items}"
        elif name in _NOT_PROPERTIES or " " not in tag:
            message = f"{tag.rpartition(' ')[2]} is no property; the element is ignored"
            self.warn("O010", message, self.here(), "use the name of a property with its prefix")
            frame.kind = _SKIPPED
            return
        frame.predicate = self.triples.number(name)
        if name is self.tags.get(tag):
            self.plain[tag] = frame.predicate
        if not given:
            return
        if (value := given.pop(_ID, None)) is not None:
            frame.reified = self._identifier(value, frame.base)
        parse_type, datatype = given.pop(_PARSE_TYPE, None), given.pop(_DATATYPE, None)
        if _ABOUT in given and _RESOURCE not in given:
            self.warn("O010", "rdf:about of a property is read as rdf:resource", self.here(), "write rdf:resource")
            given[_RESOURCE] = given[_ABOUT]
        if parse_type == "Collection":
            frame.kind = _COLLECTION
        elif parse_type == "Resource":
            node = self.triples.fresh()
            self._state(frame, node)
            frame.kind, frame.subject, frame.items = _NODE, node, 0
        elif parse_type is not None:
            frame.kind = _LITERAL
            if parse_type != "Literal":
                self.warn("O010", f"parseType {parse_type!r} is read as Literal", self.here())
        elif (value := given.get(_RESOURCE)) is not None:
            self._fill_empty(frame, self._resolve(frame.base, value), given)
        elif (value := given.get(_NODE_ID)) is not None:
            self._fill_empty(frame, self._named_node(value), given)
        elif any(key not in _SYNTAX for key in given):
            self._fill_empty(frame, self.triples.fresh(), given)
        elif datatype is not None:
            frame.datatype = resolve(frame.base, datatype)

    def _fill_empty(self, frame: _Frame, node: int, given: dict[str, str]) -> None:
        frame.filled = True
        self._state(frame, node)
        self._property_attributes(node, given, frame)

    def _property_attributes(self, subject: int, given: dict[str, str], frame: _Frame) -> None:
        for key, value in given.items():
            if key in _SYNTAX:
                if key in _OUTDATED:
                    name = key.removeprefix(RDF)
                    self.warn("O010", f"rdf:{name} is no longer part of RDF and is ignored", self.here(), "remove it")
                continue
            if key == RDF.type:
                number = self._resolve(frame.base, value)
            else:
                number = self.triples.number(Literal(value, None, frame.language))
            self.triples.add(subject, self.triples.number(key), number, frame.line, frame.column)

    def _state(self, frame: _Frame, value: int, at: int | None = None) -> None:
        """Add the triple of a property, before the row ``at`` if given, and its reification if it has an rdf:ID."""
        triples, line, column = self.triples, frame.line, frame.column
        if at is None:
            triples.add(frame.subject, frame.predicate, value, line, column)
        else:
            triples.insert(at, frame.subject, frame.predicate, value, line, column)
        if frame.reified >= 0:
            row = len(triples) - 1 if at is None else at
            parts = (("subject", frame.subject), ("predicate", frame.predicate), ("object", value))
            terms = [(triples.number(RDF + part), term) for part, term in parts]
            for number, term in ((self.type, triples.number(RDF.Statement)), *terms):
                row += 1
                triples.insert(row, frame.reified, number, term, line, column)

    def _append(self, frame: _Frame, item: _Frame) -> None:
        triples, line, column, before = self.triples, item.line, item.column, frame.last_cell
        cell = triples.fresh()
        if before < 0:
            self._state(frame, cell)
        else:
            triples.add(before, self.rest, cell, line, column)
        triples.add(cell, self.first, item.subject, line, column)
        frame.last_cell = cell

    # names

    def _resolve(self, base: str, reference: str) -> int:
        known = self.resolved.get(base)
        if known is None:
            known = self.resolved[base] = {}
        number = known.get(reference)
        if number is None:
            number = known[reference] = self.triples.number(resolve(base, reference))
        return number

    def _identifier(self, value: str, base: str) -> int:
        span = self.here()
        if not _LEGAL_NAME.fullmatch(value):
            self.warn("O010", f"rdf:ID is no XML name: {value!r}", span, "use rdf:about, which allows any IRI")
        iri = resolve(base, "#" + value)
        earlier = self.ids.setdefault(iri, span)
        if earlier is not span:
            advice = "both are read as the same individual; write rdf:about where you refer to it again"
            self.warn("O011", f"rdf:ID {value!r} is used twice, first in line {earlier.line}", span, advice)
        return self.triples.number(iri)

    def _named_node(self, value: str) -> int:
        return self.triples.number(BNode(f"{self.triples.label}.{value}"))


def _opening_tag(tag: str, attributes: Sequence[str], parent: _Frame) -> str:
    """Write the start tag of an element inside an XML literal again; the outermost one with its namespace."""
    namespace, _, local = tag.rpartition(" ")
    parts = [local, *([f"xmlns={quoteattr(namespace)}"] if namespace and not parent.names else [])]
    pairs = zip(attributes[::2], attributes[1::2], strict=True)
    parts += (f"{key.rpartition(' ')[2]}={quoteattr(value)}" for key, value in pairs)
    return f"<{' '.join(parts)}>"
