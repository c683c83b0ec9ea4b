"""Argument checks of the plan language, whose errors show the wrong and the right code.

Each function declares its call once, as a :class:`Usage`; errors show the bad argument in that call.
"""

from __future__ import annotations

import inspect
import math
import operator
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from types import FunctionType, MethodType
from typing import Any

from planlang.spelling import similar

LONGEST = 60
"""Characters of a value shown in a message."""


class PlanStructureError(Exception):
    """The plan breaks a rule of the language; the message states the rule and shows the right code."""


class WrongType(PlanStructureError, TypeError):
    """An argument has the wrong type."""


class WrongValue(PlanStructureError, ValueError):
    """An argument has the right type and an invalid value."""


def contrast(message: str, wrong: str, right: str) -> str:
    """Append the wrong and the right code to a message."""
    return f"{message}\n  wrong: {wrong}\n  right: {right}"


class Usage:
    """A function and example code for its required and its optional arguments.

    The names of required keyword arguments end with ``=``; those of optional positional arguments begin with ``*``.
    """

    def __init__(self, function: str, required: Mapping[str, str], optional: Mapping[str, str] | None = None) -> None:
        self.function = function
        self.name = function.rpartition(" ")[2]
        self._required = required
        self._examples = {key.strip("=*"): code for key, code in (*required.items(), *(optional or {}).items())}
        self._further = frozenset(key.strip("*") for key in optional or {} if key.startswith("*"))

    def shown(self, parameter: str, code: str | None = None) -> str:
        """Return a call of the function with ``code`` for one argument, by default a valid example."""
        example = self._examples.get(parameter) or next(iter(self._examples.values()))
        codes = {**self._examples, parameter: example if code is None else code}
        names = {key.rstrip("="): key if key.endswith("=") else "" for key in self._required}
        arguments = [f"{keyword}{codes[name]}" for name, keyword in names.items()]
        if parameter not in names:
            arguments.append(codes[parameter] if parameter in self._further else f"{parameter}={codes[parameter]}")
        return f"{self.function}({', '.join(arguments)})"

    def wrong(
        self, parameter: str, value: object, meant: str, kind: type[WrongType] | type[WrongValue] = WrongType
    ) -> WrongType | WrongValue:
        """Make the error for an argument that is not ``meant``; a coroutine is closed."""
        code = written(value)
        message = f"{parameter} of {self.name} has to be {meant}, not {code}"
        return kind(contrast(message, self.shown(parameter, code), self.shown(parameter)))

    def instance(self, parameter: str, value: object, kinds: Any, meant: str) -> None:
        """Require an instance of the given classes."""
        if not isinstance(value, kinds):
            raise self.wrong(parameter, value, meant)

    def text(self, parameter: str, value: object) -> None:
        """Require a nonempty string."""
        self.instance(parameter, value, str, "a string")
        if not value:
            raise self.empty(parameter)

    def empty(self, parameter: str) -> WrongType | WrongValue:
        """Make the error for an empty string."""
        return self.wrong(parameter, "", "a string with something in it", WrongValue)

    def whole(self, parameter: str, value: object, least: int | None, what: str) -> int:
        """Convert a whole number of any type to int; raises for others and for numbers below ``least``."""
        number = whole_number(value)
        if number is not None and (least is None or number >= least):
            return number
        meant = f"a number of {what}, a whole one" + ("" if least is None else f", at least {least}")
        raise self.wrong(parameter, value, meant, WrongValue if _is_number(value) else WrongType)

    def seconds(self, parameter: str, value: object) -> None:
        """Require a duration [s]."""
        if amount(value) is None:
            raise self.not_seconds(parameter, value)

    def not_seconds(self, parameter: str, value: object) -> WrongType | WrongValue:
        """Make the error for an invalid duration."""
        kind = WrongValue if _is_number(value) and not isinstance(value, bool) else WrongType
        return self.wrong(parameter, value, "a duration, a finite number of seconds >= 0", kind)

    def iterable(self, parameter: str, value: object, meant: str) -> None:
        """Require an iterable other than a string."""
        if isinstance(value, str) or not is_iterable(value):
            raise self.wrong(parameter, value, meant)

    def mapping(self, parameter: str, value: object) -> None:
        """Require a mapping from names to branches."""
        if not isinstance(value, Mapping):
            raise self.wrong(parameter, value, "a mapping from names to branches")
        for key, branch in value.items():
            if key.__class__ is str and branch.__class__ in _USUAL:
                continue
            if not isinstance(key, str):
                discard(value.values())
                raise self.wrong(parameter, value, "a mapping from names, which are strings, to branches")
            if not _is_branch(branch):
                discard(value.values())
                raise self._no_branch(parameter, branch, f"{{{key!r}: %s}}")

    def refused(self, parameter: str, message: str, value: object) -> WrongValue:
        """Make the error with this message, and show the argument in the call."""
        return WrongValue(contrast(message, self.shown(parameter, written(value)), self.shown(parameter)))

    def at_once(self, parameter: str, function: object, result: object) -> None:
        """Refuse a coroutine as the result of a function that must not be async."""
        if inspect.iscoroutine(result):
            result.close()
            raise self.wrong(parameter, function, "a function that gives its result at once, without await")

    def plain(self, parameter: str, value: object, meant: str, arguments: int | None = None) -> None:
        """Require a function that is not async, and takes this number of arguments if one is given."""
        if not callable(value) or inspect.iscoroutinefunction(value):
            raise self.wrong(parameter, value, meant)
        if arguments is not None and not takes(value, arguments):
            raise self.wrong(parameter, value, meant)

    def branch(self, parameter: str, *values: object) -> None:
        """Require branches; coroutines are closed, and the message shows the right form."""
        for value in values:
            if value.__class__ not in _USUAL and not _is_branch(value):
                discard(values)
                raise self._no_branch(parameter, value)

    def branches(self, **values: object) -> None:
        """Require branches for several parameters; see :meth:`branch`."""
        for parameter, value in values.items():
            if value.__class__ not in _USUAL and not _is_branch(value):
                discard(values.values())
                raise self._no_branch(parameter, value)

    def _no_branch(self, parameter: str, value: object, form: str = "%s") -> WrongType | WrongValue:
        if not inspect.iscoroutine(value):
            return self.wrong(parameter, value, "a branch, an async function that is called without arguments")
        name = value.__name__
        message = f"you called {name}(); pass {name} or partial({name}, ...) to {self.name}"
        wrong, plain, bound = (
            self.shown(parameter, form % code) for code in (f"{name}()", name, f"partial({name}, ...)")
        )
        return WrongType(contrast(message, wrong, f"{plain}    or    {bound}"))


_USUAL = frozenset({FunctionType, MethodType, partial})


def _is_branch(value: object) -> bool:
    return callable(value) and (not isinstance(value, type) or hasattr(value, "__await__"))


def amount(value: Any) -> float | None:
    """Convert a number of any type to float; None unless it is finite and >= 0."""
    if not hasattr(type(value), "__float__") or type(value).__name__ in _TRUTHS:
        return None
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        return None
    return number if 0 <= number < math.inf else None


def whole_number(value: Any) -> int | None:
    """Convert a whole number of any type to int; None for anything else, including True and False."""
    if type(value).__name__ in _TRUTHS:
        return None
    try:
        return operator.index(value)
    except TypeError:
        return None


_TRUTHS = ("bool", "bool_")
"""Names of the classes of True and False in Python and numpy."""


def _is_number(value: object) -> bool:
    return hasattr(type(value), "__float__")


def is_iterable(value: object) -> bool:
    """Check whether a value can be iterated."""
    return isinstance(value, Iterable) or (hasattr(type(value), "__getitem__") and not isinstance(value, type))


def written(value: object) -> str:
    """Format a value as code of the plan, the same in each run; a coroutine is closed."""
    if inspect.iscoroutine(value):
        value.close()
        return f"{value.__name__}()"
    name = getattr(value, "__name__", None)
    if isinstance(name, str) and callable(value):
        return "lambda: ..." if name == "<lambda>" else name
    text = _inside(value)
    if not text or "\n" in text or " at 0x" in text:
        return f"{type(value).__name__}(...)"
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def _inside(value: object) -> str:
    """Return ``repr(value)``, with the items of containers formatted as code; "" if that raises."""
    try:
        if value.__class__ is dict:
            return f"{{{', '.join(f'{written(key)}: {written(item)}' for key, item in value.items())}}}"
        if value.__class__ is list:
            return f"[{', '.join(map(written, value))}]"
        if value.__class__ is tuple and value:
            return f"({', '.join(map(written, value))}{',' if len(value) == 1 else ''})"
        return repr(value)
    except Exception:
        return ""


def did_you_mean(name: str, known: Iterable[str], alike: float = 0.7) -> str:
    """Return ``; did you mean 'Reaching'?`` for a misspelt name, or "" if no known name is similar."""
    close = similar(name, known, least=alike)
    return f"; did you mean {close[0]!r}?" if close else ""


def takes(function: Callable[..., object], arguments: int) -> bool:
    """Check whether a function takes this number of arguments; True if its signature is unknown."""
    try:
        inspect.signature(function).bind(*[None] * arguments)
    except TypeError:
        return False
    except ValueError:  # written in C
        return True
    return True


def discard(values: Iterable[object]) -> None:
    """Close the coroutines among the arguments of a refused call, since nobody will await them."""
    for value in values:
        if inspect.iscoroutine(value):
            value.close()
