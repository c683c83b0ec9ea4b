"""Arguments of commands: fields are parameters, the docstring is the help; those of the API's have its options.

Options that commands share come first, then the commands that run plans, and those that show runs. Other commands have
theirs in ``authoring_arguments`` and ``server_arguments``: a run reads only what it needs.
"""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

from executive.options.declaring import argument, option, output, output_folder
from executive.options.locating import LocateOptions
from executive.options.results import ResultFiles
from executive.options.running import (
    Accept,
    Environment,
    Force,
    IgnoreUnread,
    Modules,
    OntologyOptions,
    Robot,
    RunSettings,
    Set,
    SituationSettings,
    Start,
    SweepOptions,
    TaskOptions,
    Trust,
    Urdf,
    WhyOptions,
)
from planlang.diagnostics import WrongOption
from planlang.records import dataclass
from planlang.words import Option, Text


class Detail(Enum):
    """How many of its notes and warnings a command prints; it prints all errors."""

    NONE = "none"
    CODES = "codes"
    """The first of each code, with the number of others: many would hide the result."""
    ADVICE = "advice"
    """The first of each code and advice: for commands whose result they are."""
    ALL = "all"


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Options of every command."""

    json: Annotated[bool, option(help="Print one JSON object to stdout.")] = False
    verbose: Annotated[bool, option(help="List all notes and warnings, not only the first of each code.")] = False
    quiet: Annotated[bool, option(help="Print only errors to stderr, and no progress.")] = False

    @property
    def detail(self) -> Detail:
        """How many notes and warnings to print. Raises WrongOption for contradictory options."""
        if self.quiet and self.verbose:
            raise WrongOption(Option("quiet"), " and ", Option("verbose"), " exclude each other")
        return Detail.NONE if self.quiet else Detail.ALL if self.verbose else self.summed

    @property
    def summed(self) -> Detail:
        """How many to print by default."""
        return Detail.CODES

    @property
    def is_silent(self) -> bool:
        """True if only results and diagnostics are printed."""
        return self.json or self.quiet


@dataclass(frozen=True, kw_only=True)
class OntologyArguments(OntologyOptions, Arguments):
    """Options of commands that read ontologies."""


@dataclass(frozen=True, kw_only=True)
class TaskArguments(TaskOptions, Arguments):
    """Options of commands that read recipes."""


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


class Verdict(Enum):
    """What a comparison may show, by more than chance explains."""

    WORSE = "worse"
    """A variant reaches the goal less often than the first one."""
    DIFFERENT = "different"
    """Two variants do not reach it equally often."""


FailIf = Annotated[
    Verdict | None,
    option(
        help="Exit code 1 if the comparison shows a variant that reaches the goal less often than the first one "
        "(worse), or any difference (different)."
    ),
]


@dataclass(frozen=True, kw_only=True)
class CompareArguments(SweepOptions, Arguments):
    """Run variants of a plan or a recipe in the same worlds, and compare them.

    Name two variants or more with --vary or --variant. They are compared in pairs, world by world: how often each
    reaches its goal, how long it takes, and how sure the difference is. Whatever it is, the exit code is 0 unless
    --fail-if says otherwise.
    """

    fail_if: FailIf = None


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
    output: Annotated[Path, output_folder("Write narrative.ttl and poses.jsonl to this folder.")]
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
    output: Annotated[Path | None, output("Write the page to this file; default: TRACE.html.")] = None


@dataclass(frozen=True, kw_only=True)
class WhyArguments(WhyOptions, Arguments):
    """Find the smallest change after which a failed run reaches its goal, by running the plan again with changes.

    Tries what the failure advises, then single changes of the run, the map and the robot, then pairs, small ones first.
    Name plan, robot and environment unless they are bundled. Exit code 1: no change was found that helps.
    """


@dataclass(frozen=True, kw_only=True)
class PlaceArguments(Arguments):
    """Options for the place of maps in a knowledge base."""

    room: Annotated[str | None, option(metavar="TEXT", help="Only maps of this room: number or name.")] = None
    floor: Annotated[str | None, option(metavar="TEXT", help="Only maps of this floor.")] = None
    building: Annotated[str | None, option(metavar="TEXT", help="Only maps of this building.")] = None
    street: Annotated[str | None, option(metavar="TEXT", help="Only maps of this street, with or without number.")] = (
        None
    )
    city: Annotated[str | None, option(metavar="TEXT", help="Only maps of this city.")] = None


@dataclass(frozen=True, kw_only=True)
class EnableArguments(PlaceArguments, OntologyArguments):
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
class SweepMergeArguments(ResultFiles, Arguments):
    """Merge the shards of a sweep into one file."""

    files: Annotated[list[Path], argument(metavar="FILE...", help="Files written by planlang sweep --output.")]
    output: Annotated[Path, output("Write the merged sweep to this file.", "--out")]
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class SweepTableArguments(ResultFiles, Arguments):
    """Print the table of a recorded sweep, or compare several, world by world."""

    files: Annotated[list[Path], argument(metavar="FILE...", help="Files written by planlang sweep --output.")]
    reports: Annotated[
        list[Path] | None,
        option(
            metavar="FOLDER",
            help=Text(
                "Pages of worlds that the sweep wrote, for links of ", Option("report"), "; one folder per file."
            ),
        ),
    ] = None
    fail_if: FailIf = None
    force: Force = False
