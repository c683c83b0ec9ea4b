"""Compiling a recipe to a plan in Python, merged with its edits, and a drawing of the order of its steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from executive.commands.arguments import CompileArguments
from executive.commands.inputs import folders_beside, read_recipe_file, refuse
from executive.commands.performed import performed_by_modules
from planlang.compiler import CompiledPlan, compile_recipe
from planlang.diagnostics import Diagnostic, Span, WrongOption, error
from planlang.outputs import LONGEST, NO_DATA_FLOW, NO_SCOPES, Named, PlanHeader, check_outputs, header
from planlang.plan_versions import merge_plan, write_versions
from planlang.words import Blank, Option


def compiled(arguments: CompileArguments) -> tuple[CompiledPlan, bool]:
    """Compile a recipe, and write the output files. Raises BadInput.

    Returns the plan with all diagnostics, and True if a merge left conflicts in its file.
    """
    file, output, graph, force = read_recipe_file(arguments.recipe), arguments.output, arguments.graph, arguments.force
    inputs: dict[Named, Path | None] = {"the recipe": file.path}
    problems = check_outputs({Option("output"): output}, inputs, force=True)  # write_versions checks an existing plan
    problems += check_outputs({Option("graph"): graph}, {**inputs, Option("output"): output}, force=force)
    if graph is not None:
        from planlang.compiler.drawing import unknown_format  # most plans are not drawn

        problems += unknown_format(graph)
    refuse(problems)
    before = _merged_header(arguments)
    diagnostics = folders_beside(arguments.recipe)
    excluded = before.options if before is not None else ()
    plan = compile_recipe(
        file.path,
        task=arguments.task or (before.task if before is not None else None),
        folders=arguments.folders,
        scopes=arguments.scopes and NO_SCOPES not in excluded,
        data_flow=arguments.data_flow and NO_DATA_FLOW not in excluded,
        performed=performed_by_modules(arguments.modules, diagnostics, trust=arguments.trust),
    )
    conflicts: list[int] = []
    if output is not None and arguments.merge and output.is_file():
        conflicts = [*merge_plan(output, plan.source, file.path.name)]
        diagnostics += [_conflict(output, line) for line in conflicts]
    elif output is not None:
        write_versions(output, plan.source, force=force)
    if graph is not None:
        plan.graph.save(graph, force=True)
    return replace(plan, diagnostics=(*plan.diagnostics, *diagnostics)), bool(conflicts)


def _conflict(plan: Path, line: int) -> Diagnostic:
    advice = "keep the right lines, and remove the markers <<<<<<<, ======= and >>>>>>>"
    return error("C023", "conflict: both you and the recipe changed these lines", Span(str(plan), line), advice)


def _merged_header(arguments: CompileArguments) -> PlanHeader | None:
    """Header of the plan to merge with, whose options the new plan gets; None without --merge."""
    if not arguments.merge:
        return None
    if arguments.output is None:
        raise WrongOption(Option("merge", True), " needs ", Option("output", Blank("PLAN")), ", the edited plan")
    if arguments.force:
        raise WrongOption(
            Option("merge", True), " keeps the edits, ", Option("force", True), " overwrites them: use only one"
        )
    if not arguments.output.is_file():
        return None
    with arguments.output.open(encoding="utf-8", errors="replace") as file:
        return header(file.read(LONGEST))
