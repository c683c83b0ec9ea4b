"""Checks for unordered steps that need the same resource of the robot."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from planlang.designators import told_apart
from planlang.diagnostics import Diagnostic, Order, warning
from planlang.recipe.actions import Actions, Primitive
from planlang.recipe.checks import CheckedRecipe, check
from planlang.recipe.checks.orderings import ORDERS_UNKNOWN, RECURSIVE, ordering_to_write, plausible
from planlang.recipe.model import RecipeSet, Step, Thing
from planlang.recipe.order import Precedence, recipe_order

Needs = Mapping[str, frozenset[str]]
"""Step (IRI) -> resources of the robot that it needs."""

MOST_STEPS = 200
"""Maximum number of steps that are compared pair by pair: 20,000 pairs take about 20 ms."""


@check("R045", unless=(*RECURSIVE, "R012", *ORDERS_UNKNOWN))
def shared_resources(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report unordered steps that need the same resource of the robot, unless R042 suggests an order."""
    actions, recipe, recipes = checked.actions, checked.recipe, checked.file.recipes
    narrow: dict[str, frozenset[str]] = {}
    wide: dict[str, frozenset[str]] = {}
    own = {step.iri: _resources(actions, step, recipes, narrow, {}) for step in recipe.steps}
    whole = {step.iri: _resources(actions, step, recipes, wide, actions.primitives) for step in recipe.steps}
    using = [step for step in recipe.steps if whole[step.iri]][:MOST_STEPS]
    if len(using) < 2:
        return
    order = recipe_order(recipe)
    suggested = [(before, after) for before, after, _ in plausible(checked)]
    if checked.added or suggested:
        order = order.extended(suggested, weak=checked.added)

    def shared(first: Step, second: Step) -> frozenset[str]:
        """Resources that both steps need. A recipe holds those of its steps; process modules take turns per step."""
        needs = whole if first.recipes or second.recipes else own
        return needs[first.iri] & needs[second.iri]

    rivals = _rivals(using, own, whole, order)
    number = sum(bits.bit_count() for bits in rivals.values()) // 2
    if number:
        first, second = _nearest(using, rivals, order)
        both = " and the ".join(sorted(shared(first, second)))
        more = f" (and {number - 1} more such pairs)" if number > 1 else ""
        one, other = told_apart(first.iri, second.iri)
        message = f"`{one}` and `{other}` both need the {both} of the robot, and nothing says which comes first{more}"
        advice = f"if `{one}` comes first, {ordering_to_write(recipe, first.iri, second.iri)}"
        yield warning("R045", message, second.span, advice, Order(recipe.iri, first.iri, second.iri))


def _nearest(using: Sequence[Step], rivals: Mapping[str, int], order: Precedence[str]) -> tuple[Step, Step]:
    """Shrink the first pair of rivals to the closest one that conflicts: the last step before, the first step after."""
    first = next(step for step in using if rivals[step.iri])
    second = next(step for step in using if rivals[first.iri] & order.bit(step.iri))
    for one in using[: using.index(second)]:
        if rivals[second.iri] & order.bit(one.iri) and order.before(first.iri, one.iri):
            first = one
    for other in using[using.index(first) + 1 :]:
        if rivals[first.iri] & order.bit(other.iri) and order.before(other.iri, second.iri):
            second = other
    return first, second


def _rivals(using: Sequence[Step], own: Needs, whole: Needs, order: Precedence[str]) -> dict[str, int]:
    """Map each step (IRI) to the bits of the unordered steps that need one of its resources."""
    users: dict[tuple[bool, str], int] = {}
    recipes = 0
    for step in using:
        bit = order.bit(step.iri)
        recipes |= bit if step.recipes else 0
        for is_whole, needs in ((False, own), (True, whole)):
            for role in needs[step.iri]:
                users[is_whole, role] = users.get((is_whole, role), 0) | bit
    rivals: dict[str, int] = {}
    for step in using:
        sharing = 0
        for role in whole[step.iri]:
            sharing |= users[True, role] & (-1 if step.recipes else recipes)
        for role in () if step.recipes else own[step.iri]:
            sharing |= users[False, role] & ~recipes
        rivals[step.iri] = sharing & ~(order.later(step.iri) | order.earlier(step.iri) | order.bit(step.iri))
    return rivals


def _resources(
    actions: Actions,
    step: Step,
    recipes: RecipeSet,
    known: dict[str, frozenset[str]],
    side_effects: Mapping[str, Primitive],
) -> frozenset[str]:
    """Roles that a step and the steps below it need; a role of the hand includes its device if that is stated.

    ``side_effects`` are the actions of which the roles count, too, where a primitive performs them as side effects.
    ``known`` caches the roles of recipes (IRIs).
    """
    primitive = actions.primitive(step)
    if primitive is not None:
        devices = sorted(thing.name for thing in step.fillers("deviceUsed") if isinstance(thing, Thing))
        roles = {
            role for one in (primitive, *map(side_effects.get, primitive.implies)) if one for role in one.resources
        }
        return frozenset(
            f"{role} of {devices[0]}" if devices and role in ("arm", "gripper") else role
            for role in roles
            if role != "base"  # R040 checks the order of base motions
        )
    for callee in step.recipes:
        if callee not in known:
            steps = recipes.recipes[callee].steps
            below = (_resources(actions, one, recipes, known, side_effects) for one in steps)
            known[callee] = frozenset().union(*below)
    return frozenset(role for callee in step.recipes for role in known[callee])
