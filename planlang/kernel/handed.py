"""What a call in the source hands over, beside what a coroutine got: whether the one can have made the other."""

from __future__ import annotations

import ast
import inspect
from dataclasses import dataclass
from types import CoroutineType, FunctionType
from typing import Any

CONSTANTS = (str, int, float, bool, bytes, type(None))


@dataclass(frozen=True, slots=True)
class Handed:
    """What is known of the arguments of a call from its source."""

    constants: tuple[object, ...]
    positional: int
    keywords: frozenset[str]
    is_all: bool
    """Whether nothing is handed over that ``*`` and ``**`` take apart."""

    @staticmethod
    def by(call: ast.Call) -> Handed:
        """What a call hands over."""
        given = [*call.args, *(keyword.value for keyword in call.keywords)]
        names = [keyword.arg for keyword in call.keywords if keyword.arg is not None]
        stars = len(names) < len(call.keywords) or any(isinstance(one, ast.Starred) for one in call.args)
        values = [one.value for one in given if isinstance(one, ast.Constant) and isinstance(one.value, CONSTANTS)]
        return Handed(tuple(values), len(call.args), frozenset(names), not stars)


class Got:
    """What a coroutine got."""

    def __init__(self, coroutine: CoroutineType[Any, Any, Any]) -> None:
        frame = coroutine.cr_frame
        self._code = coroutine.cr_code
        self._named: dict[str, Any] = {} if frame is None else frame.f_locals
        self._is_new = inspect.getcoroutinestate(coroutine) == inspect.CORO_CREATED
        self._values: list[object] = []
        for value in self._named.values():
            within = value if isinstance(value, tuple) else value.values() if isinstance(value, dict) else (value,)
            self._values += within

    def contradicts(self, handed: Handed, made: object) -> bool:
        """Whether calling ``made`` like this gives another coroutine.

        That is so if a constant is handed over that it did not get; and, where ``made`` hands on what it is called
        with, if arguments are too many or too few, or left out though it did not get the default.
        """
        if not all(map(self._has, handed.constants)):
            return True
        if not (self._is_new and handed.is_all):
            return False
        if isinstance(made, FunctionType) and made.__code__ is self._code:
            return not self._fits(handed, inspect.signature(made, follow_wrapped=False))
        match self._named:
            case {"self": plan, "args": tuple(args), "kwargs": dict(kwargs)} if plan is made:
                return len(args) != handed.positional or set(kwargs) != handed.keywords
        return False

    def _has(self, constant: object) -> bool:
        return any(type(one) is type(constant) and one == constant for one in self._values)

    def _fits(self, handed: Handed, signature: inspect.Signature) -> bool:
        """Whether a function of this signature, so called, leaves to defaults only what has its default."""
        try:
            bound = signature.bind(*range(handed.positional), **dict.fromkeys(handed.keywords))
        except TypeError:
            return False
        left = signature.parameters.keys() - bound.arguments.keys()
        bound.apply_defaults()
        for name, value in bound.arguments.items():
            got = self._named[name]
            match signature.parameters[name].kind:
                case inspect.Parameter.VAR_POSITIONAL:
                    fits = len(got) == len(value)
                case inspect.Parameter.VAR_KEYWORD:
                    fits = got.keys() == value.keys()
                case _:
                    fits = name not in left or got is value
            if not fits:
                return False
        return True
