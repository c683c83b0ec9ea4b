"""Arguments of the commands: one dataclass each, whose fields are its parameters and whose docstring is its help."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from executive.cli.base_arguments import Arguments, OntologyArguments, TaskArguments
from executive.cli.console import Detail
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
Output = Annotated[
    Path | None, typer.Option("-o", "--output", metavar="FILE", help="Write the text to this file, not to stdout.")
]
Units = Annotated[
    list[str] | None,
    typer.Option(metavar="UNIT", help="Show numbers of its dimension in this unit of QUDT: Centimeter; repeatable."),
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


class LogicReasoner(Enum):
    """The reasoners that ``check`` may ask."""

    HERMIT = "hermit"
    PELLET = "pellet"


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
