"""Context of a run for its page: plan and recipe, their lines, labels and graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.runs.files import RecipeFile
from executive.runs.plan_files import compiled
from planlang.diagnostics import BadInput
from planlang.files import decode, read_file
from planlang.language.source import PlanSource
from planlang.ontology import Ontology, load
from planlang.report import Context
from planlang.report.sources import labels_of, plan_source, recipe_source, vocabulary_of

if TYPE_CHECKING:
    from planlang.compiler.compile import CompiledPlan


def context_of(
    plan: PlanSource | None,
    made: CompiledPlan | None,
    recipe: RecipeFile | None,
    performed: frozenset[str],
    folders: Sequence[Path] = (),
    *,
    of: Mapping[str, Any] | None = None,
) -> Context:
    """Make the context of a run from a plan, from what was compiled for it, or from a recipe to compile.

    For a compiled plan, the recipe that its header names is read. Missing and unreadable files are left out, and so is
    the text of a plan that differs from that of the trace with the header ``of``.
    """
    if plan is not None and made is None and (origin := plan.header) is not None:
        found = origin.find_recipe(plan.path, folders)
        recipe = None if found is None else RecipeFile(found)
        made = None if recipe is None else _compiled(recipe, origin.task, performed, folders)
    elif made is None and recipe is not None:
        made = _compiled(recipe, None, performed, folders)
    if plan is None and made is not None:
        plan = made.plan_source
    is_other = of is not None and plan is not None and of.get("plan_sha256") != plan.sha256
    shown = Context(None if plan is None or is_other else plan_source(plan))
    if made is None:
        return shown
    source = None if recipe is None else _text(recipe)
    ontology = None if recipe is None else _ontology(recipe, folders)
    return replace(
        shown,
        recipe=None
        if recipe is None or source is None or ontology is None
        else recipe_source(made.recipes, ontology, recipe.path.name, source),
        labels=labels_of(made.recipes),
        vocabulary={} if ontology is None else vocabulary_of(ontology),
        graph=made.graph.graph,
    )


def _compiled(
    recipe: RecipeFile, task: str | None, performed: frozenset[str], folders: Sequence[Path]
) -> CompiledPlan | None:
    ontology = _ontology(recipe, folders)
    try:
        return None if ontology is None else compiled(ontology, task, performed)
    except BadInput:
        return None


def _ontology(recipe: RecipeFile, folders: Sequence[Path]) -> Ontology | None:
    try:
        return load(recipe.path, folders=folders, content=recipe.content)
    except BadInput:
        return None


def _text(recipe: RecipeFile) -> str | None:
    try:
        content = read_file(recipe.path) if recipe.content is None else recipe.content
        return decode(content, recipe.path.name)
    except BadInput:
        return None
