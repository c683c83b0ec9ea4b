"""Context of a run for its page: plan and recipe, their lines, labels and graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.runs.files import RecipeFile
from executive.runs.plan_files import compiled
from planlang.diagnostics import BadInput
from planlang.files import decode, read_file
from planlang.language.source import PlanSource
from planlang.ontology import load
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
    task = None
    if plan is not None and made is None and (origin := plan.header) is not None:
        found, task = origin.find_recipe(plan.path, folders), origin.task
        recipe = None if found is None else RecipeFile(found)
    source, vocabulary = None, dict[str, str]()
    if recipe is not None:
        with suppress(BadInput):
            ontology = load(recipe.path, folders=folders, content=recipe.content)
            vocabulary = dict(vocabulary_of(ontology))
            made = compiled(ontology, task, performed) if made is None else made
            content = read_file(recipe.path) if recipe.content is None else recipe.content
            source = recipe_source(made.recipes, ontology, recipe.path.name, decode(content, recipe.path.name))
    if plan is None and made is not None:
        plan = made.plan_source
    is_other = of is not None and plan is not None and of.get("plan_sha256") != plan.sha256
    shown = Context(None if plan is None or is_other else plan_source(plan))
    if made is None:
        return shown
    labels, graph = labels_of(made.recipes), made.graph.graph
    return replace(shown, recipe=source, labels=labels, vocabulary=vocabulary, graph=graph)
