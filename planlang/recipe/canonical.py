"""Recipes in one order: what a file states, in whatever order, gives the same plan."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TypeVar

from planlang.closure import grouped, reached
from planlang.designators import local_name
from planlang.recipe.model import (
    Description,
    Filler,
    Name,
    Ordering,
    Parameter,
    Place,
    Reason,
    Recipe,
    RecipeSet,
    StateMachine,
    Step,
    Thing,
)

Key = tuple[tuple[int, int, str], ...]
_F = TypeVar("_F", bound=Filler)


def canonical(recipes: RecipeSet) -> RecipeSet:
    """Sort the statements of recipes.

    A file is a set of triples without an order, so equal statements have to give equal plans, however they are sorted
    in the file. Where the recipe leaves an order open, names decide, and numbers in them count as numbers. Recipes come
    in order of first use, the task first, by the order of steps.
    """
    sorted_recipes = {iri: _recipe(recipe) for iri, recipe in recipes.recipes.items()}
    in_order: dict[str, Recipe] = {}
    waiting = [recipes.task]
    while waiting:
        iri = waiting.pop()
        if iri not in in_order:
            in_order[iri] = sorted_recipes[iri]
            waiting += reversed([callee for step in sorted_recipes[iri].steps for callee in step.recipes])
    return replace(recipes, recipes=in_order)


def natural(name: str) -> Key:
    """Key for natural sorting: ``pour2`` before ``pour10``."""
    parts = re.split(r"([0-9]+)", name)
    return tuple((1, int(part), part) if index % 2 else (0, 0, part) for index, part in enumerate(parts))


def iri_key(iri: str | None) -> tuple[Key, str]:
    """Key that sorts IRIs by their local names."""
    return natural(local_name(iri or "")), iri or ""


def _recipe(recipe: Recipe) -> Recipe:
    keys = {step.iri: iri_key(step.iri) for step in recipe.steps}
    orderings = [one for one in recipe.orderings if one.before in keys and one.after in keys]
    rank = {iri: number for number, iri in enumerate(sorted(keys, key=keys.__getitem__))}

    constraint = Reason.CONSTRAINT.value  # looked up once: most orderings of a large recipe have this reason

    def order(ordering: Ordering) -> tuple[int, int, str, str]:
        before, after, iri, reason, _ = ordering
        return rank[before], rank[after], constraint if reason is Reason.CONSTRAINT else reason.value, iri or ""

    machine = recipe.machine
    if machine is not None:
        transitions = sorted(
            machine.transitions, key=lambda one: (iri_key(one.source), one.outcome or "", iri_key(one.target))
        )
        machine = replace(machine, transitions=tuple(transitions), ends=tuple(sorted(machine.ends, key=iri_key)))
    visit = _visits(machine) if machine is not None else {}
    return replace(
        recipe,
        steps=tuple(
            sorted(map(_step, recipe.steps), key=lambda step: (visit.get(step.iri, len(keys)), keys[step.iri]))
        ),
        orderings=tuple(sorted(orderings, key=order)),
        parameters=_parameters(recipe.parameters),
        overlaps=tuple(
            sorted(recipe.overlaps, key=lambda one: (iri_key(one.first), one.relation.value, iri_key(one.second)))
        ),
        flows=tuple(
            sorted(
                recipe.flows,
                key=lambda one: (iri_key(one.producer), iri_key(one.consumer), one.consumes or "", one.resource or ""),
            )
        ),
        machine=machine,
    )


def _visits(machine: StateMachine) -> dict[str, int]:
    """Reachable states, numbered breadth-first from the start."""
    after = grouped((transition.source, transition.target) for transition in machine.transitions)
    states = reached((machine.start,), lambda state: after.get(state, ()))
    return {state: number for number, state in enumerate(states)}


def _step(step: Step) -> Step:
    if not step.parameters and step.condition is None and len(step.recipes) < 2:
        return step
    condition = step.condition
    if condition is not None:
        condition = Description(condition.type, _parameters(condition.parameters))
    recipes = tuple(sorted(step.recipes, key=iri_key))
    return replace(step, parameters=_parameters(step.parameters), recipes=recipes, condition=condition)


def _parameters(parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    sorted_inside = (replace(parameter, filler=_filler(parameter.filler)) for parameter in parameters)
    return tuple(sorted(sorted_inside, key=lambda one: (one.property, _filler_key(one.filler))))


def _filler(filler: _F) -> _F:
    """Filler with the relations of a place, and of places nested in it, sorted by name."""
    if not isinstance(filler, Place):
        return filler
    relations = [(name, tuple(sorted(map(_filler, each), key=_filler_key))) for name, each in filler.relations]
    ordered = sorted(relations, key=lambda one: (one[0], [*map(_filler_key, one[1])]))
    return replace(filler, relations=tuple(ordered))


def _filler_key(filler: Filler) -> tuple[int, tuple[Key, str], str]:
    match filler:
        case Thing():
            return 0, iri_key(filler.iri or filler.stated), repr(filler)
        case Place() | Name():
            return 1, iri_key(filler.iri), ""
        case _:
            return 2, (natural(str(filler)), ""), repr(filler)
