"""What the page of a run shows beside its trace and its world: plan and recipe, their lines, words and graph."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from executive.runs.plan_files import compiled
from planlang.diagnostics import BadInput
from planlang.files import decode, read_file
from planlang.ontology import load
from planlang.outputs import LONGEST, header
from planlang.report import Context
from planlang.report.sources import Source, labels_of, plan_source, recipe_source

if TYPE_CHECKING:
    from planlang.compiler.compile import CompiledPlan


def context_of(
    plan: Path, made: CompiledPlan | None, recipe: Path | None, performed: frozenset[str], folders: Sequence[Path] = ()
) -> Context:
    """Return the context of a run; of a plan that was compiled before, the recipe that its header names is read.

    A recipe that is not there any more, or that cannot be read, is left out.
    """
    text = _text(plan)
    shown = plan_source(plan.name, text) if text is not None else None
    if made is None and text is not None and (origin := header(text[:LONGEST])) is not None:
        recipe = origin.find_recipe(plan, folders)
        try:
            made = None if recipe is None else compiled(load(recipe, folders=folders), origin.task, performed)
        except BadInput:
            made = None
    if made is None:
        return Context(shown)
    from planlang.compiler.drawing import task_graph  # most runs draw none

    graph = task_graph(made.recipes, made.added, made.recoveries)
    return Context(shown, _recipe(made, recipe), labels_of(made.recipes), graph)


def _recipe(made: CompiledPlan, file: Path | None) -> Source | None:
    text = None if file is None else _text(file)
    return None if file is None or text is None else recipe_source(made.recipes, file.name, text)


def _text(file: Path) -> str | None:
    try:
        return decode(read_file(file), file.name)
    except BadInput:
        return None
