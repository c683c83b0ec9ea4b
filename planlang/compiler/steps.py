"""Single steps as nodes of the plan tree: performed or called, with goals, recoveries and resources around them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from collections.abc import Set as AbstractSet

from planlang.compiler.naming import snake_case
from planlang.compiler.recoveries import Recoveries
from planlang.compiler.roles import Roles
from planlang.compiler.terms import Renaming, Terms
from planlang.compiler.tree import (
    Achieve,
    Call,
    Condition,
    FunctionCall,
    Handle,
    Hold,
    Node,
    Perform,
    Recover,
)
from planlang.recipe.actions import Actions
from planlang.recipe.model import Kind, Recipe, RecipeSet, Step, Thing


class Steps:
    """Makes nodes of the steps of one set of recipes; called recipes have to be asked for before their callers."""

    def __init__(self, recipes: RecipeSet, actions: Actions, terms: Terms, roles: Roles) -> None:
        self._recipes = recipes
        self._actions = actions
        self._terms = terms
        self._roles = roles
        self.recoveries = Recoveries(actions)
        self._around: dict[str, tuple[Recover, ...]] = {}
        """Of a recipe that stays where it is the recoveries of its steps that leave the place, one for each failure."""

        self.said: dict[tuple[str, str], tuple[str, ...]] = {}
        """Of a step of a recipe (both IRIs) what is done when it fails, in words."""

    def node(self, recipe: Recipe, step: Step, holding: AbstractSet[str]) -> Node:
        """A step; it holds its resources if it is one of ``holding`` (IRIs)."""
        node: Node
        if step.recipes:
            calls = tuple(self._call(recipe, step, callee) for callee in step.recipes)
            action = self._terms.action(recipe, step) if self._terms.is_performed(step) else None
            node = Call(step.name, action, calls, step.iri)
        else:
            node = Perform(step.name, self._terms.action(recipe, step), step.label, step.iri)
        condition = self._goal(step)
        if condition is not None:
            node = Achieve(condition, node)
        written = self.recoveries.names(recipe.action_class)
        recoveries = self.recoveries.around_step(step.action_class, self._about(recipe, step), written)
        if recoveries:
            node = Handle(node, recoveries)
        leaving = self.recoveries.around_scope(step, self.recoveries.looked_at(step))
        self.said[recipe.iri, step.iri] = tuple(map(_in_words, (*recoveries, *leaving)))
        if step.iri in holding:
            node = Hold(step.name, self._roles.of(recipe, step), node)
        return node

    def with_looking(self, recipe: Recipe, node: Node, steps: Iterable[Step]) -> Node:
        """The node with the recoveries that leave its place: those of all its steps, one for each failure."""
        found = self._leaving(recipe, steps)
        if not found:
            return node
        if isinstance(node, Handle):
            return Handle(node.body, (*node.recoveries, *found))
        return Handle(node, found)

    def _leaving(self, recipe: Recipe, steps: Iterable[Step]) -> tuple[Recover, ...]:
        found: dict[str, Recover] = {}
        for recovery in self._around_scope(recipe, steps):
            found.setdefault(recovery.failure, recovery)
        return tuple(found.values())

    def _around_scope(self, recipe: Recipe, steps: Iterable[Step]) -> Iterator[Recover]:
        for step in steps:
            yield from self.recoveries.around_scope(step, self.recoveries.looked_at(step))
            for callee in step.recipes:
                below = self._recipes.recipes[callee]
                if not self._actions.moves_the_base(below, self._recipes):
                    if callee not in self._around:
                        self._around[callee] = self._leaving(below, self._terms.steps(below))
                    renaming = self._terms.renaming(recipe, step, callee)
                    yield from (_renamed(recovery, renaming) for recovery in self._around[callee])

    def _call(self, recipe: Recipe, step: Step, callee: str) -> FunctionCall:
        renaming = self._terms.renaming(recipe, step, callee)
        return FunctionCall(
            callee, tuple((own, self._terms.handed(recipe, step, given)) for own, given in renaming.items())
        )

    def _goal(self, step: Step) -> Condition | None:
        goal = self._actions.goal(step.action_class)
        if goal is None:
            return None
        fillers = [next(iter(step.fillers(name)), None) for name in goal.properties]
        things = tuple(filler for filler in fillers if isinstance(filler, Thing))
        return Condition(goal.predicate, things) if len(things) == len(fillers) else None

    def _about(self, recipe: Recipe, step: Step) -> Thing | None:
        """What a recovery looks at: what the step handles, else what its recipe acts on, else the only object."""
        own = self.recoveries.looked_at(step)
        if own is not None:
            return own
        acted_on = [filler for filler in recipe.fillers("objectActedOn") if isinstance(filler, Thing)]
        objects = [thing for thing in self._terms.parameters(recipe) if thing.kind is Kind.OBJECT]
        known = [thing for thing in acted_on if thing in objects] or objects
        return known[0] if len(known) == 1 else None


def _in_words(recovery: Recover) -> str:
    about = f" ({recovery.about.name})" if recovery.about is not None else ""
    what = f"{snake_case(recovery.strategy.name).replace('_', ' ')}{about}"
    times = "once" if recovery.attempts == 1 else f"up to {recovery.attempts} times"
    tried = f"{what}, {times}" if recovery.attempts else what
    return f"on {recovery.failure}: {tried}" + (f", else {recovery.otherwise}" if recovery.otherwise else "")


def _renamed(recovery: Recover, renaming: Renaming) -> Recover:
    """A recovery of a called function in terms of its caller."""
    about = renaming.get(recovery.about, recovery.about) if recovery.about is not None else None
    return Recover(recovery.failure, recovery.strategy, about, recovery.attempts, recovery.otherwise)
