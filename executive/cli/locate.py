"""``planlang locate``: poses that match a phrase are listed, and drawn."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from executive.cli.console import progress_of, waiting
from executive.commands.answers import Answer, ExitCode
from executive.commands.arguments import LocateArguments
from executive.commands.locate import options_of
from executive.runs.locating import locate


def command(arguments: LocateArguments) -> Answer:
    """Find poses; raises BadInput for what cannot be understood or used."""
    options = options_of(arguments)
    found = locate(replace(options, long_work=progress_of(arguments), waiting=partial(waiting, arguments)))
    data = found.as_json()
    if arguments.explain is not None and found.sheet is not None:
        data["picture"] = str(found.picture(arguments.explain, force=True))
    code = ExitCode.DONE if found.poses else ExitCode.FAILED
    code = ExitCode.MISSING_CAPABILITY if found.lacks_capability else code
    return Answer(code, found.diagnostics, str(found), data)
