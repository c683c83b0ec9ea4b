"""Parsers of lark's grammars: built once, with their tables cached on disk, and the places of their errors."""

from __future__ import annotations

import marshal
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any

from lark import Lark, Token, Transformer, UnexpectedInput, UnexpectedToken
from lark import __version__ as lark_version
from lark.grammar import Rule
from lark.lexer import PatternStr, TerminalDef

from planlang.cache import Cache

_CACHE = Cache("parser", most=8)
_WORD = re.compile(r'"|\S+')


class _Relay(Transformer[Token, None]):
    """Forwards the parser's callbacks to the reader of the current file, so that all files share one parser.

    Building a parser takes longer than parsing a file. ``busy`` is held while ``reader`` is set.
    """

    def __init__(self, known: type) -> None:
        super().__init__()
        self._known = known
        self.reader: Any = None
        self.busy = Lock()

    def __getattr__(self, rule: str) -> Callable[[list[Any]], Any]:
        if rule.startswith("_") or not hasattr(self._known, rule):
            raise AttributeError(rule)
        return lambda children: getattr(self.reader, rule)(children)

    def count(self, token: Token) -> Token:
        """Let the reader count a token (callback of the lexer)."""
        counted: Token = self.reader.count(token)
        return counted


class Grammar:
    """Grammar in the file ``name.lark``, whose rules are methods of ``reader``.

    ``count`` of the reader is called with each token of the terminals in ``counted``.
    """

    def __init__(self, name: str, reader: type, counted: Iterable[str]) -> None:
        self._name = name
        self._reader = reader
        self._counted = tuple(counted)

    def parse(self, text: str, reader: object) -> None:
        """Parse a text; ``reader`` gets the callbacks. Raises UnexpectedInput, and what the callbacks raise."""
        parser, relay = self._built
        with relay.busy:
            relay.reader = reader
            try:
                parser.parse(text)
            finally:
                relay.reader = None

    def terminal(self, name: str) -> str | None:
        """Text of a terminal; None for one that is a pattern."""
        pattern = None if name == "$END" else self._built[0].get_terminal(name).pattern
        return pattern.value if isinstance(pattern, PatternStr) else None

    @cached_property
    def _built(self) -> tuple[Lark, _Relay]:
        """Build the parser and its relay. The LALR tables are cached, as making them takes longer than parsing.

        They are stored with ``marshal``, which unlike ``pickle`` runs no code when it loads.
        """
        relay = _Relay(self._reader)
        own: dict[str, Any] = {"transformer": relay, "lexer_callbacks": dict.fromkeys(self._counted, relay.count)}
        grammar = (Path(__file__).parent / f"{self._name}.lark").read_text(encoding="utf-8")
        key = f"{lark_version} {sys.implementation.cache_tag} {grammar}"
        kept = _CACHE.load(key)
        if kept is not None:
            return Lark.__new__(Lark)._load(marshal.loads(kept), **own), relay
        made = Lark(grammar, parser="lalr", lexer="contextual", **own)
        data, memo = made.memo_serialize([TerminalDef, Rule])
        data["options"] = {name: value for name, value in data["options"].items() if name not in own}
        _CACHE.keep(key, marshal.dumps({"data": data, "memo": memo}))
        return made, relay


def where(problem: UnexpectedInput, text: str) -> int:
    """Find the offset of a syntax error; at the end of the file, the end of its last word."""
    if not _is_at_end(problem):
        return problem.pos_in_stream if problem.pos_in_stream is not None else len(text)
    lines = text.split("\n")
    while lines and (not lines[-1].strip() or lines[-1].lstrip().startswith("#")):
        lines.pop()
    return len("\n".join(lines).rstrip())


def _is_at_end(problem: UnexpectedInput) -> bool:
    return isinstance(problem, UnexpectedToken) and problem.token.type == "$END"


def word_at(text: str, offset: int) -> str:
    """Word at an offset, which may be a quotation mark alone; empty at the end of the text."""
    word = _WORD.match(text, offset)
    return word[0] if word else ""


def unexpected(
    problem: UnexpectedInput, grammar: Grammar, descriptions: Mapping[str, str], text: str, offset: int
) -> tuple[str, list[str], list[str]]:
    """Say what is wrong at an offset, and list what was expected there: keywords as written, and other tokens.

    ``descriptions`` are those of the terminals, the first to be named first.
    """
    word = word_at(text, offset)
    found = "the end of the file" if _is_at_end(problem) or not word else word[:40]
    message = f"unexpected {found}"
    if found == '"':
        message = "a string is not closed, or its quotation marks are unexpected here"
    names: Iterable[str] = getattr(problem, "accepts", None) or getattr(problem, "allowed", None) or ()
    names = names or getattr(problem, "expected", None) or ()
    names = {"$END" if name == "<END-OF-FILE>" else name for name in names}  # lark's lexer has a name of its own for it
    order = {name: place for place, name in enumerate(descriptions)}
    keywords, spoken = [], []
    for name in sorted(
        (name for name in names if not name.startswith("SIMPLE")), key=lambda name: (order.get(name, len(order)), name)
    ):
        keyword = None if name in descriptions else grammar.terminal(name)
        if keyword is not None:
            keywords.append(keyword)
        else:
            spoken.append(descriptions.get(name, name.lower()))
    return message, keywords, spoken
