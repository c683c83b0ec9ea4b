"""Preconditions of actions: what an action needs, and which actions of a recipe or of a run bring that about.

Ontologies declare both (:mod:`planlang.action_conditions`). What nothing brings about may hold from the beginning, so
nothing is missing unless it is brought about too late.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from planlang.action_conditions import Condition, Effect, Named
from planlang.designators import local_name
from planlang.recipe.actions import Actions
from planlang.recipe.model import Filler, Place, Recipe, Step, Thing
from planlang.records import dataclass

Before = Callable[[str, str], bool]
"""True if the first step (IRI) surely comes before the second."""


def named(filler: Filler) -> Iterator[str]:
    """Yield the things and places (IRIs) that a filler names, those that a place relates to included."""
    if isinstance(filler, Thing):
        yield filler.iri or filler.stated
    elif isinstance(filler, Place):
        yield filler.iri
        for _, reference in filler.relations:
            yield from named(reference)


@dataclass(frozen=True, slots=True)
class Unmet:
    """A step that needs something which another one brings about only later, or has ended before."""

    step: str
    condition: Condition
    other: str
    is_over: bool = False

    @property
    def advice(self) -> str:
        """The order that would be right."""
        step, other = local_name(self.step), local_name(self.other)
        if self.is_over:
            return f"order `{other}` after `{step}`, or before what brings about {self.condition}"
        return f"order `{other}` before `{step}`"

    def __str__(self) -> str:
        when = "has ended before it" if self.is_over else "brings about only after it"
        return f"`{local_name(self.step)}` needs {self.condition}, which `{local_name(self.other)}` {when}"


class Preconditions:
    """What the steps of one recipe need and bring about. Recipes below them count as their class says.

    With ``with_goal`` the recipe itself (its IRI) counts as a step that needs what the recipe is to bring about.
    """

    def __init__(self, actions: Actions, recipe: Recipe, *, with_goal: bool = False) -> None:
        table = actions.declared
        self._needs: dict[str, list[Condition]] = {}
        self._effects: dict[str, list[tuple[str, Effect]]] = {}
        """Predicate -> the steps (IRIs) that bring it about, in the order of the recipe."""
        for step in recipe.steps:
            above, fillers = actions.ontology.ancestors(step.action_class), _fillers(step)
            needs = table.needed(above, fillers)
            if needs:
                self._needs[step.iri] = needs
            for effect in table.brought(above, fillers):
                self._effects.setdefault(effect.condition.predicate, []).append((step.iri, effect))
        if with_goal:
            wanted = table.brought(actions.ontology.ancestors(recipe.action_class), _fillers(recipe))
            self._needs[recipe.iri] = [effect.condition for effect in wanted]

    def unmet(self, before: Before) -> Iterator[Unmet]:
        """Yield what steps need and the recipe brings about only after them, in an order of its steps."""
        for step, conditions in self._needs.items():
            late = next(filter(None, (self._late(step, one, before) for one in conditions)), None)
            if late is not None:
                yield late

    def _late(self, step: str, condition: Condition, before: Before) -> Unmet | None:
        """Return why a condition cannot hold before a step; None if it may."""
        makers = [one for one in self._makers(condition) if one[0] != step]
        early = [one for one in makers if not before(step, one[0])]
        if not makers or any(self._works(iri, effect, before) for iri, effect in reversed(early)):
            return None
        for iri, effect in makers:
            if before(step, iri) and self._works(iri, effect, before):
                return Unmet(step, condition, iri)
        found = (self._late(iri, given, before) for iri, effect in early for given in effect.given)
        return next(filter(None, found), None)

    def _makers(self, condition: Condition) -> list[tuple[str, Effect]]:
        return [one for one in self._effects.get(condition.predicate, ()) if one[1].condition.matches(condition)]

    def _works(self, step: str, effect: Effect, before: Before) -> bool:
        """Return True if a step may bring its effect about: all that is given for it may hold before."""
        return all(
            not (makers := [one for one in self._makers(given) if one[0] != step])
            or any(not before(step, iri) and self._works(iri, one, before) for iri, one in makers)
            for given in effect.given
        )


def _fillers(step: Step | Recipe) -> Named:
    return lambda name: [one for filler in step.fillers(name) for one in named(filler)]
