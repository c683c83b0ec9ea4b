"""Turtle and its subset N-Triples: pyoxigraph parses, fed line by line, so that each triple gets its line number.

The parser is set to lenient, as published files have IRIs that the Recommendation forbids (with ``@``, for instance).
That also accepts mistakes which should be reported (line breaks in short strings, spaces in IRIs), so a scan of the
text before finds those, and enforces limits against hostile files.
"""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Iterator
from itertools import repeat
from typing import Any

import pyoxigraph
from pyoxigraph import BlankNode, NamedNode, RdfFormat

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.files import decode, offset_of, position_of
from planlang.ontology.terms import PREFIXES, XSD, BNode, Literal
from planlang.ontology.triples import MOST_TRIPLES, Parsed, Triples
from planlang.spelling import guess, similar

DEEPEST = 100
"""Greatest nesting depth of blank nodes and lists."""

LONGEST = 1_000_000
"""Greatest length of a string, IRI or word: the parser starts a token again with each piece, in quadratic time."""

MOST_ERRORS = 20
"""Syntax errors reported of one file."""

_TOKEN = re.compile(
    r'''\\.|"""[^"\\]*+(?:(?:\\.|""?(?!"))[^"\\]*+)*+"""|\'\'\'[^'\\]*+(?:(?:\\.|''?(?!'))[^'\\]*+)*+\'\'\''''
    r"""|"[^"\\\r\n]*+(?:\\.[^"\\\r\n]*+)*+"|'[^'\\\r\n]*+(?:\\.[^'\\\r\n]*+)*+'"""
    r"""|<[^\x00-\x20<>"{}|^`]*+>|#[^\r\n]*+|\[|\]|\(|\)|"|'|<""",
    re.DOTALL,
)
"""Strings, IRIs, comments and brackets. Alternatives begin with different characters, which makes matching fast."""

_WORD = re.compile(r"""[^\s"'<>()\[\],;]++""")

_UNDECLARED = "planlang-undeclared:"
"""Prefix of placeholder namespaces, to which well-known prefixes are bound unless a file declares them."""

_HEAD = "".join(f"@prefix {name}: <{_UNDECLARED}{name}:> . " for name in PREFIXES).encode() + b"\n"
_LINES_BEFORE = 1

_ANONYMOUS = re.compile(r"[0-9a-f]{20,32}")
"""Labels that the parser makes for anonymous blank nodes: random numbers."""

_PROBLEM = re.compile(r"Parser error [^:]*: (.*)", re.DOTALL)
_NO_PREFIX = re.compile(r"The prefix (.*): has not been declared", re.DOTALL)
_OBJECTS = 'an <IRI>, a name prefix:name, _:name, a "string", a number, true, false, [ or (; or a closing ] or )'
_INSIDE, _INSTEAD = "triples inside triples (RDF-star) are not supported", "state this of a blank node instead"
_GRAPHS = {
    "{": "named graphs (TriG) are not read; write the statements without GRAPH, { and }",
    "<": "a statement has three terms and a dot; a fourth is the graph of N-Quads, which are not read: remove it",
}
"""Beginning of what is unexpected in Turtle -> advice where it belongs to another syntax."""
_QUAD = re.compile(r"\s*(?:<[^<>]*>|_:\S+)\s+<[^<>]*>\s+\S.*\s(?:<[^<>]*>|_:\S+)\s*\.\s*")
_EXPECTED = {
    "is not a valid RDF object": _OBJECTS,
    "is not a valid predicate": "'a', an <IRI> or a name prefix:name",
    "is not a valid subject": "an <IRI>, a name prefix:name, a node _:name, [, ( or @prefix",
    "A dot is expected": "'.', ';' or ','",
    "Unexpected end": "'.' behind the last statement",
}
"""Part of a parser's message -> what was expected there."""


def read_turtle(content: bytes | str, file: str, *, base: str, label: str = "b") -> Parsed:
    """Read a file in Turtle or N-Triples. ``base`` is its address unless it has ``@base``.

    ``label`` is the prefix of blank-node labels. The line of a triple is the one in which it ends, or, if its object is
    a nested node, that of the node's first statement; columns are 1. Statements about a nested node precede the triple
    that refers to it. Raises BadInput with all errors, each with line and column.
    """
    reader = _Reader(decode(content, file), file, base, label)
    reader.read()
    if reader.problems:
        raise BadInput(sorted(reader.problems, key=lambda problem: problem.span or Span(file))[:MOST_ERRORS])
    return Parsed(reader.triples, reader.warnings, reader.prefixes)


class _Feed:
    """File object that feeds the parser line by line, but a multi-line string in pieces as large as requested.

    ``line`` is the first line of the piece that was read last; ``long`` are the byte ranges of multi-line strings.
    """

    def __init__(self, content: bytes, long: list[tuple[int, int]]) -> None:
        self._stream = io.BytesIO(content)
        self._long = iter([*long, (sys.maxsize, sys.maxsize)])
        self._begin, self._end = next(self._long)
        self._at = 0
        self._is_behind = False
        self._following = 1 - _LINES_BEFORE
        self.line = 1

    def read(self, size: int) -> bytes:
        left = self._begin - self._at
        if left < 0:
            piece = self._stream.read(min(size, self._end - self._at))
        else:
            if not self._is_behind:  # the rest of the line after a long string keeps the line where that began
                self.line = self._following
            piece = self._stream.readline(size if size < left else left or 1)
            self._is_behind = False
        self._at += len(piece)
        if self._at > self._begin and self._at >= self._end:
            self._begin, self._end = next(self._long)
            self._is_behind = True
        self._following += piece.count(b"\n")
        return piece


class _Reader:
    def __init__(self, text: str, file: str, base: str, label: str) -> None:
        self.triples = Triples(file, label)
        self.problems: list[Diagnostic] = []
        self.warnings: list[Diagnostic] = []
        self.prefixes: dict[str, str] = {}
        self._text = text
        self._file = file
        self._base = base
        self._label = label
        self._bad_lines: set[int] = set()
        self._unknown: set[str] = set()
        self._numbers: dict[str, int] = {}
        """IRI or blank-node label from the parser -> its number; only IRIs contain a colon."""
        self._lines: dict[int, int] = {}
        """Number of an anonymous node -> line of the first statement about it."""

    # the text

    def read(self) -> None:
        """Read the triples and collect errors and warnings."""
        text, long = self._scanned()
        content = _HEAD + text.encode()
        feed = _Feed(content, _in_bytes(text, long, len(_HEAD)))
        parser = pyoxigraph.parse(
            feed,  # type: ignore[arg-type]  # of a file only ``read`` is used
            format=RdfFormat.TURTLE,
            base_iri=self._base,
            lenient=True,
        )
        del text, content
        while len(self.problems) < MOST_ERRORS:
            try:
                self._add_all(parser, feed)
                break
            except SyntaxError as problem:  # the parser continues after the next dot
                self._explain(problem)
            except MemoryError:
                self.problems.append(error("O008", "a word or a comment is too long", Span(self._file, feed.line)))
                break
        declared = parser.prefixes.items()
        self.prefixes = {name: space for name, space in declared if not space.startswith(_UNDECLARED)}

    def _scanned(self) -> tuple[str, list[tuple[int, int]]]:
        """Overwrite what the lenient parser would wrongly accept, and find the ranges of multi-line strings."""
        text, start, depth = self._text, 0, 0
        long: list[tuple[int, int]] = []
        pieces: list[str] = []
        done = 0
        for word in _WORD.finditer(text) if len(max(text.split("\n"), key=len)) > LONGEST else ():
            if word.end() - word.start() > LONGEST:
                message = f"a word of more than {LONGEST:,} characters"
                raise BadInput([error("O008", message, position_of(text, word.start(), self._file))])
        while start >= 0:
            matches, start = _TOKEN.finditer(text, start), -1
            for match in matches:
                token = match[0]
                if token == "[" or token == "(":
                    depth += 1
                    if depth > DEEPEST:
                        message = f"blank nodes or lists are nested more than {DEEPEST} deep"
                        raise BadInput([error("O008", message, position_of(text, match.start(), self._file))])
                elif token == "]" or token == ")":
                    depth -= depth > 0
                elif len(token) > LONGEST and token[0] != "#":
                    message = f"a text or an IRI of more than {LONGEST:,} characters"
                    raise BadInput([error("O008", message, position_of(text, match.start(), self._file))])
                elif token in ('"', "'", "<"):
                    self._refuse(text[match.start() : match.start() + 2], position_of(text, match.start(), self._file))
                    end = text.find("\n", match.end())
                    start = len(text) if end < 0 else end
                    pieces += (text[done : match.start()], "0 .".ljust(start - match.start())[: start - match.start()])
                    done = start
                    if len(self.problems) >= MOST_ERRORS:
                        start = -1
                    break
                elif "\n" in token:
                    long.append(match.span())
        return "".join(pieces) + text[done:] if pieces else text, long

    def _refuse(self, token: str, span: Span) -> None:
        if token == "<<":
            self._error("O020", _INSIDE, span, _INSTEAD)
            return
        if token[0] == "<":
            message = "an <IRI> is not closed, or has a character that IRIs must not have"
            advice = "close it with >; write a space as %20"
        else:
            message = "a string is not closed, or its quotation marks are unexpected here"
            advice = 'close it on the same line, or put a string of several lines between """ and """'
        self._error("O020", message, span, advice)

    def _error(self, code: str, message: str, span: Span, advice: str | None = None) -> None:
        """Record an error unless its line has one already: further ones are mostly its consequences."""
        if span.line not in self._bad_lines:
            self._bad_lines.add(span.line)
            self.problems.append(error(code, message, span, advice))

    def _explain(self, problem: SyntaxError) -> None:
        text = self._text
        line, column = (problem.lineno or 1) - _LINES_BEFORE, problem.offset or 1
        words = _PROBLEM.fullmatch(problem.msg)
        reason = words[1] if words else problem.msg
        if reason.startswith("Unexpected end"):
            blank = re.compile(r"(?:\s|^[ \t]*#[^\n]*)*\Z", re.MULTILINE).search(text)
            span, found = position_of(text, blank.start() if blank else len(text), self._file), "the end of the file"
        else:
            span = Span(self._file, max(line, 1), column)
            offset = offset_of(text, span)
            word = re.compile(r"\S+").match(text, offset)
            found = word[0][:40] if word else "this"
        if unknown := _NO_PREFIX.fullmatch(reason):
            self._unknown_prefix(unknown[1], found, span)
            return
        expected = next((tokens for part, tokens in _EXPECTED.items() if part in reason), None)
        if expected is not None:
            other = "{" if "{" in found or found.upper() == "GRAPH" else found[:1]
            if other in _GRAPHS and (other == "{" or _QUAD.fullmatch(text.split("\n")[span.line - 1])):
                self._error("O020", f"unexpected {found}", span, _GRAPHS[other])
                return
            guessed = guess(found, {"@prefix", "@base"} - {found}, least=0.75)
            self._error("O020", f"unexpected {found}", span, f"{guessed}expected: {expected}")
        elif "scape" in reason:
            advice = r"write \\ for a backslash in a string; an IRI allows only \uXXXX and \UXXXXXXXX"
            self._error("O020", f"invalid escape sequence: {reason}", span, advice)
        else:
            self._error("O020", f"{reason[:1].lower()}{reason[1:]}", span)

    def _unknown_prefix(self, prefix: str, found: str, span: Span) -> None:
        if prefix not in self._unknown:
            self._unknown.add(prefix)
            alike = similar(prefix, (*self.prefixes, *PREFIXES))
            guessed = f"did you mean {alike[0]}:? " if alike else ""
            advice = f"{guessed}declare it: @prefix {prefix}: <http://...#> ."
            self._error("O021", f"unknown prefix {prefix}: in {found}", span, advice)

    # triples

    def _add_all(self, parser: Iterator[Any], feed: _Feed) -> None:
        """Add the triples up to the next syntax error, which is raised as SyntaxError."""
        numbers, lines = self._numbers, self._lines
        add_subject, add_predicate = self.triples.subjects.append, self.triples.predicates.append
        add_object, add_line = self.triples.objects.append, self.triples.lines.append
        left = MOST_TRIPLES - len(self.triples)
        for quad in parser:  # attributes are converted on access; unpacking would convert the unused graph name, too
            line = feed.line
            left -= 1
            if left < 0:
                span = Span(self._file, line)
                self.problems.append(error("O003", f"the file has more than {MOST_TRIPLES:,} triples", span))
                break
            node = quad.subject
            name = node.value
            first = numbers.get(name, -1)
            if first < 0:
                first = self._number(node, line)
            name = quad.predicate.value
            second = numbers.get(name, -1)
            if second < 0:
                second = self._iri(name, line)
            value = quad.object
            kind = type(value)
            if kind is pyoxigraph.Literal:
                third = self._value(value, line)
            elif kind is NamedNode or kind is BlankNode:
                name = value.value
                third = numbers.get(name, -1)
                if third < 0:
                    third = self._number(value, line)
                line = lines.get(third, line)
            else:
                self._error("O020", _INSIDE, Span(self._file, line), _INSTEAD)
                continue
            add_subject(first)
            add_predicate(second)
            add_object(third)
            add_line(line)
        self.triples.columns.extend(repeat(1, len(self.triples) - len(self.triples.columns)))

    def _iri(self, name: str, line: int) -> int:
        """Add an IRI that occurs for the first time and return its number."""
        iri = name
        if name.startswith(_UNDECLARED):
            prefix, _, local = name.removeprefix(_UNDECLARED).partition(":")
            standard = PREFIXES[prefix]
            iri = standard + local
            if prefix not in self._unknown:
                self._unknown.add(prefix)
                message = f"unknown prefix {prefix}: in {prefix}:{local} is read as {standard}"
                advice = f"declare it: @prefix {prefix}: <{standard}> ."
                self.warnings.append(warning("O021", message, Span(self._file, line), advice))
        self._check(iri, line)
        number = self._numbers[name] = self.triples.number(iri)
        return number

    def _number(self, node: NamedNode | BlankNode, line: int) -> int:
        """Add an IRI or a blank node that occurs for the first time and return its number."""
        if isinstance(node, NamedNode):
            return self._iri(node.value, line)
        label = node.value
        if _ANONYMOUS.fullmatch(label):
            number = self.triples.fresh()
            self._lines[number] = line
        else:
            number = self.triples.number(BNode(f"{self._label}.{label}"))
        self._numbers[label] = number
        return number

    def _value(self, value: pyoxigraph.Literal, line: int) -> int:
        text, language, datatype = value.value, value.language, value.datatype.value
        self._check(text, line)
        if language is not None:
            return self.triples.number(Literal(text, None, language.lower()))
        if datatype == XSD.string:
            return self.triples.number(Literal(text))
        if datatype.startswith(_UNDECLARED):
            datatype = str(self.triples.term(self._iri(datatype, line)))
        return self.triples.number(Literal(text, datatype))

    def _check(self, text: str, line: int) -> None:
        if "\0" in text:
            message = "the null character is not allowed in strings and IRIs"
            self._error("O020", message, Span(self._file, line), r"remove \u0000")


def _in_bytes(text: str, spans: list[tuple[int, int]], shift: int) -> list[tuple[int, int]]:
    """Convert ranges of characters to ranges of bytes in UTF-8, shifted by ``shift`` bytes."""
    ranges: list[tuple[int, int]] = []
    done, at = 0, shift
    for begin, end in spans:
        start = at + len(text[done:begin].encode())
        done, at = end, start + len(text[begin:end].encode())
        ranges.append((start, at))
    return ranges
