"""Checks of location designators: how many things a relation of theirs relates to."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.diagnostics import Diagnostic, error
from planlang.recipe.checks import CheckedRecipe, check
from planlang.recipe.model import Place
from planlang.relations import RELATIONS


@check("R070")
def numbers_of_references(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report relations to several things of which a place states fewer or more."""
    stated = [(one.filler, one.span) for owner in checked.owners for one in owner.parameters]
    places = [(place, span) for filler, span in stated if isinstance(filler, Place) for place in filler.places()]
    for place, span in dict(places).items():
        for name, references in place.relations:
            relation, number = RELATIONS[name], len(references)
            if number != relation.arity:
                message = f"{relation.owl} of the place `{place.name}` relates to {number} of {relation.arity} things"
                advice = "state a fact for each thing, and a place of its own for each pair"
                yield error("R070", message, checked.ontology.span(place.iri) or span, advice)
