"""Commands about robots and places: locate, robot inspect. What is heavy is imported when it is needed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from executive.cli.console import Answer, answer, say
from executive.cli.inputs import find
from executive.cli.options import (
    AsJson,
    Ontologies,
    named,
    planar,
    refuse,
)
from executive.cli.outputs import check_outputs
from planlang.diagnostics import error
from planlang.resources import bundled

if TYPE_CHECKING:
    pass


def locate_command(
    phrase: Annotated[
        str, typer.Argument(metavar="PHRASE", help='What the place is, e.g. "in reach of the bottle and near the bed".')
    ],
    robot: Annotated[
        str | None, typer.Option(metavar="ROBOT", help="The robot's self-model: a file, or a bundled robot's name.")
    ] = None,
    urdf: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The robot's geometry, if the self-model does not name it.")
    ] = None,
    environment: Annotated[
        str | None, typer.Option(metavar="MAP", help="The semantic map: a file, or a bundled environment's name.")
    ] = None,
    start: Annotated[
        str | None, typer.Option(metavar="X,Y,YAW", help="Where the robot is [m, m, rad]; default: the middle.")
    ] = None,
    of: Annotated[
        str | None,
        typer.Option("--of", metavar="THING", help='What is to be put there, e.g. "the bottle"; default: the base.'),
    ] = None,
    count: Annotated[int, typer.Option(min=1, max=1000, metavar="N", help="How many places, best first.")] = 3,
    explain: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw what was looked at and what became of it, as PNG.")
    ] = None,
    ontologies: Ontologies = None,
    json: AsJson = False,
) -> None:
    """Find places for the robot's base, or for a thing, that a phrase tells."""
    base = planar(start)

    def work() -> Answer:
        problems = check_outputs({}, {"--urdf": urdf}, {"--explain": explain})
        if urdf is not None and not urdf.is_file():
            problems.append(error("C001", f"no such URDF file: {urdf}"))
        reason = "a place is looked for with --{what}"
        self_model = named("robot", robot, "robots", "", False, problems, reason=reason)
        semantic_map = named("environment", environment, "environments", "", False, problems, reason=reason)
        refuse(problems)
        assert self_model is not None
        assert semantic_map is not None

        from executive.cli.locating import LocateOptions, locate

        folders = tuple(ontologies or ())
        return locate(LocateOptions(phrase, self_model, semantic_map, urdf, folders, of, base, count, explain))

    answer("locate", work, as_json=json)


def inspect_command(
    robot: Annotated[
        str, typer.Argument(metavar="ROBOT", help="A self-model or robot file, or a bundled robot's name.")
    ],
    urdf: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The robot's geometry, if the self-model does not name it.")
    ] = None,
    picture: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw what the arms reach, as PNG.")] = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Record it for rerun (needs planlang[record]).")
    ] = None,
    json: AsJson = False,
) -> None:
    """Show a robot's chains, joints, limits and postures, what its arms reach, and what is missing."""

    def work() -> Answer:
        source = find("robot", robot, bundled("ontologies") / "robots")
        inputs = {"the robot": source, "--urdf": urdf}
        problems = check_outputs({"--record": record}, inputs, {"--picture": picture})
        if record is not None:
            from executive.pictures.recording import missing

            problems.extend(missing())
        if urdf is not None and not urdf.is_file():
            problems.append(error("C001", f"no such URDF file: {urdf}"))
        refuse(problems)
        from executive.cli.inspecting import InspectOptions, inspect

        return inspect(InspectOptions(source, urdf, picture, record, (lambda line: None) if json else say))

    answer("robot inspect", work, as_json=json)
