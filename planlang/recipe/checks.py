"""Reading a recipe and judging it: everything that is wrong in one run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from planlang.diagnostics import BadInput, Diagnostic, Severity, Span
from planlang.recipe.actions import Actions
from planlang.recipe.check_orderings import check_orderings
from planlang.recipe.check_parameters import check_fillers, check_parameters
from planlang.recipe.check_steps import check_base_motions, check_recursion, check_sub_actions
from planlang.recipe.graph import recipe_graph, shortest_cycle
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.recipe.reading import recipes_for
from planlang.recipe.repairs import repaired
from planlang.recipe.tasks import choose_task, read_recipes
from planlang.recipe.wise import check_wisdom


@dataclass(frozen=True, slots=True)
class Reading:
    """What was read: the recipes, or None if not even a task was found, and all diagnostics in the order of lines."""

    recipes: RecipeSet | None
    diagnostics: tuple[Diagnostic, ...]


def read_recipe(
    actions: Actions, task: str | None = None, *, allow_abstract: bool = False, scopes: bool = True
) -> Reading:
    """Read the task of the main document, with all recipes below it, repair what is safe to repair, and judge it.

    Never raises for what the user wrote; errors are among the diagnostics.
    """
    ontology = actions.ontology
    try:
        chosen = choose_task(actions, task)
    except BadInput as problem:
        return Reading(None, problem.diagnostics)
    found = read_recipes(actions, chosen)
    diagnostics: list[Diagnostic] = list(check_recursion(found))
    is_finite = not diagnostics
    recipes, notes = repaired(ontology, found)
    diagnostics += notes
    for recipe in recipes.recipes.values():
        statements = actions.statements(recipes_for(actions, recipe.iri)[0][0])
        assert statements is not None
        diagnostics += check_sub_actions(actions, statements, recipe, allow_abstract=allow_abstract)
        diagnostics += check_orderings(ontology, statements, recipe)
        diagnostics += check_fillers(actions, statements)
        owners: tuple[Recipe | Step, ...] = (recipe, *recipe.steps)
        for owner in owners:
            diagnostics += check_parameters(actions, owner)
        if is_finite and shortest_cycle(recipe_graph(recipe)) is None:
            diagnostics += check_wisdom(actions, recipe)
            if scopes:
                diagnostics += check_base_motions(actions, recipe, recipes)
    return Reading(recipes, _sorted(diagnostics))


def _sorted(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Each once: errors, warnings, notes; within each by file and line."""
    rank = {severity: index for index, severity in enumerate(Severity)}
    nowhere = Span("")
    return tuple(sorted(dict.fromkeys(diagnostics), key=lambda found: (rank[found.severity], found.span or nowhere)))
