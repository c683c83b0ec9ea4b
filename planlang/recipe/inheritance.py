"""Fill the slots that steps leave empty, from the action around them or with parameters of the plan."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error, warning
from planlang.ontology import shorten
from planlang.recipe.actions import Actions
from planlang.recipe.checks import check, listing
from planlang.recipe.fillers import fillings
from planlang.recipe.model import Absence, Filler, Parameter, Place, Recipe, RecipeSet, Slot, Step, Thing
from planlang.recipe.order import callees_first
from planlang.recipe.slots import fitting_parameters, in_words, parameter_for, requires_filler
from planlang.words import Blank, Option, Text


@check("R061", "R062", unless=("R022", "R023"))
def with_filled_slots(actions: Actions, recipes: RecipeSet) -> tuple[RecipeSet, list[Diagnostic]]:
    """Fill all required slots, and report what the caller of the task has to provide.

    An empty slot takes the only fitting filler of the enclosing recipe, or all of them if its class shares them. If
    that recipe states none, the step that calls it supplies the filler, and so on outward; the task itself gets a
    parameter of the plan. A motion target is looked up at most one level out: where a thing goes in the end is not
    where the hand reaches to pick it up.
    """
    supply = _Supply(actions, recipes)
    filled = {recipe.iri: supply.recipe(recipe) for recipe in callees_first(recipes)}
    return replace(recipes, recipes={iri: filled[iri] for iri in recipes.recipes}), list(supply.diagnostics)


class _Supply:
    def __init__(self, actions: Actions, recipes: RecipeSet) -> None:
        self._actions = actions
        self._ontology = actions.ontology
        self._task = recipes.task
        self._recipes = recipes.recipes
        self._requested: dict[str, dict[str, tuple[Slot, Recipe, Step]]] = {}
        """Recipe (IRI) -> property -> slot that its callers fill, its recipe, and the step that needs it first."""
        self.diagnostics: dict[Diagnostic, None] = {}

    def recipe(self, recipe: Recipe) -> Recipe:
        """Fill the slots of a recipe's steps; the recipes that it calls have to be processed first."""
        self._requested.setdefault(recipe.iri, {})
        more = {step.iri: self._missing(recipe, step) for step in recipe.steps}
        if not any(more.values()):
            return recipe
        steps = (replace(step, parameters=(*step.parameters, *more[step.iri])) for step in recipe.steps)
        return replace(recipe, steps=tuple(steps))

    def _missing(self, recipe: Recipe, step: Step) -> list[Parameter]:
        """Parameters for the empty slots of a step: its own, or those that its recipes request."""
        more: list[Parameter] = []
        if self._actions.is_standard(step):
            for slot in self._actions.slots(step.action_class).values():
                if self._is_stated(step, slot):
                    continue
                if slot.is_shared and (candidates := fitting_parameters(self._ontology, recipe, slot)):
                    more += [replace(one, is_inherited=True) for one in candidates]
                elif requires_filler(step, slot):
                    more += self._supplied(recipe, step, slot)
        for callee in step.recipes:
            for slot, inner, needing in self._requested[callee].values():
                if step.fillers(slot.property):
                    self._check_one(recipe, step, slot, local_name(callee))
                elif slot.absence is Absence.ERROR:
                    self._report_target(inner, needing, slot)
                elif slot.property not in {one.property for one in more} and not self._is_stated(step, slot):
                    more += self._supplied(recipe, step, slot)
        return more

    def _is_stated(self, step: Step, slot: Slot) -> bool:
        """True if a step states a filler, even one that cannot be read: other checks report those."""
        if step.fillers(slot.property):
            return True
        levels = fillings(self._ontology, step.iri)
        return any(local_name(filling.property) == slot.property for level in levels for filling in level)

    def _supplied(self, recipe: Recipe, step: Step, slot: Slot) -> list[Parameter]:
        """Parameter for an empty slot of a step; none for a missing motion target."""
        candidates = fitting_parameters(self._ontology, recipe, slot)
        if len(candidates) == 1:
            return [replace(candidates[0], is_inherited=True)]
        home = self._recipes[recipe.within] if recipe.within is not None else recipe
        is_called = home.iri != self._task
        is_target = slot.absence is Absence.ERROR
        own = self._actions.slots(home.action_class).get(slot.property)
        is_own = own is not None and own.absence is Absence.PARAMETER
        slot = own if own is not None and is_own else slot
        if candidates:
            thing = parameter_for(slot, f"{home.name}.{step.name}" if is_called else step.name)
            self._report(home, step, thing, [one.filler for one in candidates])
        elif slot.absence is Absence.ERROR and shorten(home.iri) != home.iri:
            return []  # recipes of the vocabulary state no targets; those come from the recipes that use them
        elif is_called:
            thing = parameter_for(slot, home.name)
            self._requested.setdefault(home.iri, {}).setdefault(slot.property, (slot, home, step))
        elif slot.absence is Absence.ERROR:
            self._report_target(home, step, slot)
            return []
        else:
            thing = parameter_for(slot, home.name if is_own else step.name)
            self._report(home, home if is_own and not is_target else step, thing)
        return [Parameter(slot.property, thing, step.span, is_inherited=True)]

    def _check_one(self, recipe: Recipe, step: Step, slot: Slot, callee: str) -> None:
        """Report a step that leaves open which of several fillers its recipe (name) uses."""
        fitting = [one.filler for one in fitting_parameters(self._ontology, step, slot)]
        if len(fitting) != 1:
            self._report(recipe, step, parameter_for(slot, callee), fitting)

    def _report_target(self, recipe: Recipe, step: Step, slot: Slot) -> None:
        message = f"`{step.name}` of `{recipe.name}` states no {slot.property}: the motion has no target"
        self.diagnostics[error("R061", message, self._where(step), _advice(step, slot))] = None

    def _report(self, recipe: Recipe, owner: Step | Recipe, thing: Thing, several: Iterable[Filler] = ()) -> None:
        """Report a required filler that is missing, or ambiguous among ``several``."""
        assert thing.slot is not None
        named = (one for one in several if isinstance(one, (Thing, Place)))
        iris = [one.iri or one.stated if isinstance(one, Thing) else one.iri for one in named]
        missing = f"does not state which {thing.slot.property} it needs: {listing(iris)}"
        if not iris:
            missing = f"states no {thing.slot.property}"
        who = f"`{owner.name}`" if owner is recipe else f"`{owner.name}` of `{recipe.name}`"
        passed = Option("set", {thing.name: Blank("X")})
        advice = Text(_advice(owner, thing.slot), ", or pass it when the plan runs: ", passed)
        message = f"{who} {missing}; it becomes a parameter of the plan"
        self.diagnostics[warning("R062", message, self._where(owner), advice)] = None

    def _where(self, owner: Step | Recipe) -> Span | None:
        """Position of an action's definition in the file, otherwise of its mention in a recipe."""
        return (self._ontology.span(owner.iri) if self._ontology.main(owner.iri) else None) or owner.span


def _advice(owner: Step | Recipe, slot: Slot) -> str:
    return f"add `{slot.property} value X` to `{owner.name}`, where X is {in_words(slot)}"
