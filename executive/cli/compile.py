"""``planlang compile``: a recipe becomes a plan in Python, and a drawing of the order of its steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from executive.cli.arguments import CompileArguments
from executive.cli.console import Answer, ExitCode
from executive.cli.inputs import read_recipe_file, refuse
from executive.cli.performed import performed_by_modules
from planlang.compiler import CompiledPlan, compile_recipe
from planlang.diagnostics import Diagnostic, Span, error
from planlang.outputs import LONGEST, NO_DATA_FLOW, NO_SCOPES, PNG, PlanHeader, check_outputs, header, write_text
from planlang.outputs import replace as write_complete
from planlang.plan_versions import backup_path, merge_plan, write_versions

if TYPE_CHECKING:
    from planlang.compiler.drawing import TaskGraph


def command(arguments: CompileArguments) -> Answer:
    """Compile a recipe; raises BadInput."""
    file, output, graph, force = read_recipe_file(arguments.recipe), arguments.output, arguments.graph, arguments.force
    inputs = {"the recipe": file.path}
    problems = check_outputs({"--output": output}, inputs, force=True)  # write_plan looks at an old plan more closely
    problems += check_outputs({"--graph": graph}, {**inputs, "--output": output}, force=force)
    draw = drawer(graph, problems)
    refuse(problems)
    before = _merged_header(arguments)
    found: list[Diagnostic] = []
    left_out = before.options if before is not None else ()
    plan = compile_recipe(
        file.path,
        task=arguments.task or (before.task if before is not None else None),
        folders=arguments.folders,
        scopes=arguments.scopes and NO_SCOPES not in left_out,
        data_flow=arguments.data_flow and NO_DATA_FLOW not in left_out,
        performed=performed_by_modules(arguments.modules, found, trust=arguments.trust),
    )
    found, code = [*plan.diagnostics, *found], ExitCode.DONE
    if output is not None and arguments.merge and output.is_file():
        conflicts = merge_plan(output, plan.source, file.path.name)
        found += [_conflict(output, line) for line in conflicts]
        code = ExitCode.FAILED if conflicts else code
    elif output is not None:
        write_versions(output, plan.source, force=force)
    if graph is not None and draw is not None:
        draw(plan, graph)
    data: dict[str, Any] = {"task": plan.task, "functions": list(plan.functions)}
    data |= {"graph": str(graph)} if graph is not None else {}
    data |= {"plan": str(output)} if output is not None else {"source": plan.source}
    text = plan.source if output is None else f"{output}: {plan.task}"
    if code is ExitCode.FAILED:
        text += f", with conflicts; as it was before: {backup_path(output)}" if output is not None else ""
    return Answer(code, tuple(found), text, data)


def _conflict(plan: Path, line: int) -> Diagnostic:
    advice = "keep the right lines, and remove the marks <<<<<<<, ======= and >>>>>>>"
    return error(
        "C023", "conflict: these lines were edited, and the recipe changes them too", Span(str(plan), line), advice
    )


def _merged_header(arguments: CompileArguments) -> PlanHeader | None:
    """Return how the plan to merge with was compiled, as it is compiled again in the same way; None without --merge."""
    if not arguments.merge:
        return None
    if arguments.output is None:
        raise typer.BadParameter("--merge needs --output PLAN, the plan that was edited")
    if arguments.force:
        raise typer.BadParameter("--merge keeps the edits, --force overwrites them: give one of them")
    if not arguments.output.is_file():
        return None
    with arguments.output.open(encoding="utf-8", errors="replace") as file:
        return header(file.read(LONGEST))


def drawer(path: Path | None, problems: list[Diagnostic]) -> Callable[[CompiledPlan, Path], None] | None:
    """Return what draws plans in the format of a file; None, with an error in ``problems``, for an unknown format."""
    if path is None:
        return None
    from planlang.compiler import drawing  # most plans are not drawn

    if path.suffix.lower() in PNG:
        return _draw_picture
    write = drawing.FORMATS.get(path.suffix.lower())
    if write is None:
        known = ", ".join((*drawing.FORMATS, *PNG))
        message = f"unknown graph format {path.suffix or path.name}; known: {known}"
        problems.append(error("C014", message, help=f"name a file such as {path.stem or 'graph'}.svg"))
        return None
    return lambda plan, file: write_text(file, write(_graph(plan)))


def _draw_picture(plan: CompiledPlan, path: Path) -> None:
    from executive.pictures.graph_picture import save_graph  # Pillow is slow to import

    write_complete(path, partial(save_graph, _graph(plan)))


def _graph(plan: CompiledPlan) -> TaskGraph:
    from planlang.compiler import drawing

    return drawing.task_graph(plan.recipes, plan.added, plan.recoveries)
