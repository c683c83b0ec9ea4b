"""Arguments of the commands: one dataclass each, whose fields are its parameters and whose docstring is its help."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from executive.commands.arguments import (
    Accept,
    Csv,
    Environment,
    Force,
    Recipe,
    Robot,
    Set,
    SituationArguments,
    Start,
    Trust,
    Units,
)
from executive.commands.base_arguments import Arguments, OntologyArguments, TaskArguments
from executive.runs.settings import Modules, Urdf
from planlang.records import dataclass

Output = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the text to this file, not to stdout.")
]


class Syntax(Enum):
    """The syntaxes that are written, here again as their writers take long to import."""

    MANCHESTER = "manchester"
    TURTLE = "turtle"
    NTRIPLES = "ntriples"
    RDFXML = "rdfxml"


class Reading(Enum):
    """Semantics of requirements: closed under dependencies, or KnowRob's."""

    CLOSURE = "closure"
    ORIGINAL = "original"


class Listed(Enum):
    """What is listed."""

    ROBOTS = "robots"
    ROOMS = "rooms"
    RECIPES = "recipes"
    CLASSES = "classes"
    RELATIONS = "relations"
    FAILURES = "failures"


@dataclass(frozen=True, kw_only=True)
class ListArguments(Arguments):
    """List what there is to name: bundled robots, rooms and recipes, classes, relations of locations, failures.

    Exit code 1: nothing has the word in its name, label or description.
    """

    kind: Annotated[Listed, typer.Argument(help="What is listed.", show_default=False)]
    word: Annotated[
        str | None,
        typer.Argument(metavar="WORD", help="List only what has this in its name, label or description."),
    ] = None


@dataclass(frozen=True, kw_only=True)
class ShowArguments(TaskArguments):
    """Show what is in a file: a recipe, a plan, a trace, a map or a robot.

    As text: steps of a recipe or plan as a tree, what a map or robot has, how a run went. With --output also as a
    picture (maps and robots: PNG; recipes: SVG, PNG, DOT or Mermaid) or as a page (traces: HTML).
    """

    file: Annotated[str, typer.Argument(metavar="FILE", help="A file, or the name of a bundled recipe, robot or room.")]
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Draw it to this file; its suffix says how.")
    ] = None
    view: Annotated[
        str | None,
        typer.Option(metavar="VIEW", help="From where a map or robot is seen: X,Y,Z or X,Y,Z:X,Y,Z, overview, or top."),
    ] = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class ConvertArguments(Arguments):
    """Write an ontology, such as a recipe, in another syntax, and list what is lost."""

    file: Annotated[str, typer.Argument(metavar="FILE", help="An ontology file, in any supported syntax.")]
    to: Annotated[Syntax, typer.Option("--to", help="The syntax to write.", show_default=False)]
    output: Output = None
    units: Units = None
    force: Force = False


class Form(Enum):
    """A form in which experience is written."""

    NEEM = "neem"


@dataclass(frozen=True, kw_only=True)
class ExportArguments(Arguments):
    """Write what was done in a run as others do: a NEEM, a narrative in Turtle with poses over time.

    The narrative has SOMA's and DUL's terms: actions, participants, intervals, outcomes, failures, designators and
    what they were resolved to.
    """

    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="The trace of a run.")]
    to: Annotated[Form, typer.Option("--to", help="The form to write.", show_default=False)]
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="Write narrative.ttl and poses.jsonl here.")
    ]
    began: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="When the run began, in ISO 8601; default: 0 h on 1 January 1970, UTC."),
    ] = None
    poses: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Also use the log of planlang run --poses of the same run.")
    ] = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class MergeArguments(OntologyArguments):
    """Merge maps of one place, in one frame, and list what they disagree about.

    The newest pose of each thing counts; of equally new ones, and of other facts, those of the map that is named later.
    """

    maps: Annotated[
        list[str], typer.Argument(metavar="MAP...", help="Files of maps (OWL or URDF), or bundled environments' names.")
    ]
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the map to this file, not to stdout.")
    ] = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class MatchArguments(TaskArguments):
    """Check whether a robot has what a recipe requires, and say why.

    Exit code 0: the robot has it; 3: something is missing; 1: that is unknown. --task may name any action class, also
    one without sub-actions. What is missing, planlang enable looks for.
    """

    recipe: Recipe
    robot: Robot = None
    urdf: Urdf = None
    modules: Modules = None
    trust: Trust = False
    semantics: Annotated[Reading, typer.Option(help="How requirements are read; original: as KnowRob did.")] = (
        Reading.CLOSURE
    )


@dataclass(frozen=True, kw_only=True)
class ReportArguments(SituationArguments):
    """Write a page that shows the run of a trace: plan, world and causes on one clock.

    Where things were is found by repeating the run; name plan, robot and environment unless they are bundled. What
    cannot be repeated is shown without the world, and the page says why.
    """

    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="The trace of a run.")]
    file: Annotated[
        str | None,
        typer.Argument(metavar="RECIPE|PLAN", help="The recipe or plan that was run; needed unless it is bundled."),
    ] = None
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Write the page to this file; default: TRACE.html."),
    ] = None


@dataclass(frozen=True, kw_only=True)
class EnableArguments(OntologyArguments):
    """Find out what a robot lacks for a task, take exactly that from a knowledge base, and run the task.

    Taken are the recipe, recognition models of the things among its parameters, a map that has them, and what these
    depend on. Exit code 3: something is missing on both sides; then nothing is taken.
    """

    recipe: Annotated[
        str, typer.Argument(metavar="TASK|RECIPE", help="A class of actions, a recipe's label or name, or its file.")
    ]
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="URL|STORE",
            envvar="PLANLANG_SERVER",
            help="The knowledge base: a server, or the file of a store.",
        ),
    ] = None
    robot: Robot = None
    urdf: Urdf = None
    environment: Environment = None
    room: Annotated[str | None, typer.Option(metavar="TEXT", help="The map is of this room: number or name.")] = None
    floor: Annotated[str | None, typer.Option(metavar="TEXT", help="The floor that the map shows.")] = None
    building: Annotated[str | None, typer.Option(metavar="TEXT", help="The building that the map shows.")] = None
    street: Annotated[str | None, typer.Option(metavar="TEXT", help="The street, with or without number.")] = None
    city: Annotated[str | None, typer.Option(metavar="TEXT", help="The city that the map shows.")] = None
    store: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Keep what is taken in this folder; default: ROBOT_knowledge, here."),
    ] = None
    task: Annotated[str | None, typer.Option(metavar="CLASS", help="The task of a RECIPE that states several.")] = None
    modules: Modules = None
    trust: Trust = False
    limit: Annotated[
        int, typer.Option(min=1, metavar="N", help="Read at most N recipes and maps in search of a combination.")
    ] = 300
    dry: Annotated[bool, typer.Option("--dry", help="Explain what would be taken; take nothing.")] = False
    run: Annotated[bool, typer.Option("--run", help="Run the task with what the robot has then.")] = False
    set_: Set = None
    start: Start = None
    seed: Annotated[
        int, typer.Option(min=0, metavar="N", help="With --run: displace things by this seed; 0: none.")
    ] = 0
    trace: Annotated[Path | None, typer.Option(metavar="FILE", help="With --run: write the trace.")] = None


@dataclass(frozen=True, kw_only=True)
class ReplayArguments(TaskArguments):
    """Run a plan again from the trace of its run, without robot or world; stops at the first difference.

    What process modules did, which base poses were found, what was read and believed is taken from the trace.
    """

    trace: Annotated[Path, typer.Argument(metavar="TRACE", help="The trace of a run.")]
    file: Annotated[
        str | None,
        typer.Argument(metavar="RECIPE|PLAN", help="The recipe or plan that was run; needed unless it is bundled."),
    ] = None
    accept: Accept = None
    modules: Modules = None
    trust: Trust = False


@dataclass(frozen=True, kw_only=True)
class InspectArguments(Arguments):
    """Show a robot's chains, joints, limits and postures, what its arms reach, and what is missing.

    Exit code 3 if the robot has no arm.
    """

    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="The robot: a file, or a bundled robot's name.")]
    urdf: Urdf = None
    picture: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw what the arms reach, as PNG or SVG.")] = (
        None
    )
    record: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write what they reach as a recording for rerun (needs planlang[record])."),
    ] = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class MakeArguments(Arguments):
    """Make a robot file (TOML) from a URDF, for you to complete.

    Each derived value has its reason as a comment; what is missing stands there as a comment.
    """

    urdf: Annotated[Path, typer.Argument(metavar="URDF", help="The robot's URDF.")]
    srdf: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The robot's SRDF; default: that of the same name beside the URDF."),
    ] = None
    output: Output = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class SweepMergeArguments(Arguments):
    """Merge the shards of a sweep into one file."""

    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Files of planlang sweep --out.")]
    out: Annotated[Path, typer.Option(metavar="FILE", help="Write the sweep to this file.")]
    csv: Csv = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class SweepTableArguments(Arguments):
    """Print the table of a sweep again."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="A file of planlang sweep --out.")]
    csv: Csv = None
    force: Force = False
