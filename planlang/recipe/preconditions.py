"""Preconditions of steps: what an action needs, and which steps of its recipe bring that about.

Ontologies declare both (``ontologies/primitives.omn``): a ``Precondition`` and an ``Effect`` of action classes, as
``predicate(property)``; the goal of a class is an effect of it, too. What no step of a recipe brings about may hold from
the beginning, so nothing is missing unless a step that brings it about comes too late.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from planlang.designators import local_name
from planlang.ontology import expand
from planlang.recipe.actions import Actions, texts
from planlang.recipe.model import Filler, Place, Recipe, Step, Thing

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
class Condition:
    """A predicate of things (IRIs); of anything if they are not stated."""

    predicate: str
    about: frozenset[str]

    def matches(self, other: Condition) -> bool:
        """Return True if both may be about the same."""
        return self.predicate == other.predicate and (
            not self.about or not other.about or not self.about.isdisjoint(other.about)
        )

    def __str__(self) -> str:
        things = min(map(local_name, self.about), default="")
        return f"{self.predicate}({things})"


@dataclass(frozen=True, slots=True)
class Unmet:
    """A step (IRI) that needs something which another one (IRI) brings about only later."""

    step: str
    condition: Condition
    later: str

    def __str__(self) -> str:
        first, second = local_name(self.step), local_name(self.later)
        return f"`{first}` needs {self.condition}, which `{second}` brings about only after it"


@dataclass(frozen=True, slots=True)
class _Effect:
    condition: Condition
    given: tuple[Condition, ...]


_Declared = dict[str, list[tuple[str, str, tuple[str, ...]]]]
"""Action class (IRI) -> predicates with the property of their argument, and the predicates given."""


class Preconditions:
    """What the steps of one recipe need and bring about. Recipes below them count as their class says."""

    def __init__(self, actions: Actions, recipe: Recipe) -> None:
        needs, effects = _declared(actions, "Precondition"), _declared(actions, "Effect")
        for goal in actions.goals.values():
            effects.setdefault(goal.action, []).append((goal.predicate, goal.properties[0], ()))
        self._needs: dict[str, list[Condition]] = {}
        self._effects: dict[str, list[tuple[str, _Effect]]] = {}
        """Predicate -> the steps (IRIs) that bring it about, in the order of the recipe."""
        for step in recipe.steps:
            above = actions.ontology.ancestors(step.action_class)
            conditions = [_condition(step, *one[:2]) for cls in above for one in needs.get(cls, ())]
            if conditions:
                self._needs[step.iri] = conditions
            for predicate, name, given in (one for cls in above for one in effects.get(cls, ())):
                made = _condition(step, predicate, name)
                wanted = tuple(_condition(step, *_parts(text)) for text in given)
                self._effects.setdefault(predicate, []).append((step.iri, _Effect(made, wanted)))

    def unmet(self, before: Before) -> Iterator[Unmet]:
        """Yield what steps need and the recipe brings about only after them, in an order of its steps."""
        for step, conditions in self._needs.items():
            for condition in conditions:
                late = self._late(step, condition, before)
                if late is not None:
                    yield late
                    break

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

    def _makers(self, condition: Condition) -> list[tuple[str, _Effect]]:
        return [one for one in self._effects.get(condition.predicate, ()) if one[1].condition.matches(condition)]

    def _works(self, step: str, effect: _Effect, before: Before) -> bool:
        """Return True if a step may bring its effect about: all that is given for it may hold before."""
        return all(
            not (makers := [one for one in self._makers(given) if one[0] != step])
            or any(not before(step, iri) and self._works(iri, one, before) for iri, one in makers)
            for given in effect.given
        )


def _condition(step: Step, predicate: str, name: str) -> Condition:
    return Condition(predicate, frozenset(one for filler in step.fillers(name) for one in named(filler)))


def _declared(actions: Actions, kind: str) -> _Declared:
    """Return the declarations of a kind, read once for each ontology."""
    kept: dict[str, _Declared] = actions.ontology.kept.setdefault("planlang.preconditions", {})
    if kind not in kept:
        kept[kind] = {}
        for individual in actions.ontology.individuals(expand(kind)):
            given = texts(actions.ontology, individual, "given")
            for action in actions.ontology.values(individual, expand("ofAction")):
                if isinstance(action, str):
                    for text in texts(actions.ontology, individual, "condition"):
                        kept[kind].setdefault(action, []).append((*_parts(text), given))
    return {cls: list(found) for cls, found in kept[kind].items()}


def _parts(text: str) -> tuple[str, str]:
    """Return the predicate and the property of ``predicate(property)``."""
    predicate, _, inside = text.partition("(")
    return predicate.strip(), inside.partition(",")[0].strip(") ")
