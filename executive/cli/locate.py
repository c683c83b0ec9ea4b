"""``planlang locate``: poses that match a phrase are listed, and drawn."""

from __future__ import annotations

from functools import partial

from executive import api
from executive.cli.arguments import LocateArguments
from executive.cli.console import Answer, ExitCode, progress_of, waiting


def command(arguments: LocateArguments) -> Answer:
    """Find poses; raises BadInput for what cannot be understood or used."""
    located = api.locate(arguments, long_work=progress_of(arguments), waiting=partial(waiting, arguments))
    data = located.as_json()
    if arguments.explain is not None and located.drawn is not None:
        data["picture"] = str(arguments.explain)
    code = ExitCode.DONE if located.poses else ExitCode.FAILED
    code = ExitCode.MISSING_CAPABILITY if located.lacks_capability else code
    return Answer(code, located.diagnostics, str(located), data)
