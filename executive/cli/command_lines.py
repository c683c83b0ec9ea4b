"""Commands of click from dataclasses: parameters from declared options, and what is said of wrong usage."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from enum import Enum
from typing import Any, TypeVar

import click

from executive.cli.arguments import Arguments
from executive.options.declaring import Stated, declared
from planlang.spelling import guess
from planlang.words import COMMAND_LINE, said, word_of

A = TypeVar("A", bound=Arguments)


def command_of(name: str, arguments: type[A], work: Callable[[A], None], example: str) -> click.Command:
    """Make a command whose parameters are the fields of a dataclass: its own first, then inherited ones.

    ``work`` gets the arguments with the words that were stated; :func:`parsed` makes values of them.
    """
    own = {one.name for kind in _own(arguments) for one in fields(kind) if one.name in inspect.get_annotations(kind)}
    text = inspect.cleandoc(arguments.__doc__ or "")
    return click.Command(
        name.split()[-1],
        callback=lambda **values: work(arguments_of(arguments, values)),
        params=[_parameter(one) for one in sorted(declared(arguments).values(), key=lambda one: one.name not in own)],
        help=text,
        short_help=text.partition(".")[0] + ".",  # click would cut the first sentence off after 45 characters
        epilog=f"Example: planlang {name} {example}",
    )


def arguments_of(kind: type[A], values: Mapping[str, Any]) -> A:
    """Arguments from the values of click, by name; what was not stated has its default."""
    stated = {name: one for name, one in values.items() if one not in (None, ())}
    lists: dict[str, Any] = {name: list(one) for name, one in stated.items() if isinstance(one, tuple)}
    return kind(**{**stated, **lists})


def parsed(arguments: A) -> A:
    """Give options the values that their words mean. Raises BadInput."""
    read = {name: one for name, one in declared(type(arguments)).items() if one.declared.parse is not None}
    words = {name: given for name in read if (given := getattr(arguments, name)) is not None}
    return replace(arguments, **{name: read[name].value(given) for name, given in words.items()})


def _own(arguments: type[Arguments]) -> list[type]:
    """A class of arguments, and that of the options to which it adds those of a command."""
    bases = (base for base in arguments.__bases__ if not issubclass(base, Arguments))
    return [arguments, *(base for base in bases if any(one.declared.is_positional for one in declared(base).values()))]


def _parameter(one: Stated) -> click.Parameter:
    """The option or argument of click for a declaration; what is parsed afterwards is text."""
    known, (kind, is_list) = one.declared, one.worded
    more: dict[str, Any] = {
        "type": _type(kind, known.least, known.most),
        "required": one.is_required,
        "help": said(known.help, COMMAND_LINE),
        "envvar": known.envvar,
    }
    if not one.is_required and not is_list:
        more["default"] = getattr(one.field.default, "value", one.field.default)
    metavar = known.metavar
    if known.is_positional:
        if not (one.is_required or metavar is None or metavar.startswith("[")):
            metavar = f"[{metavar}]"
        return click.Argument([one.name], nargs=-1 if is_list else 1, metavar=metavar, **more)
    more |= {"is_flag": kind is bool, "multiple": is_list, "metavar": metavar}
    words = known.words or (word_of(one.name),)
    return click.Option([*words, one.name], show_default=known.shows_default, show_envvar=True, **more)


def _type(kind: Any, least: Any, most: Any) -> Any:
    """The type of click for a value; a number may have limits."""
    if isinstance(kind, type) and issubclass(kind, Enum):
        return _Choice(kind)
    if kind in (int, float) and (least, most) != (None, None):
        return (click.IntRange if kind is int else _Number)(least, most)
    return kind


class _Number(click.FloatRange):
    """Numbers between limits; NaN, which is neither below nor above one, is none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        number = super().convert(value, param, ctx)
        return self.fail(f"{value!r} is not a number", param, ctx) if number != number else number


class _Choice(click.Choice[str]):
    """Members of an enumeration, by their values."""

    def __init__(self, kind: type[Enum]) -> None:
        super().__init__([str(one.value) for one in kind])
        self._kind = kind

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return self._kind(super().convert(value, param, ctx))


class Commands(click.Group):
    """Group of commands that are listed in the order in which they were added."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands."""
        return list(self.commands)


# Usage errors: the message, and a guess at what was meant

_ADVICE = re.compile(r"\s*\(?(Did you mean .*\?)\)?$")
_CHOICE = re.compile(r"'([^']*)' is not one of ('.*')")


def explain(problem: click.UsageError) -> tuple[str, str, str]:
    """Split a usage error into command ("" for ``planlang`` itself), message and advice."""
    path = problem.ctx.command_path if problem.ctx is not None else "planlang"
    command, message = path.removeprefix("planlang").strip(), problem.format_message()
    if getattr(problem, "option_name", None) == "--json":  # --json belongs to a command, and none was named
        return command, "Missing command.", f"{path} -h lists the commands"
    if (advice := _ADVICE.search(message)) is not None:
        return command, message[: advice.start()], advice[1][0].lower() + advice[1][1:]
    return command, message, guessed_value(message) or f"{path} -h shows how it is used"


def guessed_value(message: str) -> str:
    """Guess which value of an option was meant; "" if none is similar."""
    match = _CHOICE.search(message)
    return guess(match[1], re.findall(r"'([^']*)'", match[2])).strip() if match is not None else ""
