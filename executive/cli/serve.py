"""``planlang serve``: the knowledge base over HTTP, and keys for its authors."""

from __future__ import annotations

from importlib.util import find_spec

from executive.cli.console import Answer
from executive.cli.server_arguments import ServeArguments
from planlang.diagnostics import BadInput, error
from planlang.extras import install_command

NEEDED = ("fastapi", "uvicorn", "jinja2", "python_multipart")
"""Modules of the extra that every server needs; their packages have the same names, with - for _."""


def command(arguments: ServeArguments) -> Answer:
    """Serve until interrupted, or make and revoke keys.

    Exit code 1 if an endpoint does not answer. Raises BadInput.
    """
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        message = f"the server needs packages that are not installed: {', '.join(missing).replace('_', '-')}"
        raise BadInput([error("K004", message, help=install_command("serve"))])
    from executive.cli import serving  # needs these packages

    return serving.command(arguments)
