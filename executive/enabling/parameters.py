"""The things among the parameters of a recipe: what has to be recognised, and what a map has to have."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planlang.effects import effects_of, heat_effects
from planlang.ontology import Ontology, expand
from planlang.recipe import Actions, Kind, Place, RecipeSet, Step, Thing
from planlang.recipe.actions import gone_to
from planlang.recipe.model import Constraint, Filler, Part
from planlang.recipe.readers import OUTPUTS


def things_of(actions: Actions, recipes: RecipeSet) -> tuple[Thing, ...]:
    """Return the objects and persons that a recipe and those below it are about: what a map has to have.

    That is without what the recipe makes itself, and without what a caller or user gives. Recipes of the library are
    about what their callers name.
    """
    return _without_made(actions, recipes, (thing for _, filler in _fillers(actions, recipes) for thing in _in(filler)))


def handled_by(actions: Actions, recipes: RecipeSet) -> tuple[Thing, ...]:
    """Return those of them that steps perceive or handle, and that have to be recognised for that.

    Of the places of a step that is what a run looks at before the hand goes there.
    """
    handled = (thing for step in _steps(actions, recipes) for thing in _handled(step))
    return _without_made(actions, recipes, handled)


def class_of(thing: Thing) -> str:
    """Return the class (IRI) of a thing: that which the recipe states, else the nearest one of the vocabulary."""
    return thing.stated or expand(thing.type)


def _handled(step: Step) -> Iterator[Thing]:
    for one in step.parameters:
        if one.property == "toLocation":
            yield from gone_to(one.filler)
        elif not isinstance(one.filler, Place):
            yield from _in(one.filler)


def _without_made(actions: Actions, recipes: RecipeSet, things: Iterable[Thing]) -> tuple[Thing, ...]:
    fillers = list(_fillers(actions, recipes))
    named = {thing for name, filler in fillers if name in OUTPUTS for thing in _in(filler)}
    made, is_a = _classes_made(actions.ontology, _steps(actions, recipes)), actions.ontology.is_a
    found = (one for one in things if one.kind in (Kind.OBJECT, Kind.PERSON) and one.slot is None and one not in named)
    return tuple(
        one
        for one in dict.fromkeys(found)
        if not any(is_a(class_of(one), cls) or is_a(cls, class_of(one)) for cls in made)
    )


def _classes_made(ontology: Ontology, steps: Iterable[Step]) -> frozenset[str]:
    """Return the classes of what steps make, and of what heat makes of that and of what they pour."""
    made: set[str] = set()
    poured: set[str] = set()
    for step in steps:
        effects = effects_of(ontology, step.action_class)
        made.update(effects.created)
        if effects.flow_rate:
            poured.update(class_of(one) for one in step.fillers("objectActedOn") if isinstance(one, Thing))
    for heat in heat_effects(ontology):
        if ontology.any_is_a(made | poured, heat.inputs):
            made.add(heat.output)
    return frozenset(made)


def _fillers(actions: Actions, recipes: RecipeSet) -> Iterator[tuple[str, Filler]]:
    """Yield the properties and fillers of recipes and steps that do not stand in the library."""
    for recipe in recipes.recipes.values():
        if not actions.is_of_library([recipe.iri]):
            for one in (*recipe.parameters, *(stated for step in recipe.steps for stated in step.parameters)):
                yield one.property, one.filler


def _steps(actions: Actions, recipes: RecipeSet) -> Iterator[Step]:
    for recipe in recipes.recipes.values():
        if not actions.is_of_library([recipe.iri]):
            yield from recipe.steps


def _in(filler: Filler) -> Iterator[Thing]:
    match filler:
        case Thing():
            yield filler
        case Place():
            yield from filler.things()
        case Part(of=of):
            yield of
        case Constraint(tool=tool, world=world):
            yield from (tool.of, world.of)
