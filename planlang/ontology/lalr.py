"""The loop of a parser over the tables and scanners that lark makes of a grammar, for texts without mistakes.

lark's own loop makes a token of each blank, compares rules by what they consist of, and is ready to explain and to go
on behind a mistake, which takes two thirds of the time that a large file needs. This one gives up at the first mistake;
the text is then read again by lark's own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lark import Lark, Token
from lark.parsers.lalr_analysis import Shift

_Action = int | tuple[int, Callable[[list[Any]], Any], str]
"""The state to go to, or a reduction: of how many values, what makes one of them, what that is called."""


class Mistake(Exception):
    """The text is not of the language."""


class Loop:
    """Parses texts by the grammar of a lark parser (LALR, contextual lexer, with a transformer)."""

    def __init__(self, parser: Lark) -> None:
        frontend: Any = parser.parser
        self._lexers = frontend.lexer.lexers
        self._callbacks = frontend.parser.parser.callbacks
        table = frontend.parser.parser.parse_table
        self._table = table.states
        (self._start,) = table.start_states.values()
        (self._end,) = table.end_states.values()
        self._actions: dict[int, dict[str, _Action]] = {}
        self._scanners: dict[int, tuple[Any, ...]] = {}

    def parse(self, text: str) -> None:
        """Call the transformer with what the text consists of. Raises Mistake if it is not of the language."""
        position, end, line, line_start = 0, len(text), 1, 0
        states: list[int] = [self._start]
        values: list[Any] = []
        scanners, actions, token_of, last = self._scanners, self._actions, str.__new__, self._end
        while True:
            state = states[-1]
            scan, ignored, with_lines, told = scanners.get(state) or self._scanner(state)
            kind, token = "$END", None
            while position < end:
                found = scan(text, position)
                if found is None:
                    raise Mistake
                kind, start, position = found.lastgroup, position, found.end()
                if kind not in ignored:
                    word = found[0]
                    token = token_of(Token, word)
                    token.type, token.value = kind, word
                    token.line, token.column = line, start - line_start + 1
                if kind in with_lines and (lines := text.count("\n", start, position)):
                    line += lines
                    line_start = text.rindex("\n", start, position) + 1
                if token is not None:
                    if kind in told:
                        token = told[kind](token)
                        kind = token.type
                    break
                kind = "$END"
            while True:
                state = states[-1]
                action = (actions.get(state) or self._actions_of(state)).get(kind)
                if action is None:
                    raise Mistake
                if isinstance(action, int):
                    states.append(action)
                    values.append(token)
                    break
                size, reduce, name = action
                inside = values[-size:] if size else []
                if size:
                    del states[-size:], values[-size:]
                value = reduce(inside)
                following = (actions.get(states[-1]) or self._actions_of(states[-1]))[name]
                assert isinstance(following, int)
                if token is None and following == last:
                    return
                states.append(following)
                values.append(value)

    def _scanner(self, state: int) -> tuple[Any, ...]:
        """What finds the next word in a state, the kinds that are skipped, that may have line ends, that are told."""
        lexer = self._lexers[state]
        expressions = lexer.scanner._mres
        if len(expressions) == 1:
            scan = expressions[0].match
        else:

            def scan(text: str, position: int) -> Any:
                matches = (expression.match(text, position) for expression in expressions)
                return next((found for found in matches if found), None)

        found = self._scanners[state] = (scan, lexer.ignore_types, lexer.newline_types, lexer.callback)
        return found

    def _actions_of(self, state: int) -> dict[str, _Action]:
        """What to do in a state with a word of each kind, or with what has been made of several."""
        found: dict[str, _Action] = {}
        for name, (action, target) in self._table[state].items():
            if action is Shift:
                found[name] = target
            else:
                found[name] = (len(target.expansion), self._callbacks[target], target.origin.name)
        self._actions[state] = found
        return found
