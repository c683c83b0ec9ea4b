"""Preconditions of actions, and the actions of a recipe whose effects establish them.

Ontologies declare both (:mod:`planlang.action_conditions`). A condition that no step establishes may hold from the
start; it is reported only if a step establishes it too late.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from planlang.action_conditions import Condition, Effect, Named
from planlang.designators import local_name
from planlang.recipe.actions import Actions
from planlang.recipe.canonical import canonical
from planlang.recipe.model import Filler, Place, Recipe, RecipeSet, Step, Thing
from planlang.recipe.order import Precedence, recipe_order
from planlang.recipe.scopes import added_by_scopes
from planlang.records import dataclass

Before = Callable[[str, str], bool]
"""True if the first step (IRI) comes before the second in every execution."""


def iris_in(filler: Filler) -> Iterator[str]:
    """Yield the things and places (IRIs) that a filler names, including those that a place refers to."""
    if isinstance(filler, Thing):
        yield filler.iri or filler.stated
    elif isinstance(filler, Place):
        yield filler.iri
        for reference in filler.references():
            yield from iris_in(reference)


@dataclass(frozen=True, slots=True)
class Unmet:
    """A step with a condition that another step establishes only later."""

    step: str
    condition: Condition
    other: str

    @property
    def advice(self) -> str:
        """The correct order, as an instruction."""
        return f"order `{local_name(self.other)}` before `{local_name(self.step)}`"

    def __str__(self) -> str:
        establishes = f"`{local_name(self.other)}` establishes only afterwards"
        return f"`{local_name(self.step)}` needs {self.condition}, which {establishes}"


class Preconditions:
    """Conditions and effects of the steps of one recipe; a step with a recipe of its own has those of its class.

    With ``with_goal`` the recipe itself (its IRI) counts as a last step that needs the goal of the recipe.
    """

    def __init__(self, actions: Actions, recipe: Recipe, *, with_goal: bool = False) -> None:
        table = actions.declared
        self._needs: dict[str, list[Condition]] = {}
        self._effects: dict[str, list[tuple[str, Effect]]] = {}
        """Predicate -> steps (IRIs) with an effect on it, in the order of the recipe."""
        for step in recipe.steps:
            above, fillers = actions.ontology.ancestors(step.action_class), _fillers(step)
            needs = table.needed(above, fillers)
            if needs:
                self._needs[step.iri] = needs
            for effect in table.brought(above, fillers):
                self._effects.setdefault(effect.condition.predicate, []).append((step.iri, effect))
        if with_goal:
            goal = table.brought(actions.ontology.ancestors(recipe.action_class), _fillers(recipe))
            self._needs[recipe.iri] = [effect.condition for effect in goal]

    def unmet(self, before: Before) -> Iterator[Unmet]:
        """Yield conditions of steps that the recipe establishes only later, given the order of its steps."""
        for step, conditions in self._needs.items():
            late = next(filter(None, (self._late(step, one, before) for one in conditions)), None)
            if late is not None:
                yield late

    def _late(self, step: str, condition: Condition, before: Before) -> Unmet | None:
        """Reason why a condition cannot hold before a step; None if it may."""
        makers = [one for one in self._makers(condition) if one[0] != step]
        early = [one for one in makers if not before(step, one[0])]  # these may come before the step
        if not makers or any(self._works(iri, effect, before) for iri, effect in reversed(early)):
            return None
        for iri, effect in makers:  # prefer a step that only comes too late to one that cannot have its effect at all
            if before(step, iri) and self._works(iri, effect, before):
                return Unmet(step, condition, iri)
        causes = (self._late(iri, given, before) for iri, effect in early for given in effect.given)
        return next(filter(None, causes), None)

    def _makers(self, condition: Condition) -> list[tuple[str, Effect]]:
        return [one for one in self._effects.get(condition.predicate, ()) if one[1].condition.matches(condition)]

    def _works(self, step: str, effect: Effect, before: Before) -> bool:
        """True if a step may have its effect: all preconditions of the effect may hold before the step."""
        return all(
            not (makers := [one for one in self._makers(given) if one[0] != step])
            or any(not before(step, iri) and self._works(iri, one, before) for iri, one in makers)
            for given in effect.given
        )


def too_early(actions: Actions, recipes: RecipeSet) -> tuple[Unmet, ...]:
    """Find what a plan performs before its precondition, in the order that it takes where the recipes leave one open.

    Nothing is found if the orders of a recipe contradict each other.
    """
    found: dict[Unmet, None] = {}
    for recipe in canonical(recipes).recipes.values():
        try:
            order = recipe_order(recipe)
        except ValueError:
            return ()
        order = order.extended(added_by_scopes(actions, recipe, recipes))
        found |= dict.fromkeys(Preconditions(actions, recipe).unmet(_begun_before(order)))
    return tuple(found)


def _begun_before(order: Precedence[str]) -> Before:
    """Which step a plan begins first if all take equally long: each begins when all those before it have ended."""
    begun = dict.fromkeys(order.extension, 0)
    for step in order.extension:
        for following in order.covers(step):
            begun[following] = max(begun[following], begun[step] + 1)
    position = {step: number for number, step in enumerate(sorted(order.extension, key=begun.__getitem__))}
    return lambda first, second: position[first] < position[second]


def _fillers(step: Step | Recipe) -> Named:
    return lambda name: [one for filler in step.fillers(name) for one in iris_in(filler)]
