"""``planlang locate``: a phrase, a robot and a map in, poses for the base or for a thing out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from executive.cli.arguments import (
    Environment,
    Force,
    OntologyArguments,
    Robot,
    Start,
    Urdf,
    VerboseArguments,
    check_files,
    chosen,
    planar,
    refuse,
    taking,
)
from executive.cli.console import Answer, answer, say, silent
from planlang.diagnostics import Diagnostic
from planlang.outputs import check_outputs
from planlang.resources import Bundled


@dataclass(frozen=True, kw_only=True)
class LocateArguments(OntologyArguments, VerboseArguments):
    """Arguments of ``planlang locate``."""

    phrase: Annotated[
        str, typer.Argument(metavar="PHRASE", help='The location, e.g. "in reach of the bottle and near the bed".')
    ]
    robot: Robot = None
    urdf: Urdf = None
    environment: Environment = None
    start: Start = None
    of: Annotated[
        str | None,
        typer.Option(metavar="THING", help='Find poses for this thing, e.g. "the bottle"; default: for the base.'),
    ] = None
    count: Annotated[int, typer.Option(min=1, max=1000, metavar="N", help="Number of poses, best first.")] = 3
    explain: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the candidates and why they were rejected, as PNG.")
    ] = None
    force: Force = False


@taking(LocateArguments)
def locate_command(arguments: LocateArguments) -> None:
    """Find poses that match a phrase, for the robot's base or for a thing."""
    start = planar(arguments.start)
    answer("locate", lambda: _located(arguments, start), as_json=arguments.json, all_notes=arguments.verbose)


def _located(arguments: LocateArguments, start: tuple[float, float, float] | None) -> Answer:
    problems: list[Diagnostic] = []
    check_files(problems, urdf=arguments.urdf)
    robot = chosen(Bundled.ROBOT, arguments.robot, None, problems, needs="locate")
    environment = chosen(Bundled.ENVIRONMENT, arguments.environment, None, problems, needs="locate")
    inputs = {"--urdf": arguments.urdf, "--robot": robot, "--environment": environment}
    outputs = {"--explain": arguments.explain}
    problems += check_outputs(outputs, inputs, pictures=["--explain"], force=arguments.force)
    refuse(problems)
    assert robot is not None
    assert environment is not None

    from executive.cli.locating import LocateOptions, locate

    return locate(
        LocateOptions(
            phrase=arguments.phrase,
            robot=robot,
            environment=environment,
            urdf=arguments.urdf,
            ontologies=arguments.folders,
            of=arguments.of,
            start=start,
            count=arguments.count,
            explain=arguments.explain,
            progress=silent if arguments.json else say,
        )
    )
