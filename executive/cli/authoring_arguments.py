"""Arguments of commands about recipes, maps and robots, as in :mod:`executive.cli.arguments`."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

from executive.cli.arguments import Arguments, Detail, OntologyArguments, TaskArguments
from executive.options.declaring import argument, option, output, view, written
from executive.options.recipes import CheckOptions, CompileOptions
from executive.options.running import Force, IgnoreUnread, Modules, Recipe, Robot, Trust, Units, Urdf
from planlang.files import Target
from planlang.outputs import PNG_OR_SVG
from planlang.records import dataclass

Output = Annotated[Path | None, output("Write the text to this file instead of stdout.")]


class Template(Enum):
    """What ``planlang new`` writes."""

    PROJECT = "project"
    RECIPE = "recipe"
    MAP = "map"
    ROBOT = "robot"
    MODULE = "module"
    PLAN = "plan"


@dataclass(frozen=True, kw_only=True)
class NewArguments(Arguments):
    """Write a commented recipe, map, robot, module or plan to start from, or a project of them with a test.

    All of them run as they are. planlang robot make writes a robot file for your URDF.
    """

    kind: Annotated[Template, argument(help="What to write.")]
    name: Annotated[str, argument(metavar="NAME", help="Its name: lower-case letters, digits and _.")]
    folder: Annotated[Path, option(metavar="DIR", help="Write to this folder.")] = Path()
    force: Force = False


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
class FaultsArguments(Arguments):
    """List the kinds of faults that may be stated for a run: what they are, when they happen, what shows them.

    A fault is PART.NAME:KIND=VALUE@WHEN, of which PART:KIND is enough: gripper:misses, arm.left:stalls=0.5@2.
    WHEN is 1 by default: the first opportunity; 2-4 are several, 3s the first from a plan time on, 3s-8s all within a
    time, always all. The opportunities are counted at which the fault can happen to what it names.
    """

    part: Annotated[
        str | None, argument(metavar="PART", help="List only the faults of this part, such as gripper or door.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class ShowArguments(TaskArguments):
    """Show the contents of a file: a recipe, a plan, a trace, a map or a robot.

    Prints the steps of a recipe or plan as a tree, the contents of a map, the parts of a robot, the course of a run.
    With --output also draws it (maps and robots: PNG; recipes: SVG, PNG, DOT or Mermaid; traces: an HTML page).
    """

    file: Annotated[str, argument(metavar="FILE", help="A file, or the name of a bundled recipe, robot or room.")]
    output: Annotated[Path | None, output("Draw to this file; the suffix selects the format.")] = None
    view: Annotated[
        str | None,
        option(
            metavar="VIEW",
            help="Viewpoint for a map or robot [m]: X,Y,Z or X,Y,Z:X,Y,Z, overview, or top.",
            parse=view,
        ),
    ] = None
    ignore_unread: IgnoreUnread = False
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class ConvertArguments(Arguments):
    """Convert an ontology, such as a recipe, to another syntax, and list what is lost."""

    file: Annotated[str, argument(metavar="FILE", help="An ontology file, in any supported syntax.")]
    to: Annotated[Target, option("--syntax", "--to", help="The target syntax.", shows_default=False)]
    output: Output = None
    units: Units = None
    ignore_unread: IgnoreUnread = False
    force: Force = False


@dataclass(frozen=True, kw_only=True)
class MergeArguments(OntologyArguments):
    """Merge maps of one place, in one frame, and list conflicts.

    The newest pose of each thing wins; for equally new poses, and for all other facts, the map named later wins.
    """

    maps: Annotated[
        list[str], argument(metavar="MAP...", help="Map files (OWL or URDF), or names of bundled environments.")
    ]
    output: Annotated[Path | None, output("Write the map to this file instead of stdout.")] = None
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
class InspectArguments(Arguments):
    """Show a robot's joints and postures, what its hands hold, its reach and doorways, and what is missing.

    Exit code 3 if the robot has no arm.
    """

    robot: Annotated[str, argument(metavar="ROBOT", help="A robot file, or the name of a bundled robot.")]
    urdf: Urdf = None
    picture: Annotated[Path | None, written("Draw the robot, its hands and its reach, as PNG or SVG.", PNG_OR_SVG)] = (
        None
    )
    record: Annotated[Path | None, written("Write the reach as a recording for rerun (needs the extra record).")] = None
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
