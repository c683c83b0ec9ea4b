"""Arguments of the commands: one dataclass each, whose fields are its parameters and whose docstring is its help."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from executive.commands.base_arguments import Detail, OntologyArguments, TaskArguments
from executive.runs.settings import Modules, RunSettings, SituationSettings, Urdf
from planlang.records import dataclass

Recipe = Annotated[str, typer.Argument(metavar="RECIPE", help="A recipe's file, or a bundled recipe's name.")]
RecipeOrPlan = Annotated[
    str, typer.Argument(metavar="RECIPE|PLAN", help="A recipe's or plan's file, or a bundled recipe's name.")
]
Robot = Annotated[str | None, typer.Option(metavar="ROBOT", help="The robot: a file, or a bundled robot's name.")]
Environment = Annotated[
    list[str] | None,
    typer.Option(
        metavar="MAP",
        help="The semantic map: a file (OWL or URDF), or a bundled environment's name; further ones add things to it.",
    ),
]
Start = Annotated[
    str | None,
    typer.Option(metavar="X,Y,YAW", help="Pose of the base at the start [m, m, rad]; default: free, near the middle."),
]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=THING|@FILE",
        help="Bind a parameter (NAME or STEP.PROPERTY) to a thing of the map, a place to a phrase, or all that the "
        "lines of a file name; repeatable.",
    ),
]
Trust = Annotated[bool, typer.Option("--trust", help="Run Python that was pulled from a server: you have read it.")]
Accept = Annotated[
    list[str] | None,
    typer.Option(metavar="CODE", help="Fix the recipe in memory first, with uncertain fixes of this code; repeatable."),
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite files that planlang did not write.")]
Units = Annotated[
    list[str] | None,
    typer.Option(metavar="UNIT", help="Show numbers of its dimension in this unit of QUDT: Centimeter; repeatable."),
]


class LogicReasoner(Enum):
    """The reasoners that ``check`` may ask."""

    HERMIT = "hermit"
    PELLET = "pellet"


@dataclass(frozen=True, kw_only=True)
class CompileArguments(TaskArguments):
    """Compile a recipe to a plan in Python.

    With --output, what was compiled is also kept beside the plan, as PLAN.base: from it --merge knows what was edited.
    Exit code 1: the merge has conflicts, which are marked in the plan as git marks them.
    """

    recipe: Recipe
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PLAN", help="Write the plan to this file, not to stdout.")
    ] = None
    modules: Modules = None
    trust: Trust = False
    graph: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Also draw the order of the steps: a .svg, .png, .dot or .mmd (Mermaid) file."
        ),
    ] = None
    scopes: Annotated[bool, typer.Option("--scopes/--no-scopes", help="Open a location scope at each base motion.")] = (
        True
    )
    data_flow: Annotated[
        bool, typer.Option("--dataflow/--no-dataflow", help="Order steps by data flow, and pass data on.")
    ] = True
    merge: Annotated[
        bool,
        typer.Option("--merge", help="Keep the edits of the plan: merge them with what the recipe compiles to now."),
    ] = False
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite plans edited by hand, and files that planlang did not write.")
    ] = False


@dataclass(frozen=True, kw_only=True)
class CheckArguments(TaskArguments):
    """Check a recipe, a plan or a map; nothing is run.

    For a recipe, lists all problems, of those with the same advice the first; for a folder, tabulates its recipes; for
    a map, tells what it holds. For a plan, tells whether its recipe or the compiler has changed since it was compiled,
    and what a person has edited; shows both.
    """

    file: RecipeOrPlan
    modules: Modules = None
    trust: Trust = False
    fix: Annotated[
        bool, typer.Option("--fix", help="Write a copy with the safe fixes, NAME.fixed.EXT, and show the changes.")
    ] = False
    accept: Annotated[
        list[str] | None,
        typer.Option(metavar="CODE", help="With --fix: also apply uncertain fixes of this code; repeatable."),
    ] = None
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="With --fix: write the copy to this file.")
    ] = None
    force: Annotated[
        bool, typer.Option("--force", help="With --output: overwrite a file that planlang did not write.")
    ] = False
    reason: Annotated[
        bool,
        typer.Option("--reason", help="Also let a reasoner for description logic look for contradictions; needs Java."),
    ] = False
    reasoner: Annotated[LogicReasoner, typer.Option(help="With --reason: which one.")] = LogicReasoner.HERMIT
    reason_seconds: Annotated[
        float, typer.Option(min=1.0, metavar="SECONDS", help="With --reason: the time that it has.")
    ] = 120.0

    @property
    def summed(self) -> Detail:
        """Each advice is printed: it is what is asked for."""
        return Detail.ADVICE


@dataclass(frozen=True, kw_only=True)
class SituationArguments(TaskArguments, SituationSettings):
    """Options that say which robot runs a plan, where, and what it knows."""

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
        typer.Argument(metavar="RECIPE|PLAN", help="A recipe's or plan's file, or a bundled recipe's name."),
    ] = None
    verbose: Annotated[
        bool, typer.Option("--verbose", help="List all notes and warnings, and inner actions of modules.")
    ] = False
    resume: Annotated[
        Path | None,
        typer.Option(metavar="TRACE", help="Resume the run of this trace after the last completed step of its plan."),
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
        typer.Option(metavar="THING", help='Find poses for this thing, e.g. "the bottle"; default: for the base.'),
    ] = None
    count: Annotated[int, typer.Option(min=1, max=1000, metavar="N", help="Number of poses, best first.")] = 3
    explain: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the candidates and why they were rejected, as PNG or SVG.")
    ] = None
    units: Units = None
    force: Force = False


Csv = Annotated[Path | None, typer.Option(metavar="FILE", help="Also write the rows as a table of CSV.")]


@dataclass(frozen=True, kw_only=True)
class SweepArguments(SituationArguments):
    """Run a plan or a recipe in many worlds, and count how the runs end.

    The worlds are those of planlang run --seed 1, 2, ...: the same robot and map, but things lie elsewhere.
    Exit code 1: in some worlds the plan failed or the run crashed.
    """

    recipe: RecipeOrPlan
    worlds: Annotated[int, typer.Option(min=1, max=1_000_000, metavar="N", help="Number of worlds.")] = 100
    first: Annotated[int, typer.Option(min=0, metavar="N", help="The first seed; 0: things lie as in the map.")] = 1
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Append a line of JSON for each world; if the file is there, go on with it."),
    ] = None
    processes: Annotated[
        int | None, typer.Option(min=1, max=1000, metavar="N", help="Worlds at a time; default: one for each core.")
    ] = None
    shard: Annotated[
        str | None,
        typer.Option(metavar="K/N", help="Run every N-th world only, from the K-th on: a part for this machine."),
    ] = None
    csv: Csv = None
    reports: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Write a page of each world in which the plan fails, HTML; that run is made twice."
        ),
    ] = None
    seconds: Annotated[int, typer.Option(min=1, metavar="S", help="Most CPU time of one world [s].")] = 120
    memory: Annotated[int, typer.Option(min=100, metavar="MB", help="Most memory of one world [MB].")] = 2000
