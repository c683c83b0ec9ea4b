"""Commands from dataclasses; command lines of ``planlang run``, written from arguments and parsed back."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING, fields
from functools import cache
from typing import Any, TypeVar, get_type_hints

import typer

from executive.commands.arguments import RunArguments, SituationArguments
from executive.commands.base_arguments import Arguments

A = TypeVar("A", bound=Arguments)

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
    app.command("run")(with_parameters("run", RunArguments, lambda arguments: None))
    return typer.main.get_command(app)


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
