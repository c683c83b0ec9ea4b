"""Turtle and N-Triples, which is a part of it: the parser, and the triples that each statement makes."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any

from lark import Lark, Token, Transformer, UnexpectedInput

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.ontology.iris import resolve
from planlang.ontology.parsed import MOST_TRIPLES, Parsed
from planlang.ontology.syntax_errors import explain, where
from planlang.ontology.terms import FIRST, NIL, PREFIXES, REST, TYPE, XSD, BNode, Literal, Term, Triple
from planlang.ontology.triples import Triples
from planlang.ontology.xml_text import decode, offset_of

DEEPEST = 100
"""Nameless nodes and lists inside each other."""

MOST_ERRORS = 20
"""Syntax errors reported of one file."""

_STATEMENT_END = re.compile(r"\.[ \t]*(?:#[^\r\n]*)?(?:\r?\n|\r)")
_ESCAPE = re.compile(r"\\(?:u([0-9A-Fa-f]{4})|U([0-9A-Fa-f]{8})|(.))", re.DOTALL)
_CHARACTERS = {"t": "\t", "b": "\b", "n": "\n", "r": "\r", "f": "\f", '"': '"', "'": "'", "\\": "\\"}
_DOUBLE = re.compile(r"[eE]")


def read_turtle(content: bytes | str, file: str, *, base: str, label: str = "b") -> Parsed:
    """The triples of a file in Turtle or N-Triples. ``base`` is its address unless it says ``@base``.

    ``label`` begins the labels of nameless nodes. A triple stands where its object is written, one with rdf:type where
    its subject is. Raises BadInput with all errors found, each with its position and with what was expected there.
    """
    text = decode(content, file)
    statements = _Statements(file, base, label)
    problems = statements.problems
    rest: str | None = text
    while rest is not None:
        rest = _parse(rest, file, statements, problems)
    if problems:
        problems.sort(key=lambda problem: problem.span or Span(file))
        raise BadInput(problems[:MOST_ERRORS])
    return Parsed(statements.triples, statements.warnings, statements.prefixes)


class _Relay(Transformer[Token, None]):
    """Stands in the parser for the file that is parsed now: building a parser takes longer than reading a file.

    ``busy`` is held while ``target`` is set.
    """

    def __init__(self) -> None:
        super().__init__()
        self.target: _Statements | None = None
        self.busy = Lock()

    def __getattr__(self, rule: str) -> Callable[[list[Any]], Any]:
        if rule.startswith("__") or not hasattr(_Statements, rule):
            raise AttributeError(rule)
        return lambda children: getattr(self.target, rule)(children)

    def opened(self, token: Token) -> Token:
        """Called by the lexer for each bracket, before the parser keeps it."""
        assert self.target is not None
        self.target.opened(token)
        return token


@cache
def _parser() -> tuple[Lark, _Relay]:
    relay = _Relay()
    brackets = dict.fromkeys(("LSQB", "RSQB", "LPAR", "RPAR"), relay.opened)
    grammar = str(Path(__file__).parent / "turtle.lark")
    return Lark.open(grammar, parser="lalr", lexer="contextual", transformer=relay, lexer_callbacks=brackets), relay


def _parse(text: str, file: str, statements: _Statements, problems: list[Diagnostic]) -> str | None:
    """Parse up to the first mistake. Returns what to go on with: what follows it, lines kept; None at the end."""
    parser, relay = _parser()
    with relay.busy:
        relay.target = statements
        statements.depth = 0
        try:
            parser.parse(text)
            return None
        except BadInput as problem:
            problems.extend(problem.diagnostics)
            if any(found.code in ("O003", "O008") for found in problem.diagnostics):
                return None
            span = problem.diagnostics[0].span
            offset = len(text) if span is None else offset_of(text, span)
        except UnexpectedInput as problem:
            offset = where(problem, text)
            problems.append(explain(problem, parser, text, offset, file, words=("@prefix", "@base")))
        finally:
            relay.target = None
    following = _STATEMENT_END.search(text, offset)
    if following is None or len(problems) >= MOST_ERRORS or not text[following.end() :].strip():
        return None
    return re.sub(r"[^\r\n]", " ", text[: following.end()]) + text[following.end() :]


@dataclass(slots=True)
class _Value:
    """A term, where it stands, and what is said about it there."""

    term: Term
    span: Span
    said: list[Triple] = field(default_factory=list)


class _Statements:
    """What each rule of the grammar means, called while the text is parsed."""

    def __init__(self, file: str, base: str, label: str) -> None:
        self.triples = Triples(file, label)
        self.prefixes: dict[str, str] = {}
        self.problems: list[Diagnostic] = []
        self.warnings: list[Diagnostic] = []
        self.depth = 0
        self._file = file
        self._base_iri = base
        self._label = label
        self._known: dict[str, str] = {}
        self._unknown: set[str] = set()

    def opened(self, token: Token) -> None:
        self.depth += 1 if token in "[(" else -1
        if self.depth > DEEPEST:
            message = f"more than {DEEPEST} nameless nodes or lists inside each other"
            raise BadInput([error("O008", message, self._span(token))])

    def _span(self, token: Token) -> Span:
        return Span(self._file, token.line or 1, token.column or 1)

    def _fresh(self) -> BNode:
        node = self.triples.term(self.triples.fresh())
        assert isinstance(node, BNode)
        return node

    # directives

    def prefix(self, children: list[Token]) -> None:
        name, iri = children[-2:]
        self.prefixes[str(name)[:-1]] = resolve(self._base_iri, self._unescaped(iri, iri[1:-1]))
        self._known.clear()

    def base(self, children: list[Token]) -> None:
        self._base_iri = resolve(self._base_iri, self._unescaped(children[-1], children[-1][1:-1]))
        self._known.clear()

    sparql_prefix, sparql_base = prefix, base

    # statements

    def start(self, children: list[Any]) -> None:
        """Everything has been stated by then."""

    def triple_statement(self, children: list[Any]) -> None:
        said: list[Triple] = []
        self._state(children[0], children[1] if len(children) > 1 else [], said)
        for triple in said:
            self.triples.state(triple.subject, triple.predicate, triple.object, triple.span)
        if len(self.triples) > MOST_TRIPLES:
            raise BadInput([error("O003", f"the file has more than {MOST_TRIPLES:,} triples", children[0].span)])

    def _state(self, subject: _Value, statements: list[Any], triples: list[Triple]) -> None:
        triples += subject.said
        assert not isinstance(subject.term, Literal)
        for verb, values in zip(statements[::2], statements[1::2], strict=True):
            for value in values:
                span = subject.span if verb == TYPE else value.span
                triples.append(Triple(subject.term, verb, value.term, span))
                triples += value.said

    def statements(self, children: list[Any]) -> list[Any]:
        return children

    objects = statements

    def verb(self, children: list[Any]) -> str:
        return str(children[0].term)

    def rdf_type(self, children: list[Any]) -> str:
        return TYPE

    def blank_node_property_list(self, children: list[Any]) -> _Value:
        value = _Value(self._fresh(), self._span(children[0]))
        self._state(_Value(value.term, value.span), children[1] if len(children) == 3 else [], value.said)
        return value

    def collection(self, children: list[Any]) -> _Value:
        items: list[_Value] = children[1:-1]
        value = _Value(self._fresh() if items else NIL, self._span(children[0]))
        cell = value.term
        for index, item in enumerate(items):
            assert isinstance(cell, BNode)
            following = self._fresh() if index + 1 < len(items) else NIL
            value.said.append(Triple(cell, FIRST, item.term, item.span))
            value.said += item.said
            value.said.append(Triple(cell, REST, following, item.span))
            cell = following
        return value

    # terms

    def full_iri(self, children: list[Token]) -> _Value:
        token = children[0]
        known = self._known.get(token)
        if known is None:
            known = self._known[str(token)] = resolve(self._base_iri, self._unescaped(token, token[1:-1]))
        return _Value(known, self._span(token))

    def prefixed_name(self, children: list[Token]) -> _Value:
        token = children[0]
        known = self._known.get(token)
        if known is None:
            prefix, _, local = token.partition(":")
            local = re.sub(r"\\(.)", r"\1", local)
            known = self._known[str(token)] = self._namespace(prefix, token) + local
        return _Value(known, self._span(token))

    def _namespace(self, prefix: str, token: Token) -> str:
        if (namespace := self.prefixes.get(prefix)) is not None:
            return namespace
        standard = PREFIXES.get(prefix)
        if prefix not in self._unknown:
            self._unknown.add(prefix)
            message, span = f"unknown prefix {prefix}: in {token}", self._span(token)
            advice = f"declare it: @prefix {prefix}: <{standard or 'http://...#'}> ."
            if standard:
                self.warnings.append(warning("O021", f"{message} is read as {standard}", span, advice))
            else:
                similar = get_close_matches(prefix, self.prefixes, n=1)
                guess = f"did you mean {similar[0]}:? " if similar else ""
                self.problems.append(error("O021", message, span, guess + advice))
        return standard or self._base_iri.partition("#")[0] + "#"

    def node(self, children: list[Token]) -> _Value:
        return _Value(BNode(f"{self._label}.{children[0][2:]}"), self._span(children[0]))

    def plain_literal(self, children: list[Any]) -> _Value:
        return self._literal(children[0])

    def language_literal(self, children: list[Any]) -> _Value:
        return self._literal(children[0], language=str(children[1])[1:].lower())

    def typed_literal(self, children: list[Any]) -> _Value:
        return self._literal(children[0], datatype=str(children[1].term))

    def _literal(self, token: Token, datatype: str | None = None, language: str | None = None) -> _Value:
        quotes = 3 if token[:3] in ('"""', "'''") else 1
        return _Value(Literal(self._unescaped(token, token[quotes:-quotes]), datatype, language), self._span(token))

    def number_literal(self, children: list[Token]) -> _Value:
        text = str(children[0])
        kind = "double" if _DOUBLE.search(text) else "decimal" if "." in text else "integer"
        return _Value(Literal(text, XSD + kind), self._span(children[0]))

    def boolean_literal(self, children: list[Token]) -> _Value:
        return _Value(Literal(str(children[0]), XSD + "boolean"), self._span(children[0]))

    def _unescaped(self, token: Token, text: str) -> str:
        """The characters of an IRI or a text. Raises BadInput for an escape that Turtle does not have."""
        if "\\" not in text:
            return text
        is_iri = token.startswith("<")

        def character(match: re.Match[str]) -> str:
            short, long, single = match.groups()
            number = int(short or long or "0", 16)
            if single is None and number < 0x110000 and not 0xD800 <= number < 0xE000 and number:
                return chr(number)
            if single in _CHARACTERS and not is_iri:
                return _CHARACTERS[single]
            advice = r"write \\ for a backslash" if not is_iri else r"an IRI has only \uXXXX and \UXXXXXXXX"
            raise BadInput([error("O020", f"there is no escape {match[0]!r:.20}", self._span(token), advice)])

        return _ESCAPE.sub(character, text)
