"""Repairs that are safe to make, each with a note: exchanged fillers, and things given only by their class."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

from planlang.diagnostics import Diagnostic, note
from planlang.ontology import Ontology, expand
from planlang.ontology.terms import RDFS
from planlang.recipe.checks import check
from planlang.recipe.fillers import is_of_unknown_kind
from planlang.recipe.model import Kind, Parameter, Place, Recipe, RecipeSet, Thing


@check("R030", "R034", unless=("R022", "R023"))
def repaired(ontology: Ontology, recipes: RecipeSet) -> tuple[RecipeSet, list[Diagnostic]]:
    """Return the recipes with all repairs made, and a note for each."""
    notes: dict[Diagnostic, None] = {}
    mended: dict[str, Recipe] = {}
    for iri, recipe in recipes.recipes.items():
        steps = []
        for step in recipe.steps:
            parameters, found = _exchanged(ontology, step.parameters, step.name)
            notes.update(dict.fromkeys(found))
            steps.append(replace(step, parameters=parameters))
        parameters, found = _exchanged(ontology, recipe.parameters, recipe.name)
        notes.update(dict.fromkeys(found))
        mended[iri] = replace(recipe, steps=tuple(steps), parameters=parameters)
    exchanged = replace(recipes, recipes=mended)
    bound = {}
    for iri, recipe in mended.items():
        bound[iri], found = _bound(ontology, recipe, exchanged)
        notes.update(dict.fromkeys(found))
    return replace(recipes, recipes=bound), list(notes)


def violates_range(ontology: Ontology, property_name: str, cls: str) -> bool:
    """Return True if the property has a range and a class (IRI) is known not to be below it."""
    if is_of_unknown_kind(ontology, cls):
        return False
    return any(not ontology.is_a(cls, wanted) for wanted in ranges_of(ontology, property_name))


def ranges_of(ontology: Ontology, property_name: str) -> list[str]:
    """Return the classes (IRIs) in the range of a property."""
    return [
        triple.object
        for triple in ontology.triples(s=expand(property_name), p=RDFS.range)
        if isinstance(triple.object, str) and ontology.is_class(triple.object)
    ]


def _exchanged(
    ontology: Ontology, parameters: tuple[Parameter, ...], owner: str
) -> tuple[tuple[Parameter, ...], list[Diagnostic]]:
    """Exchange two fillers where one violates its property's range and the exchange violates nothing.

    What becomes the device must be a part of a robot: a pancake maker is a physical device too, and may well be what a
    bottle (which is none) is used on.
    """
    pair = exchanged_pair(ontology, parameters)
    if pair is None:
        return parameters, []
    (first, a), (second, b) = pair
    swap = {first: replace(first, filler=b), second: replace(second, filler=a)}
    message = (
        f"{first.property} `{a.name}` and {second.property} `{b.name}` of `{owner}` are exchanged:"
        f" read as {first.property} `{b.name}` and {second.property} `{a.name}`"
    )
    found = note("R030", message, first.span, "exchange them in the file")
    return tuple(swap.get(parameter, parameter) for parameter in parameters), [found]


def exchanged_pair(
    ontology: Ontology, parameters: tuple[Parameter, ...]
) -> tuple[tuple[Parameter, Thing], tuple[Parameter, Thing]] | None:
    """Return the first two parameters whose fillers, each given beside it, should be exchanged; None if all is well."""
    things = [(parameter, parameter.filler) for parameter in parameters if isinstance(parameter.filler, Thing)]
    single = [(p, thing) for p, thing in things if sum(q.property == p.property for q in parameters) == 1]
    for (first, a), (second, b) in combinations(single, 2):
        is_wrong = violates_range(ontology, first.property, a.stated) or violates_range(
            ontology, second.property, b.stated
        )
        if is_wrong and _fits(ontology, first.property, b) and _fits(ontology, second.property, a):
            return (first, a), (second, b)
    return None


def _fits(ontology: Ontology, property_name: str, thing: Thing) -> bool:
    is_device = thing.kind is Kind.DEVICE
    return not violates_range(ontology, property_name, thing.stated) and (property_name != "deviceUsed" or is_device)


def _bound(ontology: Ontology, recipe: Recipe, recipes: RecipeSet) -> tuple[Recipe, list[Diagnostic]]:
    """Replace a thing given only by its class by the only individual of that class in the recipe."""
    individuals = dict.fromkeys(thing for thing in _things_below(recipe, recipes) if thing.iri is not None)
    notes: list[Diagnostic] = []

    def bind(parameter: Parameter) -> Parameter:
        thing = parameter.filler
        if not isinstance(thing, Thing) or thing.iri is not None:
            return parameter
        fitting = [
            other for other in individuals if other.kind is thing.kind and ontology.is_a(other.stated, thing.stated)
        ]
        if len(fitting) != 1:
            return parameter
        only = fitting[0]
        message = f"{parameter.property} `{thing.name}` is read as `{only.name}`, the only one that the recipe names"
        notes.append(note("R034", message, parameter.span, f"write `{only.name}` if this is intended"))
        return replace(parameter, filler=only)

    steps = tuple(replace(step, parameters=tuple(map(bind, step.parameters))) for step in recipe.steps)
    return replace(recipe, steps=steps, parameters=tuple(map(bind, recipe.parameters))), notes


def _things_below(recipe: Recipe, recipes: RecipeSet) -> Iterator[Thing]:
    reached = {recipe.iri: recipe}
    waiting = [recipe]
    for one in waiting:
        for parameters in (one.parameters, *(step.parameters for step in one.steps)):
            for parameter in parameters:
                if isinstance(parameter.filler, Thing):
                    yield parameter.filler
                elif isinstance(parameter.filler, Place):
                    yield from parameter.filler.things()
        for callee in (callee for step in one.steps for callee in step.recipes):
            if callee not in reached and callee in recipes.recipes:
                reached[callee] = recipes.recipes[callee]
                waiting.append(reached[callee])
