"""The options of all commands, as typer knows them."""

from __future__ import annotations

from enum import Enum
from functools import cache
from typing import Any

Option = tuple[str, str, bool]
"""Name, metavar, and whether it takes no value."""


@cache
def _commands() -> dict[tuple[str, ...], list[Option]]:
    import typer

    from executive.cli.app import app

    found: dict[tuple[str, ...], list[Option]] = {}

    def look(command: Any, path: tuple[str, ...]) -> None:
        if hasattr(command, "commands"):
            for name, below in command.commands.items():
                look(below, (*path, name))
            return
        options = [one for one in command.params if one.param_type_name == "option"]
        found[path] = [(one.opts[-1], _metavar(one), bool(one.is_flag)) for one in options]

    look(typer.main.get_command(app), ())
    return found


def _metavar(option: Any) -> str:
    kind = getattr(getattr(option, "type_descriptor", None), "annotation", None)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return "|".join(str(one.value) for one in kind)
    return str(option.metavar or "N" if kind in (int, float) else option.metavar or "")


def options_of(words: list[str]) -> list[Option]:
    """Options of the command that the words begin with."""
    commands = _commands()
    return commands[tuple(words[:2])] if tuple(words[:2]) in commands else commands[(words[0],)]
