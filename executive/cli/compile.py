"""``planlang compile``: a recipe becomes a plan in Python, and a drawing of the order of its steps."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from executive.cli.arguments import Recipe, RecipeArguments, VerboseArguments, read_recipe_file, refuse, taking
from executive.cli.console import Answer, answer
from planlang.diagnostics import Diagnostic, error
from planlang.outputs import check_outputs, write_plan, write_text

if TYPE_CHECKING:
    from planlang.compiler import CompiledPlan


@dataclass(frozen=True, kw_only=True)
class CompileArguments(RecipeArguments, VerboseArguments):
    """Arguments of ``planlang compile``."""

    recipe: Recipe
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PLAN", help="Write the plan here, not to stdout.")
    ] = None
    graph: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Also draw the order of the steps: a .svg, .dot or .mmd (Mermaid) file."),
    ] = None
    scopes: Annotated[bool, typer.Option("--scopes/--no-scopes", help="Open a location scope at each base motion.")] = (
        True
    )
    data_flow: Annotated[
        bool, typer.Option("--dataflow/--no-dataflow", help="Order steps by their data, and pass it on.")
    ] = True
    force: Annotated[
        bool, typer.Option("--force", help="Overwrite plans edited by hand, and files that planlang did not write.")
    ] = False


@taking(CompileArguments)
def compile_command(arguments: CompileArguments) -> None:
    """Compile a recipe to a plan in Python."""
    answer("compile", lambda: _compiled(arguments), as_json=arguments.json, all_notes=arguments.verbose)


def _compiled(arguments: CompileArguments) -> Answer:
    from planlang.compiler import compile_recipe

    file, output, graph, force = read_recipe_file(arguments.recipe), arguments.output, arguments.graph, arguments.force
    inputs = {"the recipe": file.path}
    problems = check_outputs({"--output": output}, inputs, force=True)  # write_plan looks at an old plan more closely
    problems += check_outputs({"--graph": graph}, {**inputs, "--output": output}, force=force)
    refuse([*problems, *_check_graph(graph)])
    plan = compile_recipe(
        file.path,
        task=arguments.task,
        folders=arguments.folders,
        allow_abstract=arguments.allow_abstract,
        scopes=arguments.scopes,
        data_flow=arguments.data_flow,
    )
    if output is not None:
        write_plan(output, plan.source, force=force)
    if graph is not None:
        _write_graph(graph, plan)
    data: dict[str, Any] = {"task": plan.task, "functions": list(plan.functions)}
    data |= {"graph": str(graph)} if graph is not None else {}
    data |= {"plan": str(output)} if output is not None else {"source": plan.source}
    text = plan.source if output is None else f"{output}: {plan.task}"
    return Answer(diagnostics=plan.diagnostics, text=text, data=data)


def _check_graph(path: Path | None) -> list[Diagnostic]:
    from planlang.compiler.drawing import FORMATS

    if path is None or path.suffix.lower() in FORMATS:
        return []
    message = f"unknown graph format {path.suffix or path.name}; known: {', '.join(FORMATS)}"
    return [error("C014", message, help=f"name a file such as {path.stem or 'graph'}.svg")]


def _write_graph(path: Path, plan: CompiledPlan) -> None:
    from planlang.compiler.drawing import FORMATS, task_graph

    write_text(path, FORMATS[path.suffix.lower()](task_graph(plan.recipes, plan.added, plan.recoveries)))
