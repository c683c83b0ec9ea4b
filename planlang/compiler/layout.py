"""Laying out Python expressions as a formatter would: on one line if they fit, else broken inside their brackets."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from planlang.records import dataclass

WIDTH = 120
"""Columns of a line, as in planlang's own code: a step with its properties stands on one. ``ruff format --line-length
120`` leaves a plan unchanged, and so does black.

Longer are lines with a name that is too long alone: no formatter breaks a name.
"""

INDENT = "    "


@dataclass(frozen=True, slots=True)
class Text:
    """An expression that is never broken."""

    text: str

    def flat(self) -> str:
        """Return the text."""
        return self.text


@dataclass(frozen=True, slots=True)
class Sum:
    """``left + right`` as an argument of a call."""

    left: str
    right: str

    def flat(self) -> str:
        """Return the sum on one line."""
        return f"{self.left} + {self.right}"


@dataclass(frozen=True, slots=True)
class Item:
    """An item of a mapping or a sequence: ``holder[key]``."""

    holder: str
    key: str

    def flat(self) -> str:
        """Return the item on one line."""
        return f"{self.holder}[{self.key}]"


@dataclass(frozen=True, slots=True)
class Call:
    """A call: positional and keyword arguments in the order given; a keyword's name is the first of the pair."""

    function: str
    arguments: tuple[tuple[str | None, Expression], ...] = ()

    def flat(self) -> str:
        """Return the call on one line."""
        inside = ", ".join(_labelled(keyword) + argument.flat() for keyword, argument in self.arguments)
        return f"{self.function}({inside})"

    def extended(self, **keywords: Expression) -> Call:
        """Return the call with further keyword arguments."""
        return Call(self.function, (*self.arguments, *keywords.items()))

    def further(self, *positional: Expression) -> Call:
        """Return the call with further positional arguments."""
        place = sum(keyword is None for keyword, _ in self.arguments)
        further = ((None, argument) for argument in positional)
        return Call(self.function, (*self.arguments[:place], *further, *self.arguments[place:]))


@dataclass(frozen=True, slots=True)
class Display:
    """A tuple, list or dict display; ``keys`` are given for a dict only."""

    brackets: str
    items: tuple[Expression, ...]
    keys: tuple[Expression, ...] = ()

    def flat(self) -> str:
        """Return the display on one line."""
        inside = ", ".join([label + item.flat() for label, item in self.labelled()])
        if self.brackets == "()" and len(self.items) == 1:
            inside += ","
        return f"{self.brackets[0]}{inside}{self.brackets[1]}"

    def labelled(self) -> list[tuple[str, Expression]]:
        """Return the items, each with the text before it: ``"key": `` or nothing."""
        if not self.keys:
            return [("", item) for item in self.items]
        return [(f"{key.flat()}: ", item) for key, item in zip(self.keys, self.items, strict=True)]


@dataclass(frozen=True, slots=True)
class Remark:
    """An argument of a call, or an item of a display, with a comment on it: so each of them is on a line of its own."""

    expression: Expression
    comment: str

    def flat(self) -> str:
        """Return the expression on one line."""
        return self.expression.flat()


Expression = Text | Sum | Item | Call | Display | Remark


def call(function: str, *positional: Expression | str, **keywords: Expression | str) -> Call:
    """Return a call; plain strings are source text."""
    arguments: list[tuple[str | None, Expression]] = [(None, _expression(value)) for value in positional]
    arguments += [(key, _expression(value)) for key, value in keywords.items()]
    return Call(function, tuple(arguments))


def sequence(items: Sequence[Expression], brackets: str = "()") -> Display:
    """Return a tuple or list display."""
    return Display(brackets, tuple(items))


def statement(expression: Expression, *, depth: int, before: str = "", after: str = "") -> list[str]:
    """Return the lines of a statement: ``before`` + expression + ``after``, indented by ``depth`` levels."""
    return _lines(expression, depth, before, after)


def assignment(targets: Sequence[Expression], expression: Expression, *, depth: int, before: str = "") -> list[str]:
    """Return the lines of a statement that assigns a value to one target, or its parts to several.

    A value whose beginning does not fit beside its target stands in brackets, if that makes all lines fit.
    """
    indent, together = INDENT * depth, ", ".join(target.flat() for target in targets)
    lines = statement(expression, depth=depth, before=f"{together} = {before}")
    if len(lines[0]) <= WIDTH:
        return lines
    if len(targets) > 1:
        return [f"{indent}(", *_items(targets, depth), *statement(expression, depth=depth, before=f") = {before}")]
    inside = statement(expression, depth=depth + 1, before=before)
    bracketed = [f"{indent}{together} = (", *inside, f"{indent})"]
    return bracketed if max(map(len, bracketed)) <= WIDTH else lines


def comment(text: str, depth: int) -> list[str]:
    """Return the lines of a comment."""
    start = INDENT * depth + "# "
    return textwrap.wrap(" ".join(text.split()), WIDTH, initial_indent=start, subsequent_indent=start)


def remarked(lines: list[str], text: str, depth: int) -> list[str]:
    """Return lines with a comment: beside them if they are one on which it has room, else above."""
    beside = f"{lines[0]}  # {' '.join(text.split())}"
    return [beside] if len(lines) == 1 and len(beside) <= WIDTH else [*comment(text, depth), *lines]


def returned(values: Sequence[Expression], *, depth: int) -> list[str]:
    """Return the lines of a statement that returns one value, or several."""
    line = f"{INDENT * depth}return {', '.join(value.flat() for value in values)}"
    if len(values) == 1 or len(line) <= WIDTH:
        return [line]
    return [INDENT * depth + "return (", *_items(values, depth), INDENT * depth + ")"]


def signature(start: str, parameters: Sequence[str], returns: str, *, depth: int) -> list[str]:
    """Return the first lines of a function: ``start`` is before its brackets, ``returns`` is the type of its result.

    Parameters share a line if they fit, else have one each. Without any the type is what is broken: inside of its own
    brackets if these begin on the line, else inside of a pair around it.
    """
    indent, inner = INDENT * depth, INDENT * (depth + 1)
    line = f"{indent}{start}({', '.join(parameters)}) -> {returns}:"
    if len(line) <= WIDTH:
        return [line]
    if not parameters:
        outer, bracket, arguments = returns.partition("[")
        opening = f"{indent}{start}() -> {outer}["
        if bracket and len(opening) <= WIDTH:
            return [opening, inner + arguments.removesuffix("]"), f"{indent}]:"]
        return [f"{indent}{start}() -> (", inner + returns, f"{indent}):"]
    together = inner + ", ".join(parameters)
    if len(parameters) == 1 or len(together) > WIDTH:
        inside = [line for parameter in parameters for line in _parameter(parameter, inner)]
    else:
        inside = [together]
    return [f"{indent}{start}(", *inside, f"{indent}) -> {returns}:"]


def _parameter(parameter: str, indent: str) -> list[str]:
    """Return a parameter on lines of its own; a type that does not fit is broken inside of its brackets."""
    named, bracket, inside = parameter.partition("[")
    if not bracket or len(f"{indent}{parameter},") <= WIDTH:
        return [f"{indent}{parameter},"]
    arguments = [f"{indent}{INDENT}{inside.removesuffix(']')}"]
    if len(arguments[0]) > WIDTH:
        arguments = [f"{indent}{INDENT}{argument}," for argument in inside.removesuffix("]").split(", ")]
    return [f"{indent}{named}[", *arguments, f"{indent}],"]


def _lines(expression: Expression, depth: int, before: str, after: str) -> list[str]:
    indent = INDENT * depth
    if isinstance(expression, Text):
        return [f"{indent}{before}{expression.text}{after}"]
    if isinstance(expression, Remark):
        return remarked(_lines(expression.expression, depth, before, after), expression.comment, depth)
    is_wide = _is_wide(expression)
    if not is_wide:
        line = f"{indent}{before}{expression.flat()}{after}"
        if len(line) <= WIDTH or (isinstance(expression, Call) and not expression.arguments):
            return [line]
    if isinstance(expression, Sum):
        return [f"{indent}{before}{expression.left}", f"{indent}+ {expression.right}{after}"]
    if isinstance(expression, Item):
        return [f"{indent}{before}{expression.holder}[", f"{indent}{INDENT}{expression.key}", f"{indent}]{after}"]
    if isinstance(expression, Call):
        opening, closing = f"{expression.function}(", ")"
        items = [(_labelled(keyword), argument) for keyword, argument in expression.arguments]
        if not is_wide:
            together = INDENT * (depth + 1) + ", ".join(label + item.flat() for label, item in items)
            if len(together) <= WIDTH:
                return [f"{indent}{before}{opening}", together, f"{indent}{closing}{after}"]
        is_bare = len(items) == 1 and isinstance(items[0][1], (Text, Sum, Item))
        inside = [line for label, item in items for line in _lines(item, depth + 1, label, "" if is_bare else ",")]
    else:
        opening, closing = expression.brackets[0], expression.brackets[1]
        if expression.keys:
            pairs = zip(expression.keys, expression.items, strict=True)
            inside = [line for key, item in pairs for line in _pair(key, item, depth)]
        else:
            inside = _items(expression.items, depth)
    return [f"{indent}{before}{opening}", *inside, f"{indent}{closing}{after}"]


def _items(items: Sequence[Expression], depth: int) -> list[str]:
    """Return the items of a display, each on lines of its own."""
    return [line for item in items for line in _lines(item, depth + 1, "", ",")]


def _pair(key: Expression, item: Expression, depth: int) -> list[str]:
    """Return an entry of a dict; its key is broken only if its value cannot be."""
    if isinstance(item, Text):
        return _lines(key, depth + 1, "", f": {item.flat()},")
    return _lines(item, depth + 1, f"{key.flat()}: ", ",")


def _is_wide(expression: Expression) -> bool:
    """Return True if an expression has a remark, or too many parts for any line: each takes 3 characters at least."""
    if isinstance(expression, Remark):
        return True
    if isinstance(expression, (Text, Sum, Item)):
        return False
    parts = [part for _, part in expression.arguments] if isinstance(expression, Call) else expression.items
    return 3 * len(parts) > WIDTH or any(_is_wide(part) for part in parts if not isinstance(part, Text))


def _labelled(keyword: str | None) -> str:
    return f"{keyword}=" if keyword else ""


def _expression(value: Expression | str) -> Expression:
    return Text(value) if isinstance(value, str) else value
