"""Checks of what a recipe leaves open: steps that nothing orders, and those among them that need the same resource."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from planlang.designators import told_apart
from planlang.diagnostics import Diagnostic, Order, note, warning
from planlang.recipe.actions import Actions
from planlang.recipe.check_orderings import ordering_to_write
from planlang.recipe.graph import recipe_order
from planlang.recipe.model import Recipe, RecipeSet, Step, Thing
from planlang.recipe.precedence import Precedence
from planlang.recipe.wise import wise_orderings

BASE = "base"
"""The role of base motions, whose order is judged for itself."""

MOST_STEPS = 200
"""Steps with resources of a recipe that are compared pair by pair."""


def check_free(recipe: Recipe) -> Iterator[Diagnostic]:
    """Steps about whose order nothing is said, where nothing else is to say about orders."""
    if len(recipe.steps) < 2:
        return
    related = {name for one in recipe.orderings for name in (one.before, one.after)}
    related |= {name for one in recipe.overlaps for name in (one.first, one.second)}
    free = [step for step in recipe.steps if step.iri not in related]
    if len(free) == len(recipe.steps):
        message = f"nothing orders the {len(free)} steps of `{recipe.name}`: they may come in any order"
        yield note("R047", message, recipe.span, "add ordering constraints if that is not meant")
    elif free:
        names = ", ".join(f"`{step.name}`" for step in free)
        message = f"nothing orders {names} of `{recipe.name}`, while other steps are ordered"
        yield note("R047", message, free[0].span, "add ordering constraints if that is not meant")


def check_unordered(
    actions: Actions, recipe: Recipe, recipes: RecipeSet, added: Sequence[tuple[str, str]] = ()
) -> Iterator[Diagnostic]:
    """Steps that need the same resource of the robot and are unordered: one after the other, but which first?

    The recipe's orders are acyclic, and nothing recurses. ``added`` are the orders that location scopes add.
    """
    narrow: dict[str, frozenset[str]] = {}
    wide: dict[str, frozenset[str]] = {}
    own = {step.iri: _resources(actions, step, recipes, narrow, with_implied=False) for step in recipe.steps}
    whole = {step.iri: _resources(actions, step, recipes, wide, with_implied=True) for step in recipe.steps}
    using = [step for step in recipe.steps if whole[step.iri]][:MOST_STEPS]
    if len(using) < 2:
        return
    order = recipe_order(recipe)
    if added:
        order = Precedence.of(order.nodes, [*order.reduction(), *added])
    wished = {frozenset((before, after)) for before, after, _ in wise_orderings(actions, recipe, added)}

    def shared(first: Step, second: Step) -> frozenset[str]:
        """What both need; a recipe also holds what its steps need on the way, process modules take turns by step."""
        needs = whole if first.recipes or second.recipes else own
        return needs[first.iri] & needs[second.iri]

    pairs = [
        (first, second)
        for first, second in combinations(using, 2)
        if shared(first, second)
        and not order.ordered(first.iri, second.iri)
        and frozenset((first.iri, second.iri)) not in wished
    ]
    if pairs:
        first, second = pairs[0]
        both = " and the ".join(sorted(shared(first, second)))
        more = f" (and {len(pairs) - 1} more such pairs)" if len(pairs) > 1 else ""
        one, other = told_apart(first.iri, second.iri)
        message = (
            f"`{one}` and `{other}` both need the {both}, and nothing orders them: they come one after"
            f" the other, either first{more}"
        )
        advice = ordering_to_write(recipe, first.iri, second.iri)
        yield warning("R045", message, second.span, advice, Order(recipe.iri, first.iri, second.iri))


def _resources(
    actions: Actions, step: Step, recipes: RecipeSet, known: dict[str, frozenset[str]], *, with_implied: bool
) -> frozenset[str]:
    """Roles that a step needs, those of steps below it included; a role of the hand with the device if that is told.

    With ``with_implied`` those of what primitives do on the way, too. ``known`` are those of recipes (IRIs) that were
    asked for before.
    """
    primitive = actions.primitive(step)
    if primitive is not None:
        devices = sorted(thing.name for thing in step.fillers("deviceUsed") if isinstance(thing, Thing))
        on_the_way = (actions.primitives.get(action) for action in primitive.implies if with_implied)
        roles = {role for one in (primitive, *on_the_way) if one is not None for role in one.resources}
        return frozenset(
            f"{role} of {devices[0]}" if devices and role in ("arm", "gripper") else role
            for role in roles
            if role != BASE
        )
    for callee in step.recipes:
        if callee not in known:
            below = [_resources(actions, one, recipes, known, with_implied=with_implied) for one in
                     recipes.recipes[callee].steps]  # fmt: skip
            known[callee] = frozenset().union(*below)
    return frozenset(role for callee in step.recipes for role in known[callee])
