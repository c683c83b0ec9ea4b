"""Functional-style syntax of OWL 2: names, values and elements of parsed text, and its messages."""

from __future__ import annotations

import re
from typing import Any

from lark import Token, UnexpectedInput

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.files import decode, position_of
from planlang.ontology.axioms import DEEPEST, unquoted
from planlang.ontology.expressions import Expression
from planlang.ontology.parsing import Grammar, unexpected, where
from planlang.ontology.structures import DOCUMENT, MOST_ERRORS, Names, Structures
from planlang.ontology.terms import RDF, XSD, Literal, Term
from planlang.ontology.triples import Parsed

_SPOKEN = {
    "NAME": "a name prefix:name",
    "FULL_IRI": "an <IRI>",
    "NODE": "a node _:name",
    "STRING": 'a "string"',
    "NUMBER": "a number",
    "OPEN": "a word with its parenthesis, such as SubClassOf(",
    "ONTOLOGY": "Ontology(",
    "_PREFIX": "Prefix(",
    "END": "')'",
    "PREFIX_NAME": "a prefix with its colon",
    "LANGUAGE": "a @language",
    "$END": "the end of the file",
}
"""Names of the grammar's terminals in messages."""

_START = re.compile(rf"^[ \t]*(?:{'|'.join(sorted(DOCUMENT))}|Prefix|Ontology|Annotation)[ \t]*\(", re.MULTILINE)
"""Where reading continues behind an error: a word of the document at the start of a line."""
_PREFIXED_TEXT = re.compile(r"(.*)@([A-Za-z0-9-]*)", re.DOTALL)
"""Value of an rdf:PlainLiteral, which contains its language."""


def read_functional(content: bytes | str, file: str, *, base: str, label: str = "b") -> Parsed:
    """Read a file in functional syntax. ``base`` is its address unless ``Ontology(`` has an IRI.

    ``label`` is the prefix of blank-node labels. Raises BadInput with all errors, each with its position.
    """
    text = decode(content, file)
    reader = _Reader(text, file, base, label)
    reader.read()
    return Parsed(reader.structures.out.triples, reader.structures.warnings, reader.names.prefixes)


class _Reader:
    """Callbacks of the grammar's rules."""

    def __init__(self, text: str, file: str, base: str, label: str) -> None:
        self.names = Names.of(base, "Prefix({}:=<{}>)")
        self.structures = Structures(file, label, self.names, lambda word, parts: f"{word}({' '.join(parts)})")
        self._text = text
        self._file = file
        self._head: Span | None = None
        self._is_closed = False
        self._depth = 0

    def read(self) -> None:
        """Parse the text, and continue behind syntax errors. Raises BadInput if there were any."""
        rest: str | None = self._text
        try:
            while rest is not None:
                rest = self._parse(rest)
        except BadInput as problem:
            found = [one for one in problem.diagnostics if one not in self.structures.problems]
            self.structures.problems += found
        problems = self.structures.problems
        if not problems and self._head is None:
            start = position_of(self._text, len(self._text) - len(self._text.lstrip()), self._file)
            problems.append(error("O020", "the file has no Ontology(", start, "put the axioms into Ontology( ... )"))
        elif not problems and not self._is_closed:
            advice = "the file seems to be truncated; get it again, or add ) at its end"
            problems.append(error("O020", "the file ends before Ontology( is closed", self._head, advice))
        if problems:
            raise BadInput(sorted(problems, key=lambda one: one.span or Span(self._file))[:MOST_ERRORS])

    def _parse(self, text: str) -> str | None:
        """Parse up to the first syntax error, and return the text with everything before the next axiom made blank."""
        self._depth = 0
        try:
            GRAMMAR.parse(text, self)
            return None
        except UnexpectedInput as problem:
            offset = where(problem, text)
            self.structures.report(self._explain(problem, text, offset))
        following = _START.search(text, offset + 1)
        if following is None:
            return None
        return re.sub(r"[^\n]", " ", text[: following.start()]) + text[following.start() :]

    def _explain(self, problem: UnexpectedInput, text: str, offset: int) -> Diagnostic:
        message, _, spoken = unexpected(problem, GRAMMAR, _SPOKEN, text, offset)
        span = position_of(text, offset, self._file)
        if spoken == [_SPOKEN["$END"]]:
            advice = "remove a ), or the text that follows; a file has one ontology"
            return error("O020", f"{message} behind the end of the ontology", span, advice)
        expected = ", ".join(spoken[:-1]) + (" or " if len(spoken) > 1 else "") + spoken[-1] if spoken else "nothing"
        return error("O020", message, span, f"expected: {expected}")

    def _span(self, token: Token) -> Span:
        return Span(self._file, token.line or 1, token.column or 1)

    # called by the lexer

    def count(self, token: Token) -> Token:
        """Count an element that begins. Raises BadInput if it is nested too deep."""
        self._depth += 1
        if self._depth > DEEPEST:
            message = f"expressions or annotations are nested more than {DEEPEST} deep"
            raise BadInput([error("O008", message, self._span(token))])
        return token

    # names and values

    def _value(self, token: Token, term: Term) -> Expression:
        return Expression("name", self._span(token), term)

    def iri(self, children: list[Token]) -> Expression:
        (token,) = children
        if token.startswith("<"):
            return self._value(token, self.names.full(token[1:-1]))
        return self.structures.name(token, self._span(token))

    def node(self, children: list[Token]) -> Expression:
        return self._value(children[0], self.structures.out.named_node(children[0][2:]))

    def number(self, children: list[Token]) -> Expression:
        return self._value(children[0], Literal(str(children[0]), XSD.nonNegativeInteger))

    def plain_literal(self, children: list[Token]) -> Expression:
        return self._value(children[0], Literal(unquoted(children[0])))

    def language_literal(self, children: list[Token]) -> Expression:
        return self._value(children[0], Literal(unquoted(children[0]), None, str(children[1])[1:].lower()))

    def typed_literal(self, children: list[Any]) -> Expression:
        token, datatype = children
        if not isinstance(datatype.term, str):
            return datatype  # type: ignore[no-any-return]
        return self._value(token, literal_of(unquoted(token), datatype.term))

    # the document

    def prefix(self, children: list[Token]) -> None:
        name, iri = children
        self.names.prefixes[name[:-1]] = self.names.full(iri[1:-1])

    def head(self, children: list[Any]) -> None:
        token, *names = children
        self._head = self._span(token)
        iri, version = (*(one.term for one in names), None, None)[:2]
        if isinstance(iri, str):
            self.names.base = iri
        self.structures.begin(iri, version, names[0].span if names else self._head)

    def element(self, children: list[Any]) -> Any:
        token, *parts, _ = children
        self._depth -= 1
        return self.structures.close(token[:-1].rstrip(), parts, self._span(token))

    def part(self, children: list[Any]) -> None:
        found = children[0]
        self.structures.add(found, getattr(found, "span", None) or Span(self._file))

    def end(self, children: list[Token]) -> None:
        self._is_closed = True

    def start(self, children: list[Any]) -> None:
        """Do nothing: the parts of the rule have stated everything."""


def literal_of(text: str, datatype: str) -> Literal:
    """Literal of a datatype; an ``rdf:PlainLiteral`` states its language in its text."""
    if datatype == RDF.PlainLiteral:
        found = _PREFIXED_TEXT.fullmatch(text)
        return Literal(found[1], None, found[2].lower() or None) if found else Literal(text)
    return Literal(text, datatype)


GRAMMAR = Grammar("functional", _Reader, ("OPEN",))
