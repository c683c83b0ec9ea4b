"""Arguments that command line and library share: fields are the parameters of a command, the docstring is its help."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from executive.commands.base_arguments import Detail, OntologyArguments, TaskArguments
from executive.runs.settings import IgnoreUnread, Modules, RunSettings, SituationSettings, Urdf
from planlang.records import dataclass

Recipe = Annotated[str, typer.Argument(metavar="RECIPE", help="A recipe file, or the name of a bundled recipe.")]
RecipeOrPlan = Annotated[
    str, typer.Argument(metavar="RECIPE|PLAN", help="A recipe or plan file, or the name of a bundled recipe.")
]
Robot = Annotated[str | None, typer.Option(metavar="ROBOT", help="A robot file, or the name of a bundled robot.")]
Environment = Annotated[
    list[str] | None,
    typer.Option(
        metavar="MAP",
        help="Semantic map: a file (OWL or URDF), or the name of a bundled environment; further maps add things to it.",
    ),
]
Start = Annotated[
    str | None,
    typer.Option(metavar="X,Y,YAW", help="Start pose of the base [m, m, rad]; default: a free pose near the middle."),
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=THING|@FILE",
        help="Bind a parameter (NAME or STEP.PROPERTY) to a thing of the map, or a location to a phrase; @FILE: one "
        "binding per line of a file. Repeatable.",
    ),
]
Trust = Annotated[bool, typer.Option("--trust", help="Run Python code pulled from a server; read it first.")]
Accept = Annotated[
    list[str] | None,
    typer.Option(
        metavar="CODE", help="First apply uncertain fixes with this code to the recipe in memory; repeatable."
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite files that planlang did not write.")]
Units = Annotated[
    list[str] | None,
    typer.Option(
        metavar="UNIT", help="Express numbers of its dimension in this QUDT unit, such as Centimeter; repeatable."
    ),
]


class LogicReasoner(Enum):
    """Reasoners for ``check --reason``."""

    HERMIT = "hermit"
    PELLET = "pellet"


@dataclass(frozen=True, kw_only=True)
class CompileArguments(TaskArguments):
    """Compile a recipe to a plan in Python.

    With --output, an unedited copy is also written beside the plan, PLAN.base, for --merge to find your edits.
    Exit code 1: the merge has conflicts, which are marked in the plan as git marks them.
    """

    recipe: Recipe
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="PLAN", help="Write the plan to this file instead of stdout."),
    ] = None
    modules: Modules = None
    trust: Trust = False
    graph: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also draw the order of the steps, as .svg, .png, .dot or .mmd (Mermaid)."),
    ] = None
    scopes: Annotated[bool, typer.Option("--scopes/--no-scopes", help="Open a location scope at each base motion.")] = (
        True
    )
    data_flow: Annotated[
        bool, typer.Option("--dataflow/--no-dataflow", help="Order steps by data flow, and pass data between them.")
    ] = True
    merge: Annotated[
        bool,
        typer.Option("--merge", help="Merge your edits of the plan with what the recipe compiles to now."),
    ] = False
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite plans edited by hand, and files that planlang did not write.")
    ] = False


@dataclass(frozen=True, kw_only=True)
class CheckArguments(TaskArguments):
    """Check a recipe, a plan or a map; nothing is run.

    Recipe: lists all problems; only the first of several with the same advice. Folder: prints a table of its recipes.
    Map: counts its contents; with --verbose lists them.
    Plan: shows whether its recipe or the compiler has changed since it was compiled, and what was edited by hand.
    """

    file: Annotated[
        str,
        typer.Argument(metavar="RECIPE|PLAN|MAP", help="A file or a folder, or the name of a bundled recipe or map."),
    ]
    modules: Modules = None
    trust: Trust = False
    ignore_unread: IgnoreUnread = False
    fix: Annotated[
        bool, typer.Option("--fix", help="Write a copy with all safe fixes, NAME.fixed.EXT, and show the changes.")
    ] = False
    accept: Annotated[
        list[str] | None,
        typer.Option(metavar="CODE", help="With --fix: also apply uncertain fixes with this code; repeatable."),
    ] = None
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="With --fix: write the copy to this file.")
    ] = None
    force: Annotated[
        bool, typer.Option("--force", help="With --output: overwrite a file that planlang did not write.")
    ] = False
    reason: Annotated[
        bool,
        typer.Option("--reason", help="Also search for contradictions with a description-logic reasoner; needs Java."),
    ] = False
    reasoner: Annotated[LogicReasoner, typer.Option(help="With --reason: the reasoner.")] = LogicReasoner.HERMIT
    reason_seconds: Annotated[
        float, typer.Option(min=1.0, metavar="SECONDS", help="With --reason: time limit [s].")
    ] = 120.0

    @property
    def summed(self) -> Detail:
        """Print every advice: a check is run for it."""
        return Detail.ADVICE


@dataclass(frozen=True, kw_only=True)
class SituationArguments(TaskArguments, SituationSettings):
    """Options for the robot, its environment and its knowledge."""

    robot: Robot = None
    accept: Accept = None
    environment: Environment = None
    start: Start = None
    set_: Set = None
    trust: Trust = False


@dataclass(frozen=True, kw_only=True)
class RunArguments(SituationArguments, RunSettings):
    """Run a plan or a recipe in a simulated world.

    planlang run --resume TRACE resumes an interrupted run; name plan, robot and environment unless they are bundled.
    """

    file: Annotated[
        str | None,
        typer.Argument(metavar="RECIPE|PLAN", help="A recipe or plan file, or the name of a bundled recipe."),
    ] = None
    verbose: Annotated[
        bool, typer.Option("--verbose", help="List all notes and warnings, and actions inside process modules.")
    ] = False
    resume: Annotated[
        Path | None,
        typer.Option(metavar="TRACE", help="Resume this recorded run after the last completed step of its plan."),
    ] = None


@dataclass(frozen=True, kw_only=True)
class LocateArguments(OntologyArguments):
    """Find poses that match a phrase, for the robot's base or for a thing."""

    phrase: Annotated[
        str, typer.Argument(metavar="PHRASE", help='The location, e.g. "in reach of the bottle and near the bed".')
    ]
    robot: Robot = None
    urdf: Urdf = None
    environment: Environment = None
    start: Start = None
    of: Annotated[
        str | None,
        typer.Option(metavar="THING", help='Find poses of this thing, e.g. "the bottle"; default: of the base.'),
    ] = None
    count: Annotated[int, typer.Option(min=1, max=1000, metavar="N", help="Number of poses, best first.")] = 3
    explain: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the candidates and the reasons for rejection, as PNG or SVG."),
    ] = None
    units: Units = None
    ignore_unread: IgnoreUnread = False
    force: Force = False


Csv = Annotated[Path | None, typer.Option(metavar="FILE", help="Also write the rows as CSV.")]


@dataclass(frozen=True, kw_only=True)
class SweepArguments(SituationArguments):
    """Run a plan or a recipe in many worlds, and count the outcomes.

    The worlds are those of planlang run --seed 1, 2, ...: the same robot and map, with things displaced.
    Exit code 1: in some worlds the plan failed or the run crashed.
    """

    recipe: RecipeOrPlan
    worlds: Annotated[int, typer.Option(min=1, max=1_000_000, metavar="N", help="Number of worlds.")] = 100
    first: Annotated[
        int, typer.Option(min=0, metavar="N", help="The first seed; 0: things are where the map has them.")
    ] = 1
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            "--out",
            metavar="FILE",
            help="Append a line of JSON for each world; continue the sweep if the file exists.",
        ),
    ] = None
    processes: Annotated[
        int | None,
        typer.Option(min=1, max=1000, metavar="N", help="Number of worlds run in parallel; default: one per core."),
    ] = None
    shard: Annotated[
        str | None,
        typer.Option(
            metavar="K/N", help="Run only every N-th world, from the K-th on: the share of one of N machines."
        ),
    ] = None
    csv: Csv = None
    reports: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Write an HTML page of each world in which the plan fails; its run is repeated."
        ),
    ] = None
    seconds: Annotated[int, typer.Option(min=1, metavar="S", help="CPU time limit of a world [s].")] = 120
    memory: Annotated[int, typer.Option(min=100, metavar="MB", help="Memory limit of a world [MB].")] = 2000
