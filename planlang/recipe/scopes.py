"""Location scopes: which steps belong to the place where a base motion leads, and what order that adds.

A step belongs to the last base motion before it. If it is unordered with the next one it is put before it when it has
a location or an object, and stays outside otherwise. A scope is one unit: what is outside comes before or after all
of it, which may add orders; they are returned so that nothing is added silently.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from planlang.recipe.actions import Actions, Movers
from planlang.recipe.model import Place, Recipe, RecipeSet, Thing
from planlang.recipe.order import Precedence, recipe_order


@dataclass(frozen=True, slots=True)
class Unit:
    """One step, or a base motion (``base``) with the steps of its scope; ``steps`` leaves out the base motion."""

    base: str | None
    steps: tuple[str, ...]

    def members(self) -> tuple[str, ...]:
        """Return all steps of the unit, the base motion first."""
        return (self.base, *self.steps) if self.base else self.steps


@dataclass(frozen=True, slots=True)
class Scoping:
    """Units, an order of as many nodes in which these stand, and the orders that were added among steps.

    From ``added`` and the stated orders all orders of the scoped plan follow.
    """

    units: tuple[Unit, ...]
    order: Precedence[Any]
    added: tuple[tuple[str, str], ...]


def single_steps(stated: Precedence[str]) -> Scoping:
    """Return a scoping in which each step is a unit of its own."""
    return Scoping(tuple(Unit(None, (step,)) for step in stated.nodes), stated, ())


def scopes_of(actions: Actions, recipe: Recipe, recipes: RecipeSet, stated: Precedence[str]) -> Scoping:
    """Return the units of a recipe: single steps, without scopes, if a step has to run beside a base motion."""
    movers = actions.movers(recipe, recipes)
    overlapping = {iri for overlap in recipe.overlaps for iri in (overlap.first, overlap.second)}
    return single_steps(stated) if overlapping & movers.opening else scoping(stated, movers, placed(recipe))


def added_by_scopes(actions: Actions, recipe: Recipe, recipes: RecipeSet) -> tuple[tuple[str, str], ...]:
    """Return the step orders (IRIs) that scopes add; none if base motions are unordered. Stated orders are acyclic."""
    movers = actions.movers(recipe, recipes)
    if not movers.opening:
        return ()
    order = recipe_order(recipe)
    moving = [step for step in order.extension if step in movers.opening | movers.ending]
    if not all(order.before(first, second) for first, second in pairwise(moving)):
        return ()
    return scopes_of(actions, recipe, recipes, order).added


def placed(recipe: Recipe) -> frozenset[str]:
    """Return the steps that have a location or an object."""
    return frozenset(
        step.iri
        for step in recipe.steps
        if any(isinstance(parameter.filler, (Thing, Place)) for parameter in step.parameters)
    )


def scoping(stated: Precedence[str], movers: Movers, placed: frozenset[str]) -> Scoping:
    """Group the steps of an order in which the movers are totally ordered.

    ``placed`` are the steps that have a location or an object.
    """
    if not movers.opening:
        return single_steps(stated)
    is_moving = movers.opening | movers.ending
    moving = [step for step in stated.extension if step in is_moving]
    before_next = _put_before_next_motion(stated, moving, movers, placed)
    order = stated.extended(before_next)
    inside: dict[str, list[str]] = {}
    outside: set[str] = set()
    for step in stated.nodes:
        scope = _scope(order, moving, movers, step) if step not in is_moving else None
        if scope is None:
            outside.add(step)
        else:
            inside.setdefault(scope, []).append(step)
    units: list[Unit] = []
    for step in stated.nodes:
        if step in movers.opening:
            units.append(Unit(step, tuple(inside.get(step, ()))))
        elif step in outside:
            units.append(Unit(None, (step,)))
    unit_of = {member: index for index, unit in enumerate(units) for member in unit.members()}
    pairs = ((unit_of[a], unit_of[b]) for a, b in order.reduction())
    between = Precedence(range(len(units)), ((a, b) for a, b in pairs if a != b))
    return Scoping(tuple(units), between, _added(stated, order, units, between))


def _added(
    stated: Precedence[str], order: Precedence[str], units: Sequence[Unit], between: Precedence[int]
) -> tuple[tuple[str, str], ...]:
    """Return the unstated orders between units: from each last step of one to the first step of the next."""
    rank = {step: number for number, step in enumerate(stated.nodes)}
    added = []
    lasts: dict[int, list[str]] = {}
    for first, second in between.reduction():
        if first not in lasts:
            members = units[first].members()
            own = sum(order.bit(step) for step in members)
            lasts[first] = [step for step in members if not order.later(step) & own]
        following = units[second].members()[0]
        added += [(step, following) for step in lasts[first] if not stated.before(step, following)]
    return tuple(sorted(added, key=lambda pair: (rank[pair[0]], rank[pair[1]])))


def _moves_before(order: Precedence[str], moving: Sequence[str], step: str) -> int:
    """Return how many of the totally ordered base motions come before a step."""
    return bisect_left(moving, True, key=lambda base: not order.before(base, step))


def _put_before_next_motion(
    stated: Precedence[str], moving: Sequence[str], movers: Movers, placed: frozenset[str]
) -> list[tuple[str, str]]:
    added = []
    is_moving = frozenset(moving)
    for step in stated.nodes:
        if step not in placed or step in is_moving:
            continue
        number = _moves_before(stated, moving, step)
        if 0 < number < len(moving) and moving[number - 1] in movers.opening:  # between two motions, in a scope
            following = moving[number]
            if not stated.before(step, following):
                added.append((step, following))
    return added


def _scope(order: Precedence[str], moving: Sequence[str], movers: Movers, step: str) -> str | None:
    number = _moves_before(order, moving, step)
    if not number or moving[number - 1] not in movers.opening:
        return None
    if number < len(moving) and not order.before(step, moving[number]):
        return None
    return moving[number - 1]
