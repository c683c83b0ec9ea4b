"""``planlang locate``: poses that match a phrase are listed, and drawn."""

from __future__ import annotations

from executive.cli.arguments import LocateArguments
from executive.cli.console import Answer, ExitCode
from executive.cli.inputs import check_files, chosen, environments, planar, refuse
from executive.runs.locating import LocateOptions, locate
from planlang.diagnostics import Diagnostic
from planlang.files import Bundled
from planlang.outputs import PNG_OR_SVG, check_outputs


def command(arguments: LocateArguments) -> Answer:
    """Find poses; raises BadInput for what cannot be understood or used."""
    found = locate(options_of(arguments))
    data = found.as_json()
    if arguments.explain is not None and found.sheet is not None:
        data["picture"] = str(found.picture(arguments.explain, force=True))
    code = ExitCode.DONE if found.poses else ExitCode.FAILED
    code = ExitCode.MISSING_CAPABILITY if found.lacks_capability else code
    return Answer(code, found.diagnostics, str(found), data)


def options_of(arguments: LocateArguments) -> LocateOptions:
    """Return the options of the search that the arguments ask for; raises BadInput."""
    start = planar(arguments.start)
    problems: list[Diagnostic] = []
    check_files(problems, urdf=arguments.urdf)
    robot = chosen(Bundled.ROBOT, arguments.robot, None, problems, needs="locate")
    first, *further = (*(arguments.environment or ()),) or (None,)
    environment = chosen(Bundled.ENVIRONMENT, first, None, problems, needs="locate")
    additions = environments(further, problems)
    inputs = {"--urdf": arguments.urdf, "--robot": robot, "--environment": environment}
    outputs = {"--explain": arguments.explain}
    problems += check_outputs(outputs, inputs, formats={"--explain": PNG_OR_SVG}, force=arguments.force)
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
        long_work=arguments.progress,
        waiting=arguments.waiting,
    )
