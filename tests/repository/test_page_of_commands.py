"""docs/reference/commands.md lists every command as its ``--help`` does; run this file to write the page anew.

Run it with ``PYTHONPATH=tests/support``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from cli_runs import COMMANDS, invoke

from executive.cli.app import app

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "commands.md"
SHARED = ("json", "verbose", "quiet")
"""Options that every command has; they are explained once, unless a command says more of one."""
TOP = """# Commands

Generated from the output of `planlang COMMAND --help`.

Every command has these options:

"""


def command_of(name: str) -> Any:
    found: Any = app
    for part in name.split():
        found = found.commands[part]
    return found


def line(one: click.Parameter) -> str:
    """Return the line of the page for a parameter."""
    value = one.metavar or "|".join(getattr(one.type, "choices", ("NUMBER",)))
    if isinstance(one, click.Argument):
        return f"* `{value}`: {one.help}"
    names, is_flag = ", ".join((*one.opts, *one.secondary_opts)), one.type is click.BOOL
    is_told = isinstance(one.default, str | int | float) and not isinstance(one.default, bool)
    told = f" Default: {one.default}." if is_told and "default" not in (one.help or "") else ""
    return f"* `{names}{'' if is_flag else f' {value}'}`: {one.help}{told}"


def section(name: str, shared: Collection[str]) -> Iterator[str]:
    """Yield the lines of a command: its help, an example, its arguments and options."""
    command = command_of(name)
    yield from ("", f"## `planlang {name}`", "", command.help, "")
    yield f"`{command.epilog.removeprefix('Example: ')}`"
    own = [told for told in map(line, command.params) if told not in shared]
    yield from ("", *own) if own else ()


def page() -> str:
    """Return the whole page."""
    shared = [line(one) for one in command_of("convert").params if one.name in SHARED]
    return TOP + "\n".join([*shared, *(text for name in COMMANDS for text in section(name, shared))]) + "\n"


def test_the_page_lists_every_command_as_the_program_does() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), f"PYTHONPATH=tests/support python {__file__} writes it anew"


@pytest.mark.parametrize("name", COMMANDS)
def test_help_has_what_the_page_says_of_a_command(name: str) -> None:
    printed = "".join(invoke(*name.split(), "--help").stdout.split())
    assert "".join(command_of(name).help.split()) in printed
    for one in command_of(name).params:
        assert "".join((one.help or "").split()) in printed, one.name


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
