"""The steps that hold resources for as long as they last.

A resource is a role: base, torso, arm, gripper, head. A step with a recipe holds the roles of all its primitives from
its first to its last one where it is unordered with a step that shares a role with it; that one waits, and so holds
its own. Unordered primitives need no such order: process modules take turns by themselves.
"""

from __future__ import annotations

from planlang.compiler.names import snake_case
from planlang.compiler.terms import Terms, callees_first
from planlang.designators import local_name
from planlang.recipe.actions import Actions
from planlang.recipe.model import Recipe, RecipeSet, Step, Thing
from planlang.recipe.order import Precedence

ROLES = ("base", "torso", "arm", "gripper", "head")
"""The order in which a plan names roles; others follow by name."""

SIDED = frozenset({"arm", "gripper"})
"""Roles of which a robot has one on each side."""

SIDES = ("left", "right")

Role = tuple[str, str | None]
"""A role and its side; None where any side may be meant."""


class Roles:
    """The roles of one set of recipes. Without a device of one side in it the sides are not told apart."""

    def __init__(self, recipes: RecipeSet, actions: Actions, terms: Terms) -> None:
        self._recipes = recipes
        self._actions = actions
        self._terms = terms
        self._known: dict[tuple[str, str], frozenset[Role]] = {}
        for recipe in callees_first(recipes):
            for step in recipe.steps:
                self._roles(recipe, step)
        used = {role for step in recipes.main.steps for role in self._roles(recipes.main, step)}
        self._has_sides = any(side for _, side in used)

    def of(self, recipe: Recipe, step: Step) -> tuple[str, ...]:
        """Names of all that a step uses, itself or in the recipes below it; ``left_arm`` and ``right_arm`` if sided."""
        names = {name for role in self._roles(recipe, step) for name in self._names(*role)}
        return tuple(sorted(names, key=_rank))

    def held(self, recipe: Recipe, order: Precedence[str]) -> frozenset[str]:
        """Return the steps (IRIs) that hold their roles; ``order`` has all orders of the recipe's steps."""
        users: dict[str, int] = {}
        for step in recipe.steps:
            for name in self.of(recipe, step):
                users[name] = users.get(name, 0) | order.bit(step.iri)
        found = 0
        for step in recipe.steps:
            if step.recipes:
                sharing = 0
                for name in self.of(recipe, step):
                    sharing |= users[name]
                own = order.bit(step.iri)
                sharing &= ~(order.later(step.iri) | order.earlier(step.iri) | own)
                if sharing:
                    found |= sharing | own
        return frozenset(order.members(found))

    def _roles(self, recipe: Recipe, step: Step) -> frozenset[Role]:
        key = recipe.iri, step.iri
        if key not in self._known:
            self._known[key] = frozenset(self._found(recipe, step))
        return self._known[key]

    def _found(self, recipe: Recipe, step: Step) -> set[Role]:
        found: set[Role] = set()
        for callee in step.recipes:
            below = self._recipes.recipes[callee]
            found |= {role for inner in below.steps for role in self._roles(below, inner)}
        primitive = self._actions.primitive(step)
        if primitive is not None:
            side = _side(self._terms.device(recipe, step))
            found |= {(role, side if role in SIDED else None) for role in primitive.resources}
            implied = (self._actions.primitives.get(action) for action in primitive.implies)
            found |= {(role, None) for other in implied if other is not None for role in other.resources}
        return found

    def _names(self, role: str, side: str | None) -> tuple[str, ...]:
        if role not in SIDED or not self._has_sides:
            return (role,)
        return tuple(f"{one}_{role}" for one in SIDES if side in (one, None))


def _side(device: Thing | None) -> str | None:
    """Return the side in a device's name or its class in the vocabulary; None if neither, or both, are named."""
    if device is None:
        return None
    words = {word for name in (device.iri, device.type) if name for word in snake_case(local_name(name)).split("_")}
    told = [side for side in SIDES if side in words]
    return told[0] if len(told) == 1 else None


def _rank(name: str) -> tuple[int, str]:
    role = name.rsplit("_", 1)[-1]
    return (ROLES.index(role) if role in ROLES else len(ROLES)), name
