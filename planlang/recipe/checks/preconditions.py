"""Check that steps come after what they need is brought about."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.diagnostics import Diagnostic, error
from planlang.recipe.checks import CheckedRecipe, check
from planlang.recipe.checks.orderings import ORDERS_UNKNOWN, RECURSIVE
from planlang.recipe.order import recipe_order
from planlang.recipe.preconditions import Preconditions


@check("R067", unless=(*RECURSIVE, "R012", *ORDERS_UNKNOWN))
def late_preconditions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report steps that come before what they need is brought about."""
    recipe = checked.recipe
    order = recipe_order(recipe)
    if checked.added:
        order = order.extended(checked.added)
    for unmet in Preconditions(checked.actions, recipe).unmet(order.before):
        yield error("R067", str(unmet), recipe.step(unmet.step).span, unmet.advice)
