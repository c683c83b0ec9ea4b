"""The things among the parameters of a recipe: what has to be recognised, and what a map has to have."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.ontology import expand
from planlang.recipe import Actions, Kind, Place, RecipeSet, Thing
from planlang.recipe.model import Constraint, Filler, Part
from planlang.recipe.readers import OUTPUTS


def things_of(actions: Actions, recipes: RecipeSet) -> tuple[Thing, ...]:
    """Return the objects and persons that a recipe and those below it name, without what a caller or user gives.

    Recipes of the library are about what their callers name.
    """
    found = (thing for _, filler in _fillers(actions, recipes) for thing in _things(filler))
    return tuple(dict.fromkeys(one for one in found if one.kind in (Kind.OBJECT, Kind.PERSON) and one.slot is None))


def made_by(actions: Actions, recipes: RecipeSet) -> frozenset[Thing]:
    """Return what a recipe makes itself: no map has it."""
    found = (_things(filler) for name, filler in _fillers(actions, recipes) if name in OUTPUTS)
    return frozenset(thing for things in found for thing in things)


def class_of(thing: Thing) -> str:
    """Return the class (IRI) of a thing: that which the recipe states, else the nearest one of the vocabulary."""
    return thing.stated or expand(thing.type)


def _fillers(actions: Actions, recipes: RecipeSet) -> Iterator[tuple[str, Filler]]:
    """Yield the properties and fillers of recipes and steps that do not stand in the library."""
    for recipe in recipes.recipes.values():
        if not actions.is_of_library([recipe.iri]):
            for one in (*recipe.parameters, *(stated for step in recipe.steps for stated in step.parameters)):
                yield one.property, one.filler


def _things(filler: Filler) -> Iterator[Thing]:
    match filler:
        case Thing():
            yield filler
        case Place():
            yield from filler.things()
        case Part(of=of):
            yield of
        case Constraint(tool=tool, world=world):
            yield from (tool.of, world.of)
