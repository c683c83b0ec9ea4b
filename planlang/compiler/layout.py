"""Laying out Python expressions as a formatter would: on one line if they fit, else broken inside their brackets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

WIDTH = 88
"""Columns of a line: what ruff and black take where nobody has set a width, so that either leaves a plan unchanged.

Not kept to: first lines of functions without parameters, and of local ones, whose names alone are too long.
"""

INDENT = "    "


@dataclass(frozen=True, slots=True)
class Text:
    """An expression that is never broken."""

    text: str

    def flat(self) -> str:
        """The text."""
        return self.text


@dataclass(frozen=True, slots=True)
class Call:
    """A call: positional and keyword arguments in the order given; a keyword's name is the first of the pair."""

    function: str
    arguments: tuple[tuple[str | None, Expression], ...] = ()

    def flat(self) -> str:
        """The call on one line."""
        inside = ", ".join(_labelled(keyword) + argument.flat() for keyword, argument in self.arguments)
        return f"{self.function}({inside})"


@dataclass(frozen=True, slots=True)
class Display:
    """A tuple, list or dict display; ``keys`` are given for a dict only."""

    brackets: str
    items: tuple[Expression, ...]
    keys: tuple[str, ...] = ()

    def flat(self) -> str:
        """The display on one line."""
        inside = ", ".join(label + item.flat() for label, item in self.labelled())
        if self.brackets == "()" and len(self.items) == 1:
            inside += ","
        return f"{self.brackets[0]}{inside}{self.brackets[1]}"

    def labelled(self) -> list[tuple[str, Expression]]:
        """The items, each with what stands before it: ``"key": `` or nothing."""
        labels = [f"{key}: " for key in self.keys] if self.keys else [""] * len(self.items)
        return list(zip(labels, self.items, strict=True))


Expression = Text | Call | Display


def call(function: str, *positional: Expression | str, **keywords: Expression | str) -> Call:
    """A call; plain strings are source text."""
    arguments: list[tuple[str | None, Expression]] = [(None, _expression(value)) for value in positional]
    arguments += [(key, _expression(value)) for key, value in keywords.items()]
    return Call(function, tuple(arguments))


def sequence(items: Sequence[Expression], brackets: str = "()") -> Display:
    """A tuple or list display."""
    return Display(brackets, tuple(items))


def statement(expression: Expression, *, depth: int, before: str = "", after: str = "") -> list[str]:
    """Lines of a statement: ``before`` + expression + ``after``, indented by ``depth`` levels."""
    return _lines(expression, depth, before, after)


def _lines(expression: Expression, depth: int, before: str, after: str) -> list[str]:
    indent = INDENT * depth
    is_wide = _is_wide(expression)
    if not is_wide:
        line = f"{indent}{before}{expression.flat()}{after}"
        is_whole = isinstance(expression, Text) or (isinstance(expression, Call) and not expression.arguments)
        if is_whole or len(line) <= WIDTH:
            return [line]
    assert not isinstance(expression, Text)
    if isinstance(expression, Call):
        opening, closing = f"{expression.function}(", ")"
        items = [(_labelled(keyword), argument) for keyword, argument in expression.arguments]
        if not is_wide:
            together = INDENT * (depth + 1) + ", ".join(label + item.flat() for label, item in items)
            if len(together) <= WIDTH:
                return [f"{indent}{before}{opening}", together, f"{indent}{closing}{after}"]
    else:
        opening, closing = expression.brackets[0], expression.brackets[1]
        items = expression.labelled()
    inside = [line for label, item in items for line in _lines(item, depth + 1, label, ",")]
    return [f"{indent}{before}{opening}", *inside, f"{indent}{closing}{after}"]


def _is_wide(expression: Expression) -> bool:
    """True if an expression has too many parts for any line: each takes a character, a comma and a blank."""
    if isinstance(expression, Text):
        return False
    parts = [part for _, part in expression.arguments] if isinstance(expression, Call) else expression.items
    return 3 * len(parts) > WIDTH or any(map(_is_wide, parts))


def _labelled(keyword: str | None) -> str:
    return f"{keyword}=" if keyword else ""


def _expression(value: Expression | str) -> Expression:
    return Text(value) if isinstance(value, str) else value
