"""Arguments and options that several commands have, and how they are understood."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from executive.cli.inputs import PlanFile, RecipeFile, find, names, read
from planlang.diagnostics import BadInput, Diagnostic, Span, error, has_errors
from planlang.resources import bundled

if TYPE_CHECKING:
    from planlang.compiler import CompiledPlan

RecipeArgument = Annotated[str, typer.Argument(metavar="RECIPE", help="A recipe's file, or a bundled recipe's name.")]
RecipeOrPlan = Annotated[
    str, typer.Argument(metavar="RECIPE|PLAN", help="A recipe's or plan's file, or a bundled recipe's name.")
]
Task = Annotated[
    str | None,
    typer.Option(
        "--task", metavar="CLASS", help="The task to compile: local name or IRI of an action class in the recipe."
    ),
]
Ontologies = Annotated[
    list[Path] | None,
    typer.Option("--ontologies", metavar="DIR", help="Look for imported files here, too; repeatable."),
]
AllowAbstract = Annotated[
    bool, typer.Option("--allow-abstract", help="Steps that nothing can execute are warnings, not errors.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object to stdout.")]


def recipe_file(name: str) -> RecipeFile:
    found = read(name)
    if isinstance(found, PlanFile):
        advice = f"planlang check {name} tells about a plan, planlang run {name} runs it"
        raise BadInput([error("C007", f"{name} is a plan already, not a recipe", Span(str(found.path)), advice)])
    return found


def compiled(
    file: RecipeFile,
    *,
    task: str | None,
    ontologies: list[Path] | None,
    allow_abstract: bool,
    scopes: bool = True,
    data_flow: bool = True,
) -> CompiledPlan:
    from planlang.compiler import compile_recipe

    return compile_recipe(
        file.path,
        task=task,
        folders=tuple(ontologies or ()),
        allow_abstract=allow_abstract,
        scopes=scopes,
        data_flow=data_flow,
    )


def named(
    what: str,
    given: str | None,
    folder: str,
    default: str,
    is_bundled: bool,
    problems: list[Diagnostic],
    *,
    reason: str = "this plan needs --{what}; only bundled recipes have a default",
) -> Path | None:
    """The file of a robot or environment; bundled recipes have a default, all others need one."""
    place = bundled("ontologies") / folder
    if given is None and not is_bundled:
        advice = f"add --{what} FILE, or a bundled one: {', '.join(names(place))}"
        problems.append(error("C008", reason.format(what=what), help=advice))
        return None
    try:
        return find(what, given or default, place)
    except BadInput as bad:
        problems.extend(bad.diagnostics)
        return None


def refuse(problems: list[Diagnostic]) -> None:
    if has_errors(problems):
        raise BadInput(problems)


def planar(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    import math

    try:
        x, y, yaw = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not x,y,yaw; write for example --start 1.5,-0.2,3.14") from None
    if not all(map(math.isfinite, (x, y, yaw))):
        raise typer.BadParameter(f"{text!r} has a number that is not finite")
    return x, y, yaw


def parsed_bindings(texts: Sequence[str]) -> dict[str, str]:
    bindings: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not (name and equals and value):
            raise typer.BadParameter(f"{text!r} is not NAME=OBJECT; write for example --set bottle=bottle2")
        if name in bindings:
            raise typer.BadParameter(f"{name!r} is set twice")
        bindings[name] = value
    return bindings
