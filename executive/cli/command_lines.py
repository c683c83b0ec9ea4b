"""Commands from dataclasses: parameters of typer from declared options, and what is said of wrong usage."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, TypeVar, get_args

import typer
from typer.core import TyperCommand, TyperGroup

from executive.cli.arguments import Arguments
from executive.options.declaring import Stated, declared
from planlang.spelling import guess
from planlang.words import COMMAND_LINE, said

A = TypeVar("A", bound=Arguments)
_WHOLE, _DECIMAL = re.compile(r"0|-?[1-9][0-9]{0,8}"), re.compile(r"-?(?:0|[1-9][0-9]{0,8})(?:\.[0-9]{1,9})?")


def typed(arguments: type[Arguments]) -> dict[str, Any]:
    """Types of the parameters of a command, as typer wants them: annotated with an option or argument of its own."""
    return {name: Annotated[_type(one), _info(one)] for name, one in declared(arguments).items()}


def _type(one: Stated) -> Any:
    """The type to which typer converts words; what is parsed afterwards is text."""
    if one.declared.parse is None:
        return one.annotation
    words = list[str] if one.declared.is_repeatable else str
    return words if one.is_required else words | None


def _info(one: Stated) -> Any:
    """The option or argument of typer for a declaration."""
    known = one.declared
    more: dict[str, Any] = {
        "metavar": known.metavar,
        "help": said(known.help, COMMAND_LINE),
        "min": known.least,
        "max": known.most,
        "envvar": known.envvar,
        "show_default": known.shows_default,
    }
    return typer.Argument(**more) if known.is_positional else typer.Option(*_words(one), **more)


def _words(one: Stated) -> tuple[str, ...]:
    """The words of an option, if typer would not make them of the name: of a flag it would make two."""
    is_flag = one.annotation is bool and not one.declared.words
    return (f"--{one.name.replace('_', '-')}",) if is_flag else one.declared.words


def command_of(arguments: type[Arguments]) -> type[TyperCommand]:
    """Make the class of a command with the fields of a dataclass, which converts plain words by itself.

    Typer imports pydantic for each word, which takes a tenth of a short run. It still converts, and refuses, the rest.
    """
    hints = typed(arguments)

    class Command(TyperCommand):
        def get_params(self, ctx: Any) -> list[Any]:
            return _plain_first(super().get_params(ctx), hints)

    return Command


class Commands(TyperGroup):
    """Group of commands that converts nothing where nothing is stated: see :func:`command_of`."""

    def get_params(self, ctx: Any) -> list[Any]:
        """List the parameters, as click does."""
        return _plain_first(super().get_params(ctx), {})


def _plain_first(parameters: Sequence[Any], hints: Mapping[str, Any]) -> list[Any]:
    for one in parameters:
        if not isinstance(one.process_value, partial):
            one.process_value = partial(_processed, one, one.process_value, hints.get(one.name))
    return list(parameters)


def _processed(parameter: Any, convert: Callable[[Any, Any], Any], hint: Any, context: Any, value: Any) -> Any:
    """Convert what was stated for a parameter, or its default."""
    is_list = parameter.multiple or parameter.nargs != 1
    if parameter.required and not value:
        return convert(context, value)
    if value is None:
        word: Any = () if is_list else None
        return word if parameter.callback is None else parameter.callback(context, parameter, word)
    if hint is not None and parameter.callback is None:
        kind, info = get_args(hint)[0], hint.__metadata__[0]
        kind, *others = (
            [one for one in get_args(kind) if one is not NoneType] if isinstance(kind, UnionType) else [kind]
        )
        words = value if is_list and isinstance(value, list | tuple) else [value]
        plain = [_plain(get_args(kind)[0] if is_list else kind, info, word) for word in words]
        if not others and None not in plain:
            return plain if is_list else plain[0]
    return convert(context, value)


def _plain(kind: Any, info: Any, word: Any) -> Any:
    """Convert a word that needs no more than the constructor of its type; None for any other."""
    if isinstance(word, kind) and not isinstance(word, str):
        return word  # a default
    if not isinstance(word, str):
        return None
    if kind is str:
        return word
    if kind is Path and not (info.exists or info.resolve_path or info.allow_dash):
        return Path(word)
    if kind in (int, float) and (_WHOLE if kind is int else _DECIMAL).fullmatch(word):
        number = kind(word)
        return number if (info.min is None or number >= info.min) and (info.max is None or number <= info.max) else None
    return None


def with_parameters(name: str, arguments: type[A], work: Callable[[A], None]) -> Callable[..., None]:
    """Make a function for typer whose parameters are the fields of a dataclass: its own first, then inherited ones.

    ``work`` gets the arguments with the words that were stated; :func:`parsed` makes values of them.
    """
    hints, known = typed(arguments), declared(arguments)
    own = {one.name for kind in _own(arguments) for one in fields(kind) if one.name in inspect.get_annotations(kind)}
    parameters = []
    for stated in sorted(known.values(), key=lambda one: one.name not in own):
        default = inspect.Parameter.empty if stated.is_required else stated.field.default
        keyword = inspect.Parameter.KEYWORD_ONLY
        parameters.append(inspect.Parameter(stated.name, keyword, annotation=hints[stated.name], default=default))

    def called(**values: Any) -> None:
        work(arguments(**values))

    called.__name__, called.__doc__ = name, arguments.__doc__
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {one.name: one.annotation for one in parameters}
    return called


def parsed(arguments: A) -> A:
    """Give options the values that their words mean. Raises BadInput."""
    known = declared(type(arguments))
    return replace(arguments, **{name: _value(one, getattr(arguments, name)) for name, one in known.items()})


def _own(arguments: type[Arguments]) -> list[type]:
    """A class of arguments, and that of the options to which it adds those of a command."""
    bases = (base for base in arguments.__bases__ if not issubclass(base, Arguments))
    return [arguments, *(base for base in bases if any(one.declared.is_positional for one in declared(base).values()))]


def _value(stated: Stated, given: Any) -> Any:
    """What the words of an option mean."""
    return given if stated.declared.parse is None or given in (None, []) else stated.value(given)


# Usage errors: the message and a guess at what was meant, taken from the messages of typer

_ADVICE = re.compile(r"\s*(?:\((Possible options: [^)]*)\)|(Did you mean .*\?))\s*$")
_CHOICE = re.compile(r"'([^']*)' is not one of ('.*')")


def explain(problem: Any) -> tuple[str, str, str]:
    """Split a usage error into command ("" for ``planlang`` itself), message and advice."""
    path = problem.ctx.command_path if problem.ctx is not None else "planlang"
    message = problem.format_message()
    advice = _ADVICE.search(message)
    if getattr(problem, "option_name", None) == "--json":  # --json belongs to a command, and none was named
        return path.removeprefix("planlang").strip(), "Missing command.", f"{path} -h lists the commands"
    text = _ADVICE.sub("", message)
    if advice is not None:
        help = advice[1] or advice[2]
        help = help[0].lower() + help[1:]
    else:
        help = guessed_value(message) or f"{path} -h shows how it is used"
    return path.removeprefix("planlang").strip(), text, help


def guessed_value(message: str) -> str:
    """Guess which value of an option was meant; "" if none is similar."""
    match = _CHOICE.search(message)
    return guess(match[1], re.findall(r"'([^']*)'", match[2])).strip() if match is not None else ""
