"""``planlang why``: the smallest change after which a failed run reaches its goal."""

from __future__ import annotations

from executive import api
from executive.cli.arguments import WhyArguments
from executive.cli.console import Answer, ExitCode, printer_of


def command(arguments: WhyArguments) -> Answer:
    """Search for the change; raises BadInput."""
    found = api.why(arguments, told=printer_of(arguments))
    code = ExitCode.DONE if found.found else ExitCode.FAILED
    return Answer(code, found.diagnostics, str(found), found.as_json())
