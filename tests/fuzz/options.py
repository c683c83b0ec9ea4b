"""The options of all commands, as click knows them."""

from __future__ import annotations

from functools import cache
from typing import Any

Option = tuple[str, str, bool]
"""Name, metavar, and whether it takes no value."""


@cache
def _commands() -> dict[tuple[str, ...], list[Option]]:

    from executive.cli.app import app

    found: dict[tuple[str, ...], list[Option]] = {}

    def look(command: Any, path: tuple[str, ...]) -> None:
        if hasattr(command, "commands"):
            for name, below in command.commands.items():
                look(below, (*path, name))
            return
        options = [one for one in command.params if one.param_type_name == "option"]
        found[path] = [(one.opts[-1], _metavar(one), bool(one.is_flag)) for one in options]

    look(app, ())
    return found


def _metavar(option: Any) -> str:
    return str(option.metavar or "|".join(getattr(option.type, "choices", ())))


def options_of(words: list[str]) -> list[Option]:
    """Options of the command that the words begin with."""
    commands = _commands()
    return commands[tuple(words[:2])] if tuple(words[:2]) in commands else commands[(words[0],)]
