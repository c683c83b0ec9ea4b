"""Arguments of commands: fields are parameters, the docstring is the help; those of the API's have its options."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

from executive.cli.base_arguments import Arguments, Detail, OntologyArguments, TaskArguments
from executive.options.declaring import argument, option
from executive.options.recipes import CheckOptions, CompileOptions
from executive.options.running import (
    Accept,
    Csv,
    Environment,
    Force,
    IgnoreUnread,
    LocateOptions,
    Modules,
    Recipe,
    Robot,
    RunSettings,
    Set,
    SituationSettings,
    Start,
    SweepOptions,
    Trust,
    Units,
    Urdf,
)
from planlang.records import dataclass

Output = Annotated[
    Path | None, option("-o", "--output", metavar="FILE", help="Write the text to this file instead of stdout.")
]


class Syntax(Enum):
    """Output syntaxes; repeated here as the module of the writers is slow to import."""

    MANCHESTER = "manchester"
    TURTLE = "turtle"
    NTRIPLES = "ntriples"
    RDFXML = "rdfxml"
    FUNCTIONAL = "functional"
    OWLXML = "owlxml"


class Listed(Enum):
    """What ``list`` lists."""

    ROBOTS = "robots"
    ROOMS = "rooms"
    RECIPES = "recipes"
    CLASSES = "classes"
    ACTIONS = "actions"
    RELATIONS = "relations"
    FAILURES = "failures"


@dataclass(frozen=True, kw_only=True)
class CompileArguments(CompileOptions, Arguments):
    """Compile a recipe to a plan in Python.

    With --output, an unedited copy is also written beside the plan, PLAN.base, for --merge to find your edits.
    Exit code 1: the merge has conflicts, which are marked in the plan as git marks them.
    """


@dataclass(frozen=True, kw_only=True)
class CheckArguments(CheckOptions, Arguments):
    """Check a recipe, a plan or a map; nothing is run.

    Recipe: lists all problems; only the first of several with the same advice. Folder: prints a table of its recipes.
    Map: counts its contents; with --verbose lists them.
    Plan: shows whether its recipe or the compiler has changed since it was compiled, and what was edited by hand.
    """

    @property
    def summed(self) -> Detail:
        """Print every advice: a check is run for it."""
        return Detail.ADVICE


@dataclass(frozen=True, kw_only=True)
class RunArguments(RunSettings, Arguments):
    """Run a plan or a recipe in a simulated world.

    planlang run --resume TRACE resumes an interrupted run; name plan, robot and environment unless they are bundled.
    """

    verbose: Annotated[bool, option(help="List all notes and warnings, and actions inside process modules.")] = False


@dataclass(frozen=True, kw_only=True)
class LocateArguments(LocateOptions, Arguments):
    """Find poses that match a phrase, for the robot's base or for a thing."""


@dataclass(frozen=True, kw_only=True)
class SweepArguments(SweepOptions, Arguments):
    """Run a plan or a recipe in many worlds, and count the outcomes.

    The worlds are those of planlang run --seed 1, 2, ...: the same robot and map, with things displaced.
    Exit code 1: in some worlds the plan failed or the run crashed.
    """


@dataclass(frozen=True, kw_only=True)
class ListArguments(Arguments):
    """List bundled robots, rooms and recipes, or the classes, location relations and failures that may be named.

    The actions are those that bundled process modules perform.
    Lists of classes and failures are trees: with WORD, an asterisk marks the hits among their ancestors and subclasses.
    Exit code 1: no word of a name, label or description begins with WORD.
    """

    kind: Annotated[Listed, argument(help="What to list.", shows_default=False)]
    word: Annotated[
        str | None,
        argument(metavar="WORD", help="List only entries whose name or description has a word that begins so."),
    ] = None


@dataclass(frozen=True, kw_only=True)
class ShowArguments(TaskArguments):
    """Show the contents of a file: a recipe, a plan, a trace, a map or a robot.

    Prints the steps of a recipe or plan as a tree, the contents of a map, the parts of a robot, the course of a run.
    With --output also draws it (maps and robots: PNG; recipes: SVG, PNG, DOT or Mermaid; traces: an HTML page).
    """

    file: Annotated[str, argument(metavar="FILE", help="A file, or the name of a bundled recipe, robot or room.")]
    output: Annotated[
        Path | None,
        option("-o", "--output", metavar="FILE", help="Draw to this file; the suffix selects the format."),
    ] = None
    view: Annotated[
        str | None,
        option(metavar="VIEW", help="Viewpoint for a map or robot [m]: X,Y,Z or X,Y,Z:X,Y,Z, overview, or top."),
    ] = None
    ignore_unread: IgnoreUnread = False
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class ConvertArguments(Arguments):
    """Convert an ontology, such as a recipe, to another syntax, and list what is lost."""

    file: Annotated[str, argument(metavar="FILE", help="An ontology file, in any supported syntax.")]
    to: Annotated[Syntax, option("--syntax", "--to", help="The target syntax.", shows_default=False)]
    output: Output = None
    units: Units = None
    ignore_unread: IgnoreUnread = False
    force: Force = False


class Form(Enum):
    """Formats for experience."""

    NEEM = "neem"


@dataclass(frozen=True, kw_only=True)
class ExportArguments(Arguments):
    """Export a run as a NEEM: a narrative in Turtle, and poses over time.

    The narrative uses the terms of SOMA and DUL: actions, participants, intervals, outcomes, failures, designators and
    their resolutions.
    """

    trace: Annotated[Path, argument(metavar="TRACE", help="The trace of a run.")]
    to: Annotated[Form, option("--format", "--to", help="The target format.", shows_default=False)]
    output: Annotated[
        Path,
        option("-o", "--output", metavar="FOLDER", help="Write narrative.ttl and poses.jsonl to this folder."),
    ]
    began: Annotated[
        str | None,
        option(metavar="TIME", help="Start time of the run, in ISO 8601; default: 1970-01-01T00:00:00Z."),
    ] = None
    poses: Annotated[
        Path | None,
        option(metavar="FILE", help="Also use the pose log that planlang run --poses wrote of this run."),
    ] = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class MergeArguments(OntologyArguments):
    """Merge maps of one place, in one frame, and list conflicts.

    The newest pose of each thing wins; for equally new poses, and for all other facts, the map named later wins.
    """

    maps: Annotated[
        list[str], argument(metavar="MAP...", help="Map files (OWL or URDF), or names of bundled environments.")
    ]
    output: Annotated[
        Path | None,
        option("-o", "--output", metavar="FILE", help="Write the map to this file instead of stdout."),
    ] = None
    ignore_unread: IgnoreUnread = False
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class MatchArguments(TaskArguments):
    """Check whether a robot has what a recipe requires, and explain why.

    Exit code 0: the robot has it; 3: something is missing; 1: unknown. --task may name any action class, even one
    without sub-actions. planlang enable searches a knowledge base for what is missing.
    """

    recipe: Recipe
    robot: Robot = None
    urdf: Urdf = None
    modules: Modules = None
    trust: Trust = False


@dataclass(frozen=True, kw_only=True)
class ReportArguments(SituationSettings, Arguments):
    """Write an HTML page of a recorded run: plan, world and causes on one time line.

    The run is repeated to find where things were; name plan, robot and environment unless they are bundled. If it
    cannot be repeated, the page has no world and explains why.
    """

    trace: Annotated[Path, argument(metavar="TRACE", help="The trace of a run.")]
    file: Annotated[
        str | None,
        argument(metavar="RECIPE|PLAN", help="The recipe or plan that was run; needed unless it is bundled."),
    ] = None
    output: Annotated[
        Path | None,
        option("-o", "--output", metavar="FILE", help="Write the page to this file; default: TRACE.html."),
    ] = None


@dataclass(frozen=True, kw_only=True)
class EnableArguments(OntologyArguments):
    """Find out what a robot lacks for a task, download exactly that from a knowledge base, and run the task.

    Downloads the recipe, recognition models of the things among its parameters, a map that has them, and their
    dependencies. Exit code 3: something needed is available on neither side; nothing is downloaded.
    """

    recipe: Annotated[
        str,
        argument(metavar="TASK|RECIPE", help="An action class, the label or name of a recipe, or a recipe file."),
    ]
    source: Annotated[
        str | None,
        option(
            "--from",
            metavar="URL|STORE",
            envvar="PLANLANG_SERVER",
            help="The knowledge base: a server, or a store file.",
        ),
    ] = None
    robot: Robot = None
    urdf: Urdf = None
    environment: Environment = None
    room: Annotated[str | None, option(metavar="TEXT", help="Only maps of this room: number or name.")] = None
    floor: Annotated[str | None, option(metavar="TEXT", help="Only maps of this floor.")] = None
    building: Annotated[str | None, option(metavar="TEXT", help="Only maps of this building.")] = None
    street: Annotated[str | None, option(metavar="TEXT", help="Only maps of this street, with or without number.")] = (
        None
    )
    city: Annotated[str | None, option(metavar="TEXT", help="Only maps of this city.")] = None
    store: Annotated[
        Path | None,
        option(
            "--folder",
            "--store",
            metavar="FOLDER",
            help="Folder for downloads; default: ROBOT_knowledge in the current folder.",
        ),
    ] = None
    task: Annotated[str | None, option(metavar="CLASS", help="The task, if RECIPE states several.")] = None
    modules: Modules = None
    trust: Trust = False
    limit: Annotated[
        int, option(least=1, metavar="N", help="Read at most N recipes and maps to find a combination.")
    ] = 300
    dry: Annotated[bool, option(help="Explain what would be downloaded, and stop.")] = False
    run: Annotated[bool, option(help="Then run the task.")] = False
    ignore_unread: IgnoreUnread = False
    set: Set = None
    start: Start = None
    seed: Annotated[
        int, option(least=0, metavar="N", help="With --run: seed for displacing things; 0: displace nothing.")
    ] = 0
    trace: Annotated[Path | None, option(metavar="FILE", help="With --run: write the trace.")] = None


@dataclass(frozen=True, kw_only=True)
class ReplayArguments(TaskArguments):
    """Replay a plan from the trace of its run, without robot or world; stop at the first difference.

    Results of process modules, base poses, sensor readings and beliefs are taken from the trace.
    """

    trace: Annotated[Path, argument(metavar="TRACE", help="The trace of a run.")]
    file: Annotated[
        str | None,
        argument(metavar="RECIPE|PLAN", help="The recipe or plan that was run; needed unless it is bundled."),
    ] = None
    accept: Accept = None
    modules: Modules = None
    trust: Trust = False


@dataclass(frozen=True, kw_only=True)
class InspectArguments(Arguments):
    """Show a robot's joints and postures, what its hands hold, its reach and doorways, and what is missing.

    Exit code 3 if the robot has no arm.
    """

    robot: Annotated[str, argument(metavar="ROBOT", help="A robot file, or the name of a bundled robot.")]
    urdf: Urdf = None
    picture: Annotated[
        Path | None, option(metavar="FILE", help="Draw the robot, its hands and its reach, as PNG or SVG.")
    ] = None
    record: Annotated[
        Path | None,
        option(metavar="FILE", help="Write the reach as a recording for rerun (needs the extra record)."),
    ] = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class MakeArguments(Arguments):
    """Make a robot file (TOML) from a URDF, for you to complete.

    A comment gives the reason for each derived value; missing values are comments, too.
    """

    urdf: Annotated[Path, argument(metavar="URDF", help="The robot's URDF.")]
    srdf: Annotated[
        Path | None,
        option(metavar="FILE", help="The robot's SRDF; default: the file of the same name beside the URDF."),
    ] = None
    output: Output = None
    force: Force = False

    @property
    def summed(self) -> Detail:
        """Print every missing part: the user has to complete the file."""
        return Detail.ADVICE


@dataclass(frozen=True, kw_only=True)
class SweepMergeArguments(Arguments):
    """Merge the shards of a sweep into one file."""

    files: Annotated[list[Path], argument(metavar="FILE...", help="Files written by planlang sweep --output.")]
    output: Annotated[
        Path,
        option("-o", "--output", "--out", metavar="FILE", help="Write the merged sweep to this file."),
    ]
    csv: Csv = None
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class SweepTableArguments(Arguments):
    """Print the table of a recorded sweep."""

    file: Annotated[Path, argument(metavar="FILE", help="A file written by planlang sweep --output.")]
    csv: Csv = None
    force: Force = False
