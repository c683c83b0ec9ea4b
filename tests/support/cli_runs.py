"""The command ``planlang``, run in the process of a test."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from click.testing import CliRunner, Result

from executive.cli.app import app


def invoke(*arguments: object) -> Result:
    """Run the command."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments], prog_name="planlang")


def answer(*arguments: object) -> dict[str, Any]:
    """Return what the command answers, as JSON."""
    result = invoke(*arguments, "--json")
    assert "Traceback" not in result.output, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def _names(group: Any, before: str = "") -> Iterator[str]:
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from _names(command, f"{before}{name} ")
        else:
            yield f"{before}{name}"


COMMANDS = tuple(_names(app))
"""All commands, such as ``robot inspect``, in the order of the help."""
