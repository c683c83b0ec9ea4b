"""The performers of an action as far as a recipe's file and the vocabulary know: recipes, or a primitive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from planlang.ontology import Ontology, shorten
from planlang.recipe.actions import Actions
from planlang.recipe.fillers import action_class, fillings, read_filler
from planlang.recipe.model import Parameter, Place
from planlang.recipe.statements import Statements


def recipes_for(actions: Actions, iri: str) -> tuple[tuple[str, ...], str | None]:
    """Return the performers of an action: classes with recipes, or a primitive class; the nearer wins.

    An individual's own recipe is nearer than any of its class. On a tie the primitive wins, and a recipe of the library
    is taken only where nothing else is at that distance. Several recipes at the same distance are alternatives.
    """
    if iri not in actions.performers:
        actions.performers[iri] = _performers(actions, iri)
    return actions.performers[iri]


def meant(actions: Actions, recipes: tuple[str, ...], parameters: Sequence[Parameter]) -> tuple[str, ...]:
    """Return those recipes that an action with these parameters means: of several of the library the best one.

    Least of what that states is not stated by the action, and most of what the action states.
    """
    if len(recipes) < 2 or not actions.is_of_library(recipes):
        return recipes
    stated = {(one.property, isinstance(one.filler, Place)) for one in parameters}

    def misfit(recipe: str) -> tuple[int, int]:
        own = _stated(actions.ontology, recipe)
        return len(own - stated), -len(own & stated)

    return (min(recipes, key=misfit),)


def _stated(ontology: Ontology, recipe: str) -> set[tuple[str, bool]]:
    """Return the properties, except of what is acted on, that a recipe states, and whether a place fills each."""
    levels = [filling for level in fillings(ontology, recipe) for filling in level]
    read = ((shorten(one.property), read_filler(ontology, one.term, one.property)) for one in levels)
    return {(name, isinstance(filler, Place)) for name, filler in read if name != "objectActedOn"}


def recipes_of_task(actions: Actions, iri: str) -> tuple[str, ...]:
    """Return what states the recipe of a task: itself also where a primitive performs it as a step of others."""
    return (iri,) if actions.statements(iri) is not None else recipes_for(actions, iri)[0]


def statements_for(actions: Actions, iri: str) -> Statements:
    """Return what the file states about a task with a recipe, or about the class that it inherits the recipe from."""
    statements = actions.statements(recipes_of_task(actions, iri)[0])
    assert statements is not None
    return statements


def _performers(actions: Actions, iri: str) -> tuple[tuple[str, ...], str | None]:
    for level in _levels(actions.ontology, iri):
        for ancestor in level:
            if ancestor in actions.primitives:
                return (), ancestor
        found = tuple(ancestor for ancestor in level if actions.statements(ancestor) is not None)
        found = found or tuple(recipe for ancestor in level for recipe in actions.library.get(ancestor, ()))
        if found:
            return found, None
    return (), None


def _levels(ontology: Ontology, iri: str) -> Iterator[tuple[str, ...]]:
    """Yield an individual; or a class, its direct superclasses, theirs, ...: each class once, at its least distance."""
    cls = iri
    if not ontology.is_class(iri):
        yield (iri,)
        cls = action_class(ontology, iri) or iri
    known = set(ontology.ancestors(cls))
    seen = {cls, iri}
    level: tuple[str, ...] = (cls,) if cls != iri or ontology.is_class(iri) else ()
    while level:
        yield level
        above: list[str] = []
        for member in level:
            for ancestor in ontology.parents(member):
                if ancestor in known and ancestor not in seen:
                    seen.add(ancestor)
                    above.append(ancestor)
        level = tuple(above)
