"""``planlang robot inspect``: a robot's parts, what its arms reach, and what it lacks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from executive.cli.arguments import Arguments, Force, Urdf, check_files, refuse, taking
from executive.cli.console import Answer, answer, say, silent
from planlang.diagnostics import Diagnostic
from planlang.outputs import check_outputs
from planlang.resources import Bundled


@dataclass(frozen=True, kw_only=True)
class InspectArguments(Arguments):
    """Arguments of ``planlang robot inspect``."""

    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="The robot: a file, or a bundled robot's name.")]
    urdf: Urdf = None
    picture: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw what the arms reach, as PNG.")] = None
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Record it for rerun (needs planlang[record]).")
    ] = None
    force: Force = False


@taking(InspectArguments)
def inspect_command(arguments: InspectArguments) -> None:
    """Show a robot's chains, joints, limits and postures, what its arms reach, and what is missing.

    Exit code 3 if the robot has no arm.
    """
    answer("robot inspect", lambda: _inspected(arguments), as_json=arguments.json)


def _inspected(arguments: InspectArguments) -> Answer:
    robot, urdf, picture, record = (
        Bundled.ROBOT.find(arguments.robot),
        arguments.urdf,
        arguments.picture,
        arguments.record,
    )
    problems: list[Diagnostic] = []
    check_files(problems, urdf=urdf)
    inputs = {"the robot": robot, "--urdf": urdf}
    outputs = {"--picture": picture, "--record": record}
    problems += check_outputs(outputs, inputs, pictures=["--picture"], force=arguments.force)
    if record is not None:
        from executive.pictures.recording import missing

        problems += missing()
    refuse(problems)
    from executive.cli.inspecting import inspect

    return inspect(robot, urdf, picture, record, silent if arguments.json else say)
