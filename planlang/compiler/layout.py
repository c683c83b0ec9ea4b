"""Laying out Python expressions as a formatter would: on one line if they fit, else broken inside their brackets."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from planlang.records import dataclass
from planlang.visible import visible

WIDTH = 120
"""Columns of a line, as in planlang's own code, so that a step with its properties fits on one. ``ruff format
--line-length 120`` leaves a plan unchanged, and so does black.

Only lines with a name that is too long by itself are longer, because no formatter breaks a name.
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
class Sum:
    """``left + right`` as an argument of a call."""

    left: str
    right: str

    def flat(self) -> str:
        """The sum on one line."""
        return f"{self.left} + {self.right}"


@dataclass(frozen=True, slots=True)
class Item:
    """An item of a mapping or a sequence: ``holder[key]``."""

    holder: str
    key: str

    def flat(self) -> str:
        """The item on one line."""
        return f"{self.holder}[{self.key}]"


@dataclass(frozen=True, slots=True)
class Call:
    """A call with arguments in order, as pairs (keyword or None, value)."""

    function: str
    arguments: tuple[tuple[str | None, Expression], ...] = ()

    def flat(self) -> str:
        """The call on one line."""
        inside = ", ".join(_labelled(keyword) + argument.flat() for keyword, argument in self.arguments)
        return f"{self.function}({inside})"

    def extended(self, **keywords: Expression) -> Call:
        """Copy with further keyword arguments."""
        return Call(self.function, (*self.arguments, *keywords.items()))

    def further(self, *positional: Expression) -> Call:
        """Copy with further positional arguments."""
        number = sum(keyword is None for keyword, _ in self.arguments)
        further = ((None, argument) for argument in positional)
        return Call(self.function, (*self.arguments[:number], *further, *self.arguments[number:]))


@dataclass(frozen=True, slots=True)
class Display:
    """A tuple, list or dict display; ``keys`` are given for a dict only."""

    brackets: str
    items: tuple[Expression, ...]
    keys: tuple[Expression, ...] = ()

    def flat(self) -> str:
        """The display on one line."""
        inside = ", ".join([label + item.flat() for label, item in self.labelled()])
        if self.brackets == "()" and len(self.items) == 1:
            inside += ","
        return f"{self.brackets[0]}{inside}{self.brackets[1]}"

    def labelled(self) -> list[tuple[str, Expression]]:
        """Items, each with the text before it: ``"key": `` or nothing."""
        if not self.keys:
            return [("", item) for item in self.items]
        return [(f"{key.flat()}: ", item) for key, item in zip(self.keys, self.items, strict=True)]


@dataclass(frozen=True, slots=True)
class Remark:
    """An argument of a call, or an item of a display, with a comment; it takes a line of its own."""

    expression: Expression
    comment: str

    def flat(self) -> str:
        """The expression on one line."""
        return self.expression.flat()


Expression = Text | Sum | Item | Call | Display | Remark


def call(function: str, *positional: Expression | str, **keywords: Expression | str) -> Call:
    """Build a call; plain strings are source text."""
    arguments: list[tuple[str | None, Expression]] = [(None, _expression(value)) for value in positional]
    arguments += [(key, _expression(value)) for key, value in keywords.items()]
    return Call(function, tuple(arguments))


def sequence(items: Sequence[Expression], brackets: str = "()") -> Display:
    """Build a tuple or list display."""
    return Display(brackets, tuple(items))


def one_or_several(items: Sequence[Expression]) -> Expression:
    """Build a tuple display of several expressions; one stays as it is."""
    return items[0] if len(items) == 1 else sequence(items)


def statement(expression: Expression, *, depth: int, before: str = "", after: str = "") -> list[str]:
    """Write a statement, ``before`` + expression + ``after``, indented by ``depth`` levels."""
    return _lines(expression, depth, before, after)


def assignment(targets: Sequence[Expression], expression: Expression, *, depth: int, before: str = "") -> list[str]:
    """Write an assignment of a value to one target, or of its parts to several.

    A value whose first line does not fit beside its target is put in parentheses, if all lines fit then.
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
    """Write a comment."""
    start = INDENT * depth + "# "
    return textwrap.wrap(visible(" ".join(text.split())), WIDTH, initial_indent=start, subsequent_indent=start)


def with_comment(lines: list[str], text: str, depth: int) -> list[str]:
    """Add a comment to lines: beside a single line if it fits, else above."""
    beside = f"{lines[0]}  # {visible(' '.join(text.split()))}"
    return [beside] if len(lines) == 1 and len(beside) <= WIDTH else [*comment(text, depth), *lines]


def return_statement(values: Sequence[Expression], *, depth: int) -> list[str]:
    """Write a return statement with one or several values."""
    line = f"{INDENT * depth}return {', '.join(value.flat() for value in values)}"
    if len(values) == 1 or len(line) <= WIDTH:
        return [line]
    return [INDENT * depth + "return (", *_items(values, depth), INDENT * depth + ")"]


def signature(start: str, parameters: Sequence[str], returns: str, *, depth: int) -> list[str]:
    """Write the head of a function: ``start`` precedes its parentheses, ``returns`` is the type of its result.

    Parameters share a line if they fit, otherwise each has its own. Without parameters the type is broken: inside its
    brackets if they begin on the line, else inside parentheses around it.
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
    """Write a parameter on its own lines; a type that does not fit is broken inside its brackets."""
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
        return with_comment(_lines(expression.expression, depth, before, after), expression.comment, depth)
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
    """Write the items of a display on lines of their own."""
    return [line for item in items for line in _lines(item, depth + 1, "", ",")]


def _pair(key: Expression, item: Expression, depth: int) -> list[str]:
    """Write an entry of a dict; the key is broken only if the value cannot be."""
    if isinstance(item, Text):
        return _lines(key, depth + 1, "", f": {item.flat()},")
    return _lines(item, depth + 1, f"{key.flat()}: ", ",")


def _is_wide(expression: Expression) -> bool:
    """True if an expression has a remark, or too many parts for a line: each part takes at least 3 characters."""
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
