"""Options of runs, of sweeps, and of searches for what a failed run lacked."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from executive.options.declaring import (
    BasePose,
    InHeader,
    Name,
    argument,
    bindings,
    faults,
    goals,
    grasp,
    name,
    names,
    option,
    planar,
    shard,
    view,
    written,
)
from executive.options.engines import LOCAL, engine, seconds
from executive.options.results import ResultFiles
from executive.options.varying import labelled, varied
from planlang.designators import GRASPS
from planlang.diagnostics import BadInput, error
from planlang.language.source import PlanSource
from planlang.outputs import PNG, WEBP
from planlang.records import dataclass
from planlang.words import Option, Text

if TYPE_CHECKING:
    from planlang.compiler import CompiledPlan

    Source: TypeAlias = str | os.PathLike[str] | PlanSource | CompiledPlan
else:
    Source = Any  # a run of a plan needs no compiler
"""Name of a bundled recipe, path of a recipe or plan, its text (several lines), or a plan in memory."""


def source(given: Any) -> Source:
    """Check what may be a recipe or a plan. Raises BadInput."""
    if isinstance(given, str | os.PathLike | PlanSource) or isinstance(getattr(given, "plan_source", None), PlanSource):
        found: Source = given
        return found
    advice = "write the name of a bundled recipe, a path, or the text"
    raise BadInput([error("C040", f"{given!r} is neither a recipe nor a plan", help=advice)])


Recipe = Annotated[
    Source, argument(metavar="RECIPE", help="A recipe file, or the name of a bundled recipe.", parse=source)
]
RecipeOrPlan = Annotated[
    Source,
    argument(metavar="RECIPE|PLAN", help="A recipe or plan file, or the name of a bundled recipe.", parse=source),
]
Robot = Annotated[
    Name | None, option(metavar="ROBOT", help="A robot file, or the name of a bundled robot.", parse=name)
]
Environment = Annotated[
    Name | list[Name] | None,
    option(
        metavar="MAP",
        help="Semantic map: a file (OWL or URDF), or the name of a bundled environment; further maps add things to it.",
        parse=names,
        is_repeatable=True,
    ),
]
World = Annotated[
    Name | list[Name] | None,
    option(
        metavar="MAP",
        help="What is there, unlike the environment, which the robot believes: maps as for that, or the environment "
        "with the changes of a JSON file; default: as the environment.",
        parse=names,
        is_repeatable=True,
        in_header=InHeader("world", taken=False),
    ),
]
Start = Annotated[
    BasePose | None,
    option(
        metavar="X,Y,YAW",
        help="Start pose of the base [m, m, rad]; default: a free pose near the middle.",
        parse=planar,
    ),
]
Set = Annotated[
    Mapping[str, str] | None,
    option(
        metavar="NAME=THING|@FILE",
        help="Bind a parameter (NAME or STEP.PROPERTY) to a thing of the map, or a location to a phrase; @FILE: one "
        "binding per line of a file. Repeatable.",
        parse=bindings,
        is_repeatable=True,
    ),
]
Goals = Annotated[
    list[Any] | None,
    option(
        metavar="GOAL",
        help="What has to hold in the simulated world after the plan, such as 'bottle1 held by patient1', 'cabinet1 "
        "closed' or '3 Cup on table1'. Repeatable.",
        parse=goals,
        is_repeatable=True,
        in_header=InHeader("goals"),
    ),
]
Trust = Annotated[bool, option(help="Run Python code pulled from a server; read it first.")]
Accept = Annotated[
    list[str] | None,
    option(metavar="CODE", help="First apply uncertain fixes with this code to the recipe in memory; repeatable."),
]
Force = Annotated[bool, option(help="Overwrite files that planlang did not write.")]
Units = Annotated[
    list[str] | None,
    option(metavar="UNIT", help="Express numbers of its dimension in this QUDT unit, such as Centimeter; repeatable."),
]
Urdf = Annotated[Path | None, option(metavar="FILE", help="The robot's URDF, if the robot file names none.")]
Modules = Annotated[
    list[Path] | None,
    option(
        metavar="FILE.py",
        help="Also load the process modules of this Python file; repeatable.",
        in_header=InHeader("modules", taken=False),
    ),
]
IgnoreUnread = Annotated[
    bool,
    option(
        help="Go on without things of a map, with a shape or a pose, that cannot be read.",
        in_header=InHeader("ignores_unread"),
    ),
]
On = Annotated[
    str,
    option(
        metavar="local|dask|ADDRESS",
        help="Where worlds run: on this machine (local), on a cluster of dask.distributed that is started here (dask), "
        "or on the cluster of this scheduler, tcp://HOST:8786 or tls://HOST:8786.",
        parse=engine,
    ),
]
ClusterWait = Annotated[
    float,
    option(metavar="SECONDS", help="Give up after this time without a worker of the cluster.", parse=seconds),
]


@dataclass(frozen=True, kw_only=True)
class OntologyOptions:
    """Options of what reads ontologies."""

    ontologies: Annotated[
        list[Path] | None, option(metavar="DIR", help="Also search this folder for imports; repeatable.")
    ] = None

    @property
    def folders(self) -> tuple[Path, ...]:
        """Folders to search for imports. Raises BadInput if one is no folder."""
        folders = tuple(self.ontologies or ())
        wrong = [path for path in folders if not os.path.isdir(path)]
        if wrong:
            raise BadInput([error("C001", Text(Option("ontologies", path), " is not a folder")) for path in wrong])
        return folders


@dataclass(frozen=True, kw_only=True)
class TaskOptions(OntologyOptions):
    """Options of what reads recipes."""

    task: Annotated[
        str | None, option(metavar="CLASS", help="The task: local name or IRI of an action class in the recipe.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class SituationSettings(TaskOptions):
    """Options for the robot, its environment and its knowledge: what it has at its disposal when it runs a plan."""

    robot: Robot = None
    environment: Environment = None
    world: World = None
    urdf: Urdf = None
    models: Annotated[
        list[Path] | None,
        option(
            metavar="FOLDER",
            help="Folder of the recognition models (and programs and maps) that the robot has; it recognises no other "
            "classes. Repeatable.",
            in_header=InHeader("given", taken=False),
        ),
    ] = None
    accept: Accept = None
    start: Start = None
    schedule: Annotated[
        int | None, option(least=0, metavar="K", help="Run concurrent tasks in another order, which K determines.")
    ] = None
    set: Set = None
    arm: Annotated[
        str | None,
        option(
            metavar="NAME",
            help="Grasp with this arm, with another only where it finds no way.",
            in_header=InHeader("arm"),
        ),
    ] = None
    grasp: Annotated[
        str | None,
        option(
            metavar="|".join(GRASPS),
            help="Grasp things from there, from elsewhere only where it finds no way.",
            parse=grasp,
            in_header=InHeader("grasp"),
        ),
    ] = None
    attempts: Annotated[
        int | None,
        option(
            least=0, most=100, metavar="N", help="Let each recovery try N times more.", in_header=InHeader("attempts")
        ),
    ] = None
    patience: Annotated[
        float | None,
        option(
            least=0.1,
            most=1000,
            metavar="FACTOR",
            help="Let the run take so many times as much plan time, further attempts and searches for places before "
            "it gives up; by default 600 s, 100 and 200, and more for each step of the plan.",
            in_header=InHeader("patience"),
        ),
    ] = None
    before: Annotated[
        list[str] | None,
        option(
            metavar="ACTION[@STEP]",
            help="Perform an action before the plan, such as 'OpeningAContainerArtifact door1', or before the step "
            "whose path follows an @, as failures state it: 'SettingAsideAnObject cup1@PATH'. Repeatable.",
            in_header=InHeader("before"),
        ),
    ] = None
    trust_map: Annotated[
        bool,
        option(help="Take the map's poses as seen; needs no camera.", in_header=InHeader("trusts_map")),
    ] = False
    unknown: Annotated[
        list[str] | None,
        option(
            metavar="THING",
            help="Hide the pose of this thing, or of the things of this class, from the robot; all: of everything "
            "except rooms. Repeatable.",
            in_header=InHeader("unknown"),
        ),
    ] = None
    goal: Goals = None
    no_recoveries: Annotated[
        bool,
        option(
            help="Run the plan without its failure handling: the first failure ends it.",
            in_header=InHeader("no_recoveries"),
        ),
    ] = False
    fault: Annotated[
        list[str] | None,
        option(
            metavar="FAULT",
            help="Let something go wrong in the simulated world, such as gripper:misses@1 or camera:blind@3s-8s; "
            "spaces separate several. Repeatable.",
            parse=faults,
            is_repeatable=True,
            in_header=InHeader("faults"),
        ),
    ] = None
    faults: Annotated[
        Path | None,
        option(
            metavar="FILE",
            help="Let the faults of this file happen, in TOML: faults, rate, and how the run is expected to end.",
        ),
    ] = None
    fault_rate: Annotated[
        float | None,
        option(
            least=0,
            most=1,
            metavar="P",
            help="Let something go wrong by chance with this probability at each opportunity, by the seed.",
            in_header=InHeader("fault_rate"),
        ),
    ] = None
    camera_noise: Annotated[
        float | None,
        option(
            least=0,
            most=100,
            metavar="FACTOR",
            help="Multiply by this how the camera errs as the robot file states it, by the seed; 0: exact. If the file "
            "states nothing, 1 is a typical depth camera.",
            in_header=InHeader("camera_noise"),
        ),
    ] = None
    ignore_unread: IgnoreUnread = False
    modules: Modules = None
    trust: Trust = False
    force: Annotated[
        bool,
        option(
            help="Run even if robot or program lacks something; overwrite files that planlang did not write.",
        ),
    ] = False


@dataclass(frozen=True, kw_only=True)
class RunSettings(SituationSettings):
    """Options of one run: its world and its output files."""

    recipe: Annotated[
        Source | None,
        argument(metavar="RECIPE|PLAN", help="A recipe or plan file, or the name of a bundled recipe.", parse=source),
    ] = None
    seed: Annotated[
        int | None,
        option(least=0, metavar="N", help="Seed for displacing things in the simulated world; 0: displace nothing."),
    ] = None
    apply: Annotated[
        Path | None,
        option(
            metavar="FILE",
            help="Change the map, and options, as a failed run advises: its JSON, or a list of changes.",
        ),
    ] = None
    gui: Annotated[bool, option(help="Show the world in a window.", is_shown=True)] = False
    trace: Annotated[Path | None, written("Write the trace of the run, as JSON Lines.")] = None
    picture: Annotated[Path | None, written("Write a picture of the final scene, as PNG.", PNG)] = None
    video: Annotated[Path | None, written("Write a video of the run beside its plan, as animated WebP.", WEBP)] = None
    view: Annotated[
        str | None,
        option(
            metavar="X,Y,Z[:X,Y,Z]",
            help="Viewpoint of picture and video [m], and the point to look at; or overview, or top.",
            parse=view,
            is_shown=True,
        ),
    ] = None
    record: Annotated[Path | None, written("Write a recording for rerun (needs the extra record).")] = None
    report: Annotated[
        Path | None, written("Write an HTML page of the run: plan, world and causes on one time line.")
    ] = None
    watch: Annotated[
        bool,
        option(
            help="Show the run in a browser on this computer while it runs; pause or step it there.",
            is_shown=True,
        ),
    ] = False
    watch_tree: Annotated[
        bool,
        option(help="Show the steps of the plan as a tree in the terminal while it runs.", is_shown=True),
    ] = False
    poses: Annotated[
        Path | None, written("Log the poses of things and links, as JSON Lines, for the export of experience.")
    ] = None
    upload: Annotated[Path | None, written("Write the map that the plan uploads, in Manchester syntax.")] = None
    update_map: Annotated[
        Path | None, written("Write the map, updated with what the robot knows at the end, in Manchester syntax.")
    ] = None
    resume: Annotated[
        Path | None,
        option(metavar="TRACE", help="Resume this recorded run after the last completed step of its plan."),
    ] = None
    world_as_left: Annotated[
        bool,
        option(
            help=Text("With ", Option("resume"), ": the world is still as the trace left it; do not restore it."),
        ),
    ] = False


@dataclass(frozen=True, kw_only=True)
class SweepOptions(SituationSettings, ResultFiles):
    """Options of one run in many worlds."""

    recipe: RecipeOrPlan
    worlds: Annotated[int, option(least=1, most=1_000_000, metavar="N", help="Number of worlds.")] = 100
    first: Annotated[
        int, option(least=0, metavar="N", help="The first seed; 0: things are where the map has them.")
    ] = 1
    output: Annotated[
        Path | None,
        written(
            "Append a line of JSON for each world; continue the sweep if the file exists.",
            (),
            "-o",
            "--output",
            "--out",
        ),
    ] = None
    processes: Annotated[
        int | None,
        option(
            least=1,
            most=1000,
            metavar="N",
            help="Number of worlds run in parallel on this machine; default: one per core.",
        ),
    ] = None
    on: On = LOCAL
    cluster_wait: ClusterWait = 300.0
    shard: Annotated[
        tuple[int, int] | None,
        option(
            metavar="K/N",
            help="Run only every N-th world, from the K-th on: the share of one of N machines.",
            parse=shard,
        ),
    ] = None
    python: Annotated[
        Path | None,
        option(
            metavar="PYTHON",
            help="Run the worlds on this machine with the planlang of this interpreter, such as another checkout's.",
        ),
    ] = None
    vary: Annotated[
        Mapping[str, list[Any]] | None,
        option(
            metavar="NAME=V1,V2",
            help="Run each world with each of these values of an option or a parameter, and with each combination if "
            "repeated for others. Repeat a name for values with commas: NAME=V1, then NAME=V2.",
            parse=varied,
            is_repeatable=True,
        ),
    ] = None
    variant: Annotated[
        Mapping[str, Mapping[str, Any] | list[str]] | None,
        option(
            metavar='"LABEL: OPTIONS"',
            help="Run each world with these options instead of those of the command, under this name; they may begin "
            "with another recipe or plan. Repeatable.",
            parse=labelled,
            is_repeatable=True,
        ),
    ] = None
    reports: Annotated[
        Path | None,
        option(metavar="FOLDER", help="Write an HTML page of each world in which the plan fails; its run is repeated."),
    ] = None
    seconds: Annotated[int, option(least=1, metavar="S", help="CPU time limit of a world [s].")] = 120
    memory: Annotated[int, option(least=100, metavar="MB", help="Memory limit of a world [MB].")] = 2000


@dataclass(frozen=True, kw_only=True)
class WhyOptions(SituationSettings):
    """Options of the search for what a failed run lacked."""

    trace: Annotated[Path, argument(metavar="TRACE", help="The trace of a run that failed.")]
    file: Annotated[
        str | None,
        argument(metavar="RECIPE|PLAN", help="The recipe or plan that was run; needed unless it is bundled."),
    ] = None
    apply: Annotated[
        Path | None,
        written("Write the change to this file, which the same option of a run reads; default: TRACE.apply.json."),
    ] = None
    report: Annotated[
        Path | None,
        written("Write an HTML page with both runs on one clock: the failed one, and the one that is done."),
    ] = None
    budget: Annotated[int, option(least=1, most=10_000, metavar="N", help="Rerun the plan at most N times.")] = 40
    processes: Annotated[
        int | None,
        option(least=1, most=1000, metavar="N", help="Number of reruns in parallel; default: one per core."),
    ] = None
    on: On = LOCAL
    cluster_wait: ClusterWait = 300.0
