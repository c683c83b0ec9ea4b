"""Texts for people with options and calls in them, which each face of planlang says in its own words.

What is below the faces knows no command line: it states options by names and values, calls by the name of the command.
The command line says ``--start 1,2,0`` and ``planlang run serve_a_drink --seed 3``, Python says ``start=(1, 2, 0)`` and
``planlang.simulate("serve_a_drink", seed=3)``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Protocol

from planlang.records import dataclass
from planlang.shell import quoted


class Blank(str):
    """A value that the user has to fill in, such as ``FILE``."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Option:
    """An option by the name that its field has in Python, and its value; None for the option as such."""

    name: str
    value: object = None

    def __format__(self, spec: str) -> str:
        """Refuse to become part of a string, which would have the words of one face for good."""
        raise TypeError(f"write Text(..., {self!r}, ...): no string says an option in the words of each face")


@dataclass(frozen=True, slots=True)
class Call:
    """A call of a function or command, by the name of the command; make it with :func:`calling`."""

    command: str
    arguments: tuple[object, ...] = ()
    options: tuple[Option, ...] = ()

    def __format__(self, spec: str) -> str:
        """Refuse to become part of a string, as an :class:`Option` does."""
        raise TypeError(f"write Text(..., {self!r}, ...): no string says a call in the words of each face")


def calling(command: str, *arguments: object, **options: object) -> Call:
    """Make a call of a command; an option of None is left out, as is False, the default of all flags."""
    stated = (Option(name, value) for name, value in options.items() if value is not None and value is not False)
    return Call(command, arguments, tuple(stated))


class Face(Protocol):
    """The words of one face."""

    def option(self, option: Option) -> str:
        """Say an option."""

    def call(self, call: Call) -> str:
        """Say a call."""


class Python:
    """Options as keyword arguments, calls as those of planlang's functions; other commands as a shell has them."""

    functions: Mapping[str, str] = {
        "check": "check",
        "compare": "compare",
        "compile": "compile",
        "locate": "locate",
        "run": "simulate",
        "sweep": "sweep",
    }
    """Commands -> functions of planlang."""

    def option(self, option: Option) -> str:
        """``start=(1, 2, 0)``; only the name without a value."""
        return option.name if option.value is None else f"{option.name}={self._value(option.value)}"

    def call(self, call: Call) -> str:
        """``planlang.simulate("serve_a_drink", seed=3)``."""
        if call.command not in self.functions:
            return COMMAND_LINE.call(call)
        arguments = [*map(self._value, call.arguments), *map(self.option, call.options)]
        return f"planlang.{self.functions[call.command]}({', '.join(arguments)})"

    def _value(self, value: Any) -> str:
        if isinstance(value, Blank):
            return str(value)
        if isinstance(value, str | os.PathLike):
            return json.dumps(os.fspath(value), ensure_ascii=False)
        if isinstance(value, float):
            return f"{value:g}"
        if isinstance(value, Mapping):
            return f"{{{', '.join(f'{self._value(name)}: {self._value(one)}' for name, one in value.items())}}}"
        if isinstance(value, tuple):
            return f"({', '.join(map(self._value, value))})"
        if isinstance(value, list):
            return f"[{', '.join(map(self._value, value))}]"
        return str(value)


def word_of(name: str) -> str:
    """The word of the command line for an option of which none is declared."""
    return f"--{name.replace('_', '-')}"


class CommandLine:
    """Words for a POSIX shell, quoted so that they can be copied."""

    def option(self, option: Option) -> str:
        """``--start 1,2,0``; only the word without a value, and for a flag."""
        word = word_of(option.name)
        if option.value is None or option.value is True:
            return word
        return " ".join(
            f"{word}={text}" if text.startswith("-") else f"{word} {text}" for text in self._texts(option.value)
        )

    def call(self, call: Call) -> str:
        """``planlang run serve_a_drink --seed 3``."""
        words = (text for value in call.arguments for text in self._texts(value))
        return " ".join(("planlang", call.command, *words, *map(self.option, call.options)))

    def _texts(self, value: Any) -> Iterator[str]:
        """Texts of a value, several if the option is repeated for each."""
        if isinstance(value, Mapping):
            for name, one in value.items():
                text = f"{name}={','.join(self._texts(one)) if isinstance(one, list) else one}"
                if isinstance(one, Mapping):  # a variant with options of its own
                    text = f"{name}: {' '.join(self.option(Option(*each)) for each in one.items())}"
                yield text if isinstance(one, Blank) else quoted(text)
        elif isinstance(value, list):
            for one in value:
                yield from self._texts(one)
        elif isinstance(value, tuple):
            yield ",".join(f"{number:g}" for number in value)
        else:
            yield str(value) if isinstance(value, Blank) else quoted(value)


PYTHON, COMMAND_LINE = Python(), CommandLine()

Part = str | Option | Call
"""Part of a text."""


class Text(str):
    """A string in the words of Python that also knows its parts; :func:`said` says it in those of another face."""

    __slots__ = ("parts",)
    parts: tuple[Part, ...]

    def __new__(cls, *parts: Part) -> Text:
        """Join parts; those of a text are its own parts, too."""
        flat = tuple(one for part in parts for one in (part.parts if isinstance(part, Text) else (part,)))
        text = super().__new__(cls, "".join(_in_words(one, PYTHON) for one in flat))
        text.parts = flat
        return text

    def __add__(self, other: str) -> Text:
        return Text(self, other)

    def __radd__(self, other: str) -> Text:
        return Text(other, self)

    def __reduce__(self) -> tuple[type[Text], tuple[Part, ...]]:
        return Text, self.parts


def joined(separator: str, texts: Iterable[Part]) -> Text:
    """Join texts as ``str.join`` does."""
    parts = [part for text in texts for part in (separator, text)]
    return Text(*parts[1:])


def said(text: str, face: Face) -> str:
    """Say a text in the words of a face; a string without options is the same in all."""
    return "".join(_in_words(part, face) for part in text.parts) if isinstance(text, Text) else text


def _in_words(part: Part, face: Face) -> str:
    match part:
        case Option():
            return face.option(part)
        case Call():
            return face.call(part)
    return part
