"""``planlang compile``: a recipe becomes a plan in Python, and a drawing of the order of its steps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from executive.cli.arguments import CompileArguments
from executive.cli.console import Answer
from executive.cli.inputs import read_recipe_file, refuse
from planlang.compiler import compile_recipe
from planlang.diagnostics import Diagnostic, error
from planlang.outputs import check_outputs, write_plan, write_text


def command(arguments: CompileArguments) -> Answer:
    """Compile a recipe; raises BadInput."""
    file, output, graph, force = read_recipe_file(arguments.recipe), arguments.output, arguments.graph, arguments.force
    inputs = {"the recipe": file.path}
    problems = check_outputs({"--output": output}, inputs, force=True)  # write_plan looks at an old plan more closely
    problems += check_outputs({"--graph": graph}, {**inputs, "--output": output}, force=force)
    refuse([*problems, *_check_graph(graph)])
    plan = compile_recipe(
        file.path,
        task=arguments.task,
        folders=arguments.folders,
        scopes=arguments.scopes,
        data_flow=arguments.data_flow,
    )
    if output is not None:
        write_plan(output, plan.source, force=force)
    if graph is not None:
        from planlang.compiler.drawing import FORMATS, task_graph  # most plans are not drawn

        write_text(graph, FORMATS[graph.suffix.lower()](task_graph(plan.recipes, plan.added, plan.recoveries)))
    data: dict[str, Any] = {"task": plan.task, "functions": list(plan.functions)}
    data |= {"graph": str(graph)} if graph is not None else {}
    data |= {"plan": str(output)} if output is not None else {"source": plan.source}
    text = plan.source if output is None else f"{output}: {plan.task}"
    return Answer(diagnostics=plan.diagnostics, text=text, data=data)


def _check_graph(path: Path | None) -> list[Diagnostic]:
    if path is None:
        return []
    from planlang.compiler.drawing import FORMATS

    if path.suffix.lower() in FORMATS:
        return []
    message = f"unknown graph format {path.suffix or path.name}; known: {', '.join(FORMATS)}"
    return [error("C014", message, help=f"name a file such as {path.stem or 'graph'}.svg")]
