"""Options of compiling recipes, and of checking recipes, plans and maps."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

from executive.options.declaring import argument, option, output, written
from executive.options.running import IgnoreUnread, Modules, Recipe, Source, TaskOptions, Trust, source
from planlang.records import dataclass
from planlang.words import Option, Text

FIXING, REASONING = Text("With ", Option("fix", True), ": "), Text("With ", Option("reason", True), ": ")


class LogicReasoner(Enum):
    """Description-logic reasoners."""

    HERMIT = "hermit"
    PELLET = "pellet"


@dataclass(frozen=True, kw_only=True)
class CompileOptions(TaskOptions):
    """Options of compiling a recipe."""

    recipe: Recipe
    output: Annotated[Path | None, output("Write the plan to this file instead of stdout.", metavar="PLAN")] = None
    modules: Modules = None
    trust: Trust = False
    graph: Annotated[
        Path | None, written("Also draw the order of the steps, as .svg, .png, .dot or .mmd (Mermaid).")
    ] = None
    scopes: Annotated[bool, option("--scopes/--no-scopes", help="Open a location scope at each base motion.")] = True
    data_flow: Annotated[
        bool, option("--dataflow/--no-dataflow", help="Order steps by data flow, and pass data between them.")
    ] = True
    merge: Annotated[bool, option(help="Merge your edits of the plan with what the recipe compiles to now.")] = False
    force: Annotated[bool, option(help="Overwrite plans edited by hand, and files that planlang did not write.")] = (
        False
    )


@dataclass(frozen=True, kw_only=True)
class CheckOptions(TaskOptions):
    """Options of checking a recipe, a plan, a map or a folder of recipes."""

    file: Annotated[
        Source,
        argument(
            metavar="RECIPE|PLAN|MAP",
            help="A file or a folder, or the name of a bundled recipe or map.",
            parse=source,
        ),
    ]
    modules: Modules = None
    trust: Trust = False
    ignore_unread: IgnoreUnread = False
    fix: Annotated[bool, option(help="Write a copy with all safe fixes, NAME.fixed.EXT, and show the changes.")] = False
    accept: Annotated[
        list[str] | None,
        option(metavar="CODE", help=Text(FIXING, "also apply uncertain fixes with this code; repeatable.")),
    ] = None
    output: Annotated[Path | None, output(Text(FIXING, "write the copy to this file."))] = None
    force: Annotated[
        bool,
        option(help=Text("With ", Option("output"), ": overwrite a file that planlang did not write.")),
    ] = False
    reason: Annotated[
        bool,
        option(help="Also search for contradictions with a description-logic reasoner; needs Java."),
    ] = False
    reasoner: Annotated[LogicReasoner, option(help=Text(REASONING, "the reasoner."))] = LogicReasoner.HERMIT
    reason_seconds: Annotated[float, option(least=1.0, metavar="SECONDS", help=Text(REASONING, "time limit [s]."))] = (
        120.0
    )
    lists_contents: bool = False
    """List the things of a map."""
