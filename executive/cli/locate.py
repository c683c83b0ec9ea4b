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
    located = locate(replace(options, long_work=progress_of(arguments), waiting=partial(waiting, arguments)))
    data = located.as_json()
    if arguments.explain is not None and located.sheet is not None:
        data["picture"] = str(located.picture(arguments.explain, force=True))
    code = ExitCode.DONE if located.poses else ExitCode.FAILED
    code = ExitCode.MISSING_CAPABILITY if located.lacks_capability else code
    return Answer(code, located.diagnostics, str(located), data)
