"""Convert the bytes of a file to text: encodings, bounds of entities, positions, the meaning of expat's errors."""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Sequence
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.ontology.terms import OWL

LARGEST_EXPANSION = 10_000_000
"""Characters that all references of a file may expand to together, if the file itself is not longer."""

LARGEST_FACTOR = 100
"""The same in multiples of the file's length."""

_REFERENCE = re.compile(r"&([^;&\s#]+);")


class EntityTable:
    """The entities that a file declares. Invariant: ``_lengths`` is the length after full expansion, capped.

    XML wants an entity to be declared before the entities that refer to it are used, not before they are declared, so
    lengths are computed when the document type is complete.
    """

    def __init__(self, text: str, file: str, here: Callable[[], Span]) -> None:
        self._text = text
        self._file = file
        self._here = here
        self._values: dict[str, tuple[str, Span]] = {}
        self._lengths: dict[str, int] = {"amp": 1, "lt": 1, "gt": 1, "apos": 1, "quot": 1}

    @property
    def limit(self) -> int:
        """Characters that the references may expand to; a short file may use a few declared prefixes freely."""
        return min(max(LARGEST_EXPANSION, len(self._text)), LARGEST_FACTOR * len(self._text))

    @property
    def names(self) -> frozenset[str]:
        """Return the entities that may be referred to: declared entities and those of XML itself."""
        return frozenset(self._values) | frozenset(("amp", "lt", "gt", "apos", "quot"))

    def begin(self, name: str, system: str | None, public: str | None, internal: bool) -> None:
        """Refuse a document type in another file; called by expat."""
        if system or public:
            advice = "declare the entities in the file itself"
            raise BadInput([error("O009", f"an external document type is refused: {system}", self._here(), advice)])

    def declare(
        self, name: str, is_parameter: bool, value: str | None, base: str | None, system: str | None, *_: object
    ) -> None:
        """Note an entity; of two declarations the first counts, as XML has it; called by expat."""
        if is_parameter:
            raise BadInput([error("O009", f"a parameter entity is refused: %{name};", self._here())])
        if value is None:
            advice = "write its value into the file"
            raise BadInput([error("O009", f"an external entity is refused: &{name}; {system}", self._here(), advice)])
        self._values.setdefault(name, (value, self._here()))

    def skip(self, name: str, is_parameter: bool) -> None:
        """Refuse an entity that is not in the file; called by expat."""
        raise BadInput([error("O009", f"an entity that is not in the file is refused: &{name};", self._here())])

    def check(self) -> None:
        """Raise BadInput if the references of the file expand to more than the limit, or into themselves."""
        for name in self._values:
            self._measure(name)
        total, limit, lengths = 0, self.limit, self._lengths
        if self._text.count("&") * max(lengths.values()) <= limit:
            return
        for match in _REFERENCE.finditer(self._text):  # those between declarations count too: a little too much
            total += lengths.get(match[1], 0)
            if total > limit:
                before = match.start()
                line = self._text.count("\n", 0, before) + 1
                span = Span(self._file, line, before - self._text.rfind("\n", 0, before))
                raise BadInput([_too_much(match[1], limit, span)])

    def _measure(self, root: str) -> None:
        """Compute the lengths of an entity and of those it refers to, the innermost first, without recursion."""
        if root in self._lengths:
            return
        open_names = {root: iter(self._references(root))}
        while open_names:
            name = next(reversed(open_names))
            other = next((other for other in open_names[name] if other not in self._lengths), None)
            if other is None:
                del open_names[name]
                self._close(name)
            elif other in open_names:
                names = list(open_names)
                circle = " in ".join((*names[names.index(other) :], other))
                raise BadInput([error("O008", f"an entity contains itself: {circle[:200]}", self._values[name][1])])
            else:
                open_names[other] = iter(self._references(other))

    def _references(self, name: str) -> list[str]:
        return _REFERENCE.findall(self._values[name][0]) if name in self._values else []

    def _close(self, name: str) -> None:
        """Note the length of an entity whose references are all known; nothing is the length of an undeclared one."""
        value, span = self._values.get(name, ("", Span(self._file)))
        length = len(value) + sum(self._lengths[other] for other in self._references(name))
        if length > self.limit:
            raise BadInput([_too_much(name, self.limit, span)])
        self._lengths[name] = length


def _too_much(name: str, limit: int, span: Span) -> Diagnostic:
    return error("O008", f"entity &{name}; makes the file expand to more than {limit:,} characters", span)


LARGEST_FILE = 64_000_000
"""Bytes: room for 100,000 orderings in RDF/XML; the largest ontology of its kind that is in use has 0.7 MB."""

_DECLARATION = re.compile(rb"<\?xml[^>]*?encoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")
_SOMETHING = re.compile(rb"[^ \t\r\n\xef\xbb\xbf\xff\xfe\x00]")
_ENCODINGS = ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "ascii", "iso8859-1", "iso8859-15", "cp1252")


def decode(content: bytes | str, file: str) -> str:
    """Return the text of an XML or Manchester file, line ends unchanged. Raises BadInput if it cannot be decoded.

    The encoding is told by a byte order mark, else by the XML declaration, else it is UTF-8.
    """
    if isinstance(content, str):
        return content
    if len(content) > LARGEST_FILE:
        raise BadInput([error("O003", f"the file is larger than {LARGEST_FILE // 1_000_000} MB", Span(file))])
    if not _SOMETHING.search(content):
        raise BadInput([error("O002", "the file is empty", Span(file))])
    name = "utf-8-sig"
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        name = "utf-16"
    elif match := _DECLARATION.match(content):
        name = match[1].decode("ascii")
    try:
        codec = codecs.lookup(name).name
        if codec not in (*_ENCODINGS, "utf-8-sig"):
            raise LookupError(name)
    except LookupError:
        advice = "save the file as UTF-8"
        raise BadInput([error("O004", f"unknown encoding {name!r}", Span(file), advice)]) from None
    try:
        text = content.decode("utf-8-sig" if codec == "utf-8" else codec)
    except UnicodeDecodeError as problem:
        before = content[: problem.start]
        line = before.count(b"\n") + 1
        column = len(before[before.rfind(b"\n") + 1 :].decode(codec, errors="replace")) + 1
        message = f"this is not {name.removesuffix('-sig').upper()} text: {problem.reason}"
        raise BadInput([error("O004", message, Span(file, line, column), "save the file as UTF-8")]) from None
    if (position := text.find("\x00")) >= 0:
        raise BadInput([error("O004", "this is a binary file", position_of(text, position, file))])
    return text


def position_of(text: str, offset: int, file: str) -> Span:
    """Return the position of a character."""
    line = text.count("\n", 0, offset) + 1
    return Span(file, line, offset - text.rfind("\n", 0, offset))


def offset_of(text: str, span: Span) -> int:
    """Return the offset of a position, at most the length of the text."""
    offset = 0
    for _ in range(span.line - 1):
        offset = text.find("\n", offset) + 1
        if offset == 0:
            return len(text)
    return min(offset + span.column - 1, len(text))


def explain(
    problem: expat.ExpatError, text: str, file: str, open_lines: Sequence[int], entities: frozenset[str]
) -> Diagnostic:
    """Return the diagnostic that explains an expat error.

    ``open_lines`` are where the open elements begin, the innermost last; ``entities`` what may be referred to.
    """
    span = Span(file, problem.lineno, problem.offset + 1)
    reason = expat.ErrorString(problem.code) or "not well-formed"
    advice = None
    if reason == "undefined entity":
        start = offset_of(text, span)
        match = next((m for m in re.finditer(r"&([\w.:-]+);", text[start:]) if m[1] not in entities), None)
        if match:
            span = position_of(text, start + match.start(), file)
            reason = f"undefined entity &{match[1]};"
            advice = f'declare it in the DOCTYPE: <!ENTITY {match[1]} "http://...#">'
    elif reason == "unbound prefix":
        advice = 'declare the prefix in the first element: xmlns:prefix="http://...#"'
    elif reason in ("no element found", "unclosed token", "unclosed CDATA section"):
        if open_lines:
            reason = f"the file ends too early, {len(open_lines)} elements are not closed"
        advice = "the file seems to be cut off"
    elif reason.startswith("mismatched tag") and open_lines:
        advice = f"the innermost open element begins in line {open_lines[-1]}"
    return error("O005", f"this is not XML: {reason}", span, advice)


def must_be_rdf(tag: str, span: Span) -> None:
    """Raise BadInput if the first element of a file, as expat names it, is that of another language."""
    namespace, _, local = tag.rpartition(" ")
    if tag.replace(" ", "") == OWL.Ontology:
        message, advice = "this is OWL/XML, another syntax", "save it as RDF/XML or in Manchester syntax"
    elif not namespace or namespace == "http://www.w3.org/1999/xhtml":
        message = f"this is XML, but not RDF: its first element is {local}"
        advice = "an ontology begins with rdf:RDF or in Manchester syntax"
    else:
        return
    raise BadInput([error("O001", message, span, advice)])


def opening_tag(tag: str, attributes: Sequence[str], *, is_outermost: bool) -> str:
    """Write an element inside a value again that is XML; the outermost one with its namespace."""
    namespace, _, local = tag.rpartition(" ")
    parts = [local, *([f"xmlns={quoteattr(namespace)}"] if is_outermost and namespace else [])]
    pairs = zip(attributes[::2], attributes[1::2], strict=True)
    parts += (f"{key.rpartition(' ')[2]}={quoteattr(value)}" for key, value in pairs)
    return f"<{' '.join(parts)}>"
