"""``planlang locate``: poses that match a phrase are listed, and drawn."""

from __future__ import annotations

from functools import partial

from executive import api
from executive.cli.arguments import LocateArguments
from executive.cli.console import Answer, ExitCode, progress_of, waiting


def command(arguments: LocateArguments) -> Answer:
    """Find poses; raises BadInput for what cannot be understood or used."""
    at_work = partial(waiting, arguments)
    with at_work(lambda: "reading the map and the robot"):  # up to the search
        located = api.locate(arguments, long_work=progress_of(arguments), waiting=at_work)
    data = located.as_json()
    if arguments.explain is not None and located.drawn is not None:
        data["picture"] = str(arguments.explain)
    code = ExitCode.DONE if located.poses else ExitCode.FAILED
    code = ExitCode.MISSING_CAPABILITY if located.lacks_capability else code
    return Answer(code, located.diagnostics, str(located), data)
