"""Things among the parameters of a recipe: which ones the robot has to recognise, and which a map has to contain."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planlang.effects import effects_of, heat_effects
from planlang.ontology import Ontology, expand
from planlang.recipe import Actions, Kind, Place, RecipeSet, Step, Thing
from planlang.recipe.actions import gone_to
from planlang.recipe.model import Constraint, Filler, Part
from planlang.recipe.readers import OUTPUTS


def things_of(actions: Actions, recipes: RecipeSet) -> tuple[Thing, ...]:
    """Objects and persons in the parameters of a recipe and its subrecipes, which a map has to contain.

    Left out are the products of the recipe itself, parameters that a caller or user fills, and recipes of the library,
    whose parameters come from their callers.
    """
    return _without_made(actions, recipes, (thing for _, filler in _fillers(actions, recipes) for thing in _in(filler)))


def handled_by(actions: Actions, recipes: RecipeSet) -> tuple[Thing, ...]:
    """Things that steps perceive or handle, and that the robot therefore has to recognise.

    For locations of a step these are the things that the robot looks at before its hand goes there.
    """
    handled = (thing for step in _steps(actions, recipes) for thing in _handled(step))
    return _without_made(actions, recipes, handled)


def class_of(thing: Thing) -> str:
    """IRI of a thing's class: the one in the recipe, else the nearest one of the vocabulary."""
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
    """Classes of the things that steps create, and of what heat turns these and poured things into."""
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
    """Yield properties and fillers of the recipes outside the library, and of their steps."""
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
