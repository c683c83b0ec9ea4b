"""Options of a search for poses, from the arguments of ``planlang locate``."""

from __future__ import annotations

from executive.commands.arguments import LocateArguments
from executive.commands.inputs import check_files, chosen, environments, planar, refuse
from executive.runs.locating import LocateOptions
from planlang.diagnostics import Diagnostic
from planlang.files import Bundled
from planlang.outputs import PNG_OR_SVG, check_outputs
from planlang.words import Option


def options_of(arguments: LocateArguments) -> LocateOptions:
    """Make the options of a search. Raises BadInput."""
    start = planar(arguments.start)
    problems: list[Diagnostic] = []
    check_files(problems, urdf=arguments.urdf)
    robot = chosen(Bundled.ROBOT, arguments.robot, None, problems, needs="locate")
    first, *further = (*(arguments.environment or ()),) or (None,)
    environment = chosen(Bundled.ENVIRONMENT, first, None, problems, needs="locate")
    additions = environments(further, problems)
    inputs = {Option("urdf"): arguments.urdf, Option("robot"): robot, Option("environment"): environment}
    explain = Option("explain")
    problems += check_outputs(
        {explain: arguments.explain}, inputs, formats={explain: PNG_OR_SVG}, force=arguments.force
    )
    refuse(problems)
    assert robot is not None
    assert environment is not None
    return LocateOptions(
        phrase=arguments.phrase,
        robot=robot,
        environment=environment,
        additions=additions,
        ontologies=arguments.folders,
        urdf=arguments.urdf,
        start=start,
        of=arguments.of,
        count=arguments.count,
        units=tuple(arguments.units or ()),
        drawn=arguments.explain is not None,
        ignore_unread=arguments.ignore_unread,
    )
