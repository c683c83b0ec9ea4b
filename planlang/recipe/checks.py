"""Reading a recipe and judging it: everything that is wrong in one run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from planlang.diagnostics import BadInput, Diagnostic, Severity, Span
from planlang.recipe.actions import Actions
from planlang.recipe.check_designators import check_designators
from planlang.recipe.check_losses import check_losses
from planlang.recipe.check_orderings import check_orderings
from planlang.recipe.check_parameters import check_fillers, check_ranges
from planlang.recipe.check_places import check_places
from planlang.recipe.check_requirements import check_requirements
from planlang.recipe.check_states import check_states
from planlang.recipe.check_steps import check_base_motions, check_recursion, check_sub_actions
from planlang.recipe.check_unordered import check_free, check_unordered
from planlang.recipe.graph import recipe_cycle
from planlang.recipe.misspellings import corrected, misspellings
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.recipe.readers.data_flow import made
from planlang.recipe.reading import recipes_for
from planlang.recipe.repairs import repaired
from planlang.recipe.scopes import added_by_scopes
from planlang.recipe.statements import Statements
from planlang.recipe.tasks import choose_task, circular_task, read_recipes, top_tasks
from planlang.recipe.wise import check_wisdom

ORDERS_UNKNOWN = frozenset({"R010", "R011", "R020"})
"""Codes of mistakes by which it is not known what the file orders."""

ABOUT_ORDER = ORDERS_UNKNOWN | {"R040", "R042", "R045"}
"""Codes that tell already that a recipe's orders are not as they should be."""


@dataclass(frozen=True, slots=True)
class Reading:
    """What was read: the recipes, or None if not even a task was found, and what there is to say about the file.

    ``actions`` are those of what was read: with right names in the place of ``misspelt`` ones. ``diagnostics`` are
    those of the ontology, too, misspellings first, then in the order of lines.
    """

    recipes: RecipeSet | None
    diagnostics: tuple[Diagnostic, ...]
    actions: Actions
    misspelt: tuple[Diagnostic, ...] = ()


def read_recipe(
    actions: Actions, task: str | None = None, *, allow_abstract: bool = False, scopes: bool = True
) -> Reading:
    """Read the task of the main document, with all recipes below it, repair what is safe to repair, and judge it.

    Never raises for what the user wrote; errors are among the diagnostics.
    """
    misspelt = misspellings(actions.ontology)
    right = corrected(actions.ontology, misspelt)
    if right is not actions.ontology:
        actions = Actions(right)
    recipes, found = _read(actions, task, allow_abstract=allow_abstract, scopes=scopes)
    found = (*actions.ontology.diagnostics, *found)
    guessed = corrected(actions.ontology, misspelt, guessing=True)
    if guessed is not actions.ontology:  # whichever name is meant: what the guess would mend is a consequence
        left = _read(Actions(guessed), task, allow_abstract=allow_abstract, scopes=scopes)[1]
        found = tuple(one for one in found if one in {*guessed.diagnostics, *left})
    return Reading(recipes, (*misspelt, *found), actions, misspelt)


def _read(
    actions: Actions, task: str | None, *, allow_abstract: bool, scopes: bool
) -> tuple[RecipeSet | None, tuple[Diagnostic, ...]]:
    """The recipes, or None without a task, and their diagnostics."""
    ontology = actions.ontology
    try:
        chosen = choose_task(actions, task)
    except BadInput as problem:
        circular = None if task is not None or top_tasks(actions) else circular_task(actions)
        if circular is None:
            return None, problem.diagnostics
        within = _read(actions, circular, allow_abstract=allow_abstract, scopes=scopes)[1]
        said = () if "R022" in {one.code for one in within} else problem.diagnostics
        return None, (*said, *within)
    recipes = read_recipes(actions, chosen)
    diagnostics: list[Diagnostic] = list(check_recursion(recipes))
    is_finite = not diagnostics
    if is_finite:
        recipes, notes = repaired(ontology, recipes)
        diagnostics += notes
    diagnostics += check_designators(ontology)
    diagnostics += check_losses(actions)
    diagnostics += check_requirements(ontology, recipes)
    for recipe in recipes.recipes.values():
        statements = actions.statements(recipes_for(actions, recipe.iri)[0][0])
        assert statements is not None
        found = list(_stated(actions, statements, recipe, allow_abstract=allow_abstract))
        if is_finite and not statements.is_finite_state and recipe_cycle(recipe) is None:
            added = added_by_scopes(actions, recipe, recipes) if scopes else ()
            found += check_wisdom(actions, recipe, added)
            if scopes:
                found += check_base_motions(actions, recipe, recipes)
            if ORDERS_UNKNOWN.isdisjoint(one.code for one in found):
                found += check_unordered(actions, recipe, recipes, added)
            if ABOUT_ORDER.isdisjoint(one.code for one in found):
                found += check_free(recipe)
        diagnostics += found
    return recipes, _sorted(diagnostics)


def _stated(actions: Actions, statements: Statements, recipe: Recipe, *, allow_abstract: bool) -> Iterator[Diagnostic]:
    """Judge what the file states for one recipe."""
    yield from check_sub_actions(actions, statements, recipe, allow_abstract=allow_abstract)
    yield from check_orderings(actions.ontology, statements, recipe)
    yield from check_states(actions, statements, recipe)
    yield from check_fillers(actions, statements)
    created = made(actions.ontology, statements)
    owners: tuple[Recipe | Step, ...] = (recipe, *recipe.steps)
    for owner in owners:
        yield from check_ranges(actions, owner, created)
        yield from check_places(actions, owner, created)


def _sorted(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Each once: errors, warnings, notes; within each by file and line."""
    rank = {severity: index for index, severity in enumerate(Severity)}
    nowhere = Span("")
    return tuple(sorted(dict.fromkeys(diagnostics), key=lambda found: (rank[found.severity], found.span or nowhere)))
