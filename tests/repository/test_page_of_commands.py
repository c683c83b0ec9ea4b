"""docs/reference/commands.md lists every command as its ``--help`` does; run this file to write the page anew.

Run it with ``PYTHONPATH=tests/support``.
"""

from __future__ import annotations

import inspect
from collections.abc import Collection, Iterator
from enum import Enum
from pathlib import Path
from typing import Any, get_args

import pytest
import typer
from cli_runs import COMMANDS, invoke
from typer.models import ArgumentInfo

from executive.cli.app import app

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "commands.md"
SHARED = ("json", "verbose", "quiet")
"""Options that every command has; they are explained once, unless a command says more of one."""
TOP = """# Commands

Generated from the output of `planlang COMMAND --help`.

Every command has these options:

"""


def command_of(name: str) -> Any:
    found: Any = typer.main.get_command(app)
    for part in name.split():
        found = found.commands[part]
    return found


def parameters(name: str) -> Iterator[tuple[inspect.Parameter, Any, Any, str]]:
    """Yield the parameters of a command, their types, their declarations, and how they are written."""
    command = command_of(name)
    typed = {one.name: ", ".join((*one.opts, *one.secondary_opts)) for one in command.params}
    for one in inspect.signature(command.callback).parameters.values():
        kind, info = get_args(one.annotation)[:2]
        yield one, kind, info, typed[one.name]


def line(one: inspect.Parameter, kind: Any, info: Any, names: str) -> str:
    """Return the line of the page for a parameter."""
    kinds = [kind, *get_args(kind), *(inner for outer in get_args(kind) for inner in get_args(outer))]
    choices = next((each for each in kinds if isinstance(each, type) and issubclass(each, Enum)), None)
    value = info.metavar or ("|".join(choice.value for choice in choices) if choices else "NUMBER")
    if isinstance(info, ArgumentInfo):
        return f"* `{value}`: {info.help}"
    given = getattr(one.default, "value", one.default)
    is_told = isinstance(given, str | int | float) and not isinstance(given, bool) and "default" not in info.help
    return f"* `{names}{'' if kind is bool else f' {value}'}`: {info.help}" + (f" Default: {given}." if is_told else "")


def section(name: str, shared: Collection[str]) -> Iterator[str]:
    """Yield the lines of a command: its help, an example, its arguments and options."""
    command = command_of(name)
    yield from ("", f"## `planlang {name}`", "", inspect.cleandoc(command.callback.__doc__), "")
    yield f"`{command.epilog.removeprefix('Example: ')}`"
    own = [told for told in (line(*each) for each in parameters(name)) if told not in shared]
    yield from ("", *own) if own else ()


def page() -> str:
    """Return the whole page."""
    shared = [line(*each) for each in parameters("convert") if each[0].name in SHARED]
    return TOP + "\n".join([*shared, *(text for name in COMMANDS for text in section(name, shared))]) + "\n"


def test_the_page_lists_every_command_as_the_program_does() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), f"PYTHONPATH=tests/support python {__file__} writes it anew"


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_what_the_page_says_of_a_command(name: str) -> None:
    printed = "".join(invoke(*name.split(), "--help").stdout.split())
    assert "".join(inspect.cleandoc(command_of(name).callback.__doc__).split()) in printed
    for one, _, info, _ in parameters(name):
        assert "".join(info.help.split()) in printed, one.name


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
