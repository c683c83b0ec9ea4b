"""Commands from dataclasses; command lines of ``planlang run``, written from arguments and parsed back."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import MISSING, fields
from functools import cache, partial
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, get_args, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from executive.commands.arguments import RunArguments, SituationArguments
from executive.commands.base_arguments import Arguments

A = TypeVar("A", bound=Arguments)
_WHOLE, _DECIMAL = re.compile(r"0|-?[1-9][0-9]{0,8}"), re.compile(r"-?(?:0|[1-9][0-9]{0,8})(?:\.[0-9]{1,9})?")

_SHOWN = ("json", "verbose", "quiet")
"""Options of the output, which do not affect a run."""


def words_of(arguments: SituationArguments) -> Iterator[str]:
    """Yield the words of all options that are set, as a user types them."""
    options = {one.name: one.opts[0] for one in _command().params}
    for one in fields(SituationArguments):
        value = getattr(arguments, one.name)
        if value is None or value is False or one.name in _SHOWN:
            continue
        for single in value if isinstance(value, list | tuple) else [value]:
            yield options[one.name]
            if single is not True:
                yield str(single)


def parsed(words: Sequence[str]) -> RunArguments:
    """Parse the words of a ``planlang run``. Raises a usage error as the command does."""
    values = _command().make_context("run", list(words)).params
    return RunArguments(**{one.name: values[one.name] for one in fields(RunArguments)})


@cache
def _command() -> Any:
    app = typer.Typer(add_completion=False)
    app.command("run", cls=command_of(RunArguments))(with_parameters("run", RunArguments, lambda arguments: None))
    return typer.main.get_command(app)


def command_of(arguments: type[Arguments]) -> type[TyperCommand]:
    """Make the class of a command with the fields of a dataclass, which converts plain words by itself.

    Typer imports pydantic for each word, which takes a tenth of a short run. It still converts, and refuses, the rest.
    """
    hints = get_type_hints(arguments, include_extras=True)

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
    """Make a function for typer whose parameters are the fields of a dataclass: its own first, then inherited ones."""
    hints, own = get_type_hints(arguments, include_extras=True), inspect.get_annotations(arguments)
    parameters = []
    for field in sorted(fields(arguments), key=lambda field: field.name not in own):
        default = inspect.Parameter.empty if field.default is MISSING else field.default
        kind = inspect.Parameter.KEYWORD_ONLY
        parameters.append(inspect.Parameter(field.name, kind, annotation=hints[field.name], default=default))

    def called(**values: Any) -> None:
        work(arguments(**values))

    called.__name__, called.__doc__ = name, arguments.__doc__
    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {one.name: one.annotation for one in parameters}
    return called
