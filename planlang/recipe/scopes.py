"""Location scopes: a base motion with the steps that are done from where it leads.

Scopes add orders. A step belongs to the last base motion before it. If it is unordered with the next one, it
is put before that one if it has a location or an object, and stays outside otherwise. A scope is one unit: steps
outside come before or after all of it, which may add orders; they are returned, so that a note can report them.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from planlang.recipe.actions import Actions, Movers
from planlang.recipe.model import Place, Recipe, RecipeSet, Step, Thing
from planlang.recipe.order import Precedence, recipe_order
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Unit:
    """One step, or a base motion (``base``) with the other steps of its location scope (``steps``)."""

    base: str | None
    steps: tuple[str, ...]

    def members(self) -> tuple[str, ...]:
        """All steps of the unit, the base motion first."""
        return (self.base, *self.steps) if self.base else self.steps


@dataclass(frozen=True, slots=True)
class Scoping:
    """Units, the partial order of their indices, and the orders that scopes add among steps.

    The stated orders and ``added`` together imply all orders of the scoped plan.
    """

    units: tuple[Unit, ...]
    order: Precedence[Any]
    added: tuple[tuple[str, str], ...]


def single_steps(stated: Precedence[str]) -> Scoping:
    """Scoping in which each step is a unit of its own."""
    return Scoping(tuple(Unit(None, (step,)) for step in stated.nodes), stated, ())


def scopes_of(actions: Actions, recipe: Recipe, recipes: RecipeSet, stated: Precedence[str]) -> Scoping:
    """Group the steps of a recipe into units; no scopes if a step has to run in parallel to a base motion.

    Steps that bring a thing from one place to another are in no scope, as far as the orders allow that.
    """
    movers, placed = actions.movers(recipe, recipes), steps_with_target(recipe)
    overlapping = {iri for overlap in recipe.overlaps for iri in (overlap.first, overlap.second)}
    if overlapping & movers.opening:
        return single_steps(stated)
    elsewhere = _working_elsewhere(actions, recipe, recipes, stated, movers) if movers.opening else frozenset[str]()
    every = movers.opening | movers.ending | elsewhere
    ordered = {step for step in elsewhere if all(other == step or stated.ordered(step, other) for other in every)}
    try:
        ending = Movers(movers.opening, movers.ending | ordered)
        return scoping(stated, ending, placed, elsewhere - ordered)
    except ValueError:  # the steps of a scope come before and after one that would be outside
        return scoping(stated, movers, placed)


def _working_elsewhere(
    actions: Actions, recipe: Recipe, recipes: RecipeSet, stated: Precedence[str], movers: Movers
) -> frozenset[str]:
    """Find the steps that drive by themselves and for which one place is not enough.

    They bring a thing, or put down what has been taken since the last base motion before them.
    """
    by_themselves = [step for step in recipe.steps if actions.finds_its_place(step, recipes)]
    taking = [step for step in by_themselves if actions.takes(step)]

    def is_taken_here(step: Step) -> bool:
        """Check whether an earlier step takes the thing, and no base motion comes between them."""
        what = set(step.fillers("objectActedOn"))
        return any(
            not what.isdisjoint(first.fillers("objectActedOn"))
            and stated.before(first.iri, step.iri)
            and not any(stated.before(first.iri, base) and stated.before(base, step.iri) for base in movers.opening)
            for first in taking
        )

    return frozenset(
        step.iri
        for step in by_themselves
        if actions.brings(step, recipes) or (actions.releases(step) and is_taken_here(step))
    )


def added_by_scopes(actions: Actions, recipe: Recipe, recipes: RecipeSet) -> tuple[tuple[str, str], ...]:
    """Orders of steps (IRIs) that scopes add; none if base motions are unordered. Stated orders must be acyclic."""
    movers = actions.movers(recipe, recipes)
    if not movers.opening:
        return ()
    order = recipe_order(recipe)
    moving = [step for step in order.extension if step in movers.opening | movers.ending]
    if not all(order.before(first, second) for first, second in pairwise(moving)):
        return ()
    return scopes_of(actions, recipe, recipes, order).added


def steps_with_target(recipe: Recipe) -> frozenset[str]:
    """Steps that have a location or an object."""
    return frozenset(
        step.iri
        for step in recipe.steps
        if any(isinstance(parameter.filler, (Thing, Place)) for parameter in step.parameters)
    )


def scoping(
    stated: Precedence[str], movers: Movers, placed: frozenset[str], alone: frozenset[str] = frozenset()
) -> Scoping:
    """Group the steps of an order in which the movers are totally ordered.

    ``placed`` are the steps that have a location or an object, ``alone`` those that stay outside of scopes. Raises
    ValueError if the orders do not allow that.
    """
    if not movers.opening:
        return single_steps(stated)
    is_moving = movers.opening | movers.ending
    moving = [step for step in stated.extension if step in is_moving]
    before_next = _put_before_next_motion(stated, moving, movers, placed)
    order = stated.extended(before_next)
    inside: dict[str, list[str]] = {}
    outside: set[str] = set()
    unscoped = is_moving | alone
    for step in stated.nodes:
        scope = _scope(order, moving, movers, step) if step not in unscoped else None
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
    """Orders between units that are not stated: from each last step of a unit to the first step of the next one."""
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
    """Number of the totally ordered base motions that come before a step."""
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
        if 0 < number < len(moving) and moving[number - 1] in movers.opening:  # in a scope that another motion ends
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
