"""Reading a recipe and judging it: everything that is wrong in one run."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TypeVar

from planlang.diagnostics import BadInput, Diagnostic, Severity, Span
from planlang.recipe.actions import Actions
from planlang.recipe.checks import (
    Check,
    CheckedFile,
    CheckedRecipe,
    losses,
    orderings,
    parameters,
    plausibility,
    states,
    steps,
)
from planlang.recipe.checks.misspellings import corrected, misspellings
from planlang.recipe.checks.repairs import repaired
from planlang.recipe.model import RecipeSet
from planlang.recipe.tasks import choose_task, circular_task, read_recipes, statements_for, top_tasks

FILE_CHECKS: tuple[Check[[CheckedFile], Iterable[Diagnostic]], ...] = (
    steps.recursion,
    parameters.unused_names,
    losses.lost_statements,
    steps.requirements,
)
"""Checks of a whole file; each after those that suppress it, as in the other lists."""

ANY_RECIPE: tuple[Check[[CheckedRecipe], Iterable[Diagnostic]], ...] = (
    steps.undefined_sub_actions,
    steps.repeated_sub_actions,
    steps.foreign_words,
    steps.same_names,
    steps.abstract_steps,
    orderings.incomplete_constraints,
    parameters.unlisted_properties,
    parameters.fillers,
    parameters.left_out,
    parameters.unrelated_places,
)
"""Checks of recipes in any dialect."""

ORDERED_STEPS: tuple[Check[[CheckedRecipe], Iterable[Diagnostic]], ...] = (
    orderings.ordered_strangers,
    orderings.cycles,
    orderings.repeated_constraints,
    orderings.redundant_constraints,
    orderings.contradictions,
    plausibility.missing_orders,
    plausibility.unordered_base_motions,
    plausibility.shared_resources,
    plausibility.free_steps,
)
"""Checks of recipes whose steps stand in a partial order."""

FINITE_STATE: tuple[Check[[CheckedRecipe], Iterable[Diagnostic]], ...] = (
    states.undefined_states,
    states.unlisted_sub_actions,
    states.starts_and_ends,
    states.orders_of_states,
    states.ambiguous_transitions,
    states.unreachable_states,
    states.uncovered_endings,
    states.unhandled_failures,
)
"""Checks of recipes whose steps are states."""

_Subject = TypeVar("_Subject")


@dataclass(frozen=True, slots=True)
class Reading:
    """The result of reading a file: its recipes, or None if not even a task was found, and all diagnostics.

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
    """Return the recipes, or None without a task, and their diagnostics."""
    try:
        chosen = choose_task(actions, task)
    except BadInput as problem:
        # tasks that perform each other have no first one: what is wrong with them is judged from any of them
        circular = None if task is not None or top_tasks(actions) else circular_task(actions)
        if circular is None:
            return None, problem.diagnostics
        within = _read(actions, circular, allow_abstract=allow_abstract, scopes=scopes)[1]
        is_told = choose_task.applies({one.code for one in within})
        return None, (*(problem.diagnostics if is_told else ()), *within)
    recipes = read_recipes(actions, chosen)
    file = CheckedFile(actions, recipes, allow_abstract, scopes)
    diagnostics = _judged(FILE_CHECKS, file, ())
    if repaired.applies({one.code for one in diagnostics}):
        recipes, notes = repaired(actions.ontology, recipes)
        diagnostics += notes
        file = replace(file, recipes=recipes)
    wrong = {one.code for one in diagnostics}
    for recipe in recipes.recipes.values():
        statements = statements_for(actions, recipe.iri)
        checks = (*ANY_RECIPE, *(ORDERED_STEPS if statements.states is None else FINITE_STATE))
        diagnostics += _judged(checks, CheckedRecipe(file, recipe, statements), wrong)
    return recipes, _sorted(diagnostics)


def _judged(
    checks: Iterable[Check[[_Subject], Iterable[Diagnostic]]], subject: _Subject, before: Iterable[str]
) -> list[Diagnostic]:
    """Return the unsuppressed findings of all checks; ``before`` are codes that were reported already."""
    reported = set(before)
    found: list[Diagnostic] = []
    for one in checks:
        if one.applies(reported):
            new = list(one(subject))
            reported.update(diagnostic.code for diagnostic in new)
            found += new
    return found


def _sorted(diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Return each diagnostic once: errors, warnings, then notes, each by file and line."""
    rank = {severity: index for index, severity in enumerate(Severity)}
    nowhere = Span("")
    return tuple(sorted(dict.fromkeys(diagnostics), key=lambda found: (rank[found.severity], found.span or nowhere)))
