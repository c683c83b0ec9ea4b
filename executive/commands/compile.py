"""Compiling a recipe to a plan in Python, merged with its edits, and a drawing of the order of its steps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from executive.commands.performed import performed_by_modules
from executive.options.recipes import CompileOptions
from executive.runs.files import folders_beside, read_recipe_file, refuse
from planlang.compiler import CompiledPlan, compile_recipe
from planlang.compiler.drawing import unknown_format
from planlang.diagnostics import Span, WrongOption, error
from planlang.outputs import LONGEST, NO_DATA_FLOW, NO_SCOPES, Named, PlanHeader, check_outputs, header
from planlang.plan_versions import merge_plan, write_versions
from planlang.words import Blank, Option

CONFLICT = "C023"
"""Code of a conflict that a merge left in the file of a plan."""


def compiled(options: CompileOptions) -> CompiledPlan:
    """Compile a recipe, and write the output files; gives the plan with all diagnostics. Raises BadInput.

    Conflicts of a merge are diagnostics, too.
    """
    file, output, graph, force = read_recipe_file(options.recipe), options.output, options.graph, options.force
    inputs: dict[Named, Path | None] = {} if file.content is not None else {"the recipe": file.path}
    problems = check_outputs({Option("output"): output}, inputs, force=True)  # write_versions checks an existing plan
    problems += check_outputs({Option("graph"): graph}, {**inputs, Option("output"): output}, force=force)
    if graph is not None:
        problems += unknown_format(graph)
    refuse(problems)
    before = _merged_header(options)
    diagnostics = folders_beside(options.recipe)
    excluded = before.options if before is not None else ()
    plan = compile_recipe(
        file.path,
        task=options.task or (before.task if before is not None else None),
        folders=options.folders,
        scopes=options.scopes and NO_SCOPES not in excluded,
        data_flow=options.data_flow and NO_DATA_FLOW not in excluded,
        performed=performed_by_modules(options.modules, diagnostics, trust=options.trust),
        content=file.content,
    )
    if output is not None and options.merge and output.is_file():
        message = "conflict: both you and the recipe changed these lines"
        advice = "keep the right lines, and remove the markers <<<<<<<, ======= and >>>>>>>"
        lines = merge_plan(output, plan.source, file.path.name)
        diagnostics += [error(CONFLICT, message, Span(str(output), line), advice) for line in lines]
    elif output is not None:
        write_versions(output, plan.source, force=force)
    if graph is not None:
        plan.graph.save(graph, force=True)
    return replace(plan, diagnostics=(*plan.diagnostics, *diagnostics))


def _merged_header(options: CompileOptions) -> PlanHeader | None:
    """Header of the plan to merge with, whose options the new plan gets; None without --merge."""
    if not options.merge:
        return None
    if options.output is None:
        raise WrongOption(Option("merge", True), " needs ", Option("output", Blank("PLAN")), ", the edited plan")
    if options.force:
        raise WrongOption(
            Option("merge", True), " keeps the edits, ", Option("force", True), " overwrites them: use only one"
        )
    if not options.output.is_file():
        return None
    with options.output.open(encoding="utf-8", errors="replace") as file:
        return header(file.read(LONGEST))
