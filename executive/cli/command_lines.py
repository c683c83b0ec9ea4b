"""Command lines of ``planlang run``: written from arguments, and read as the command reads them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields
from functools import cache
from typing import Any

import typer

from executive.cli.app import app
from executive.cli.arguments import RunArguments, SituationArguments

_SHOWN = ("json", "verbose", "quiet")
"""Options of what is printed, which no run depends on."""


def words_of(arguments: SituationArguments) -> Iterator[str]:
    """Yield the words of the options that the arguments state, as a user types them."""
    options = {one.name: one.opts[0] for one in _command().params}
    for one in fields(SituationArguments):
        value = getattr(arguments, one.name)
        if (not value and value != 0) or value is False or one.name in _SHOWN:
            continue
        for single in value if isinstance(value, list | tuple) else [value]:
            yield options[one.name]
            if single is not True:
                yield str(single)


def parsed(words: Sequence[str]) -> RunArguments:
    """Return the arguments that ``planlang run`` would get; raises a usage error as it does."""
    values = _command().make_context("run", list(words)).params
    return RunArguments(**{one.name: values[one.name] for one in fields(RunArguments)})


@cache
def _command() -> Any:
    return typer.main.get_command(app).commands["run"]  # type: ignore[attr-defined]
