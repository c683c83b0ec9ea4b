"""Checks of location designators: that they relate to something, by relations that are known."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from functools import cache

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error, warning
from planlang.ontology import Ontology, expand
from planlang.ontology.terms import COMMENT, LABEL, OWL, TYPE
from planlang.recipe.actions import Actions
from planlang.recipe.guesses import guess
from planlang.recipe.model import Place, Recipe, Step
from planlang.recipe.terms import is_relation, references
from planlang.relations import owl_properties
from planlang.resources import bundled

ANNOTATION_PROPERTY = OWL + "AnnotationProperty"

_NO_NAME = re.compile(r"pose|posture|position|[\W_\d]+", re.IGNORECASE)
"""What the name of a posture may have besides the posture's own."""


def check_places(actions: Actions, owner: Step | Recipe, known: frozenset[str]) -> Iterator[Diagnostic]:
    """Judge the places of a step, or of a task itself; ``known`` are individuals that steps create."""
    ontology = actions.ontology
    for parameter in owner.parameters:
        if isinstance(parameter.filler, Place):
            yield from _unrelated(actions, owner, parameter.filler, known, parameter.span)
            for place in _places(parameter.filler):
                yield from _left_out(ontology, place)


def _unrelated(
    actions: Actions, owner: Step | Recipe, place: Place, known: frozenset[str], span: Span | None
) -> Iterator[Diagnostic]:
    """A place without relation: an error for the base, a warning for the hand unless robots have such a posture."""
    if not place.is_posture or place.iri in known:
        return
    where = actions.ontology.span(place.iri) or span
    nothing = "anything" if not any(references(actions.ontology, place.iri)) else "anything that is somewhere"
    advice = f"give `{place.name}` one of {', '.join(owl_properties())}"
    if isinstance(owner, Step) and actions.is_base_motion(owner):
        message = f"`{owner.name}` moves the base to `{place.name}`, which has no relation to {nothing}"
        yield error("R036", message, where, advice)
    elif _NO_NAME.sub("", place.name).lower() not in postures():
        message = (
            f"`{place.name}`, a place of `{owner.name}`, has no relation to {nothing}: it is taken as a posture of the"
            f" robot's own, but no bundled robot has one of that name"
        )
        yield warning("R036", message, where, f"{advice}; postures are {', '.join(sorted(postures()))}")


def _left_out(ontology: Ontology, place: Place) -> Iterator[Diagnostic]:
    """Statements about a place that are no relations which locations have."""
    stated = [(triple.predicate, triple.span) for triple in ontology.triples(s=place.iri)]
    stated = [one for one in stated if one[0].partition("#")[0] not in _LANGUAGES]
    stated += [(one.property, one.span) for one in ontology.restrictions(place.iri)]
    for property_name, span in dict(reversed(stated)).items():
        if is_relation(property_name) or ANNOTATION_PROPERTY in ontology.values(property_name, TYPE):
            continue
        short = local_name(property_name)
        meant = guess(property_name, map(expand, owl_properties()), least=0.75)
        advice = f"did you mean {meant}?" if meant else f"relations are {', '.join(owl_properties())}"
        message = f"{short} of the place `{place.name}` is left out: it is no relation"
        yield warning("R038", message, span, advice, meant)


_LANGUAGES = {iri.partition("#")[0] for iri in (TYPE, LABEL, COMMENT, OWL)}


def _places(place: Place) -> Iterator[Place]:
    """A place and those that it relates to."""
    yield place
    for _, reference in place.relations:
        if isinstance(reference, Place):
            yield from _places(reference)


@cache
def postures() -> frozenset[str]:
    """The names of the postures that bundled robots have, without separators."""
    names: set[str] = set()
    for path in (bundled("ontologies") / "robots").glob("*.toml"):
        names |= set(tomllib.loads(path.read_text(encoding="utf-8")).get("postures", {}))
    return frozenset(_NO_NAME.sub("", name).lower() for name in names)
