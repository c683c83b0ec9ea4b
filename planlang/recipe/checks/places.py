"""Checks of location designators: that they relate to something, by relations that are known."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from functools import cache

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Severity, Span, error, warning
from planlang.ontology import Ontology, expand
from planlang.ontology.terms import OWL, RDF, RDFS
from planlang.recipe.actions import Actions
from planlang.recipe.checks import CheckedFile, CheckedRecipe, check
from planlang.recipe.checks.misspellings import guess
from planlang.recipe.fillers import is_place, is_relation, read_thing, references
from planlang.recipe.model import Place, Recipe, Step
from planlang.recipe.readers.data_flow import made
from planlang.relations import owl_properties
from planlang.resources import bundled

ANNOTATION_PROPERTY = OWL.AnnotationProperty

_NO_NAME = re.compile(r"pose|posture|position|[\W_\d]+", re.IGNORECASE)
"""Parts of a posture's name that do not distinguish it."""


@check("R036")
def unrelated_places(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report places without any relation that are no posture of the robot."""
    created = made(checked.ontology, checked.statements)
    for owner in checked.owners:
        for parameter in owner.parameters:
            if isinstance(parameter.filler, Place) and parameter.filler.iri not in created:
                yield from _unrelated(checked.actions, owner, parameter.filler, parameter.span)


def _unrelated(actions: Actions, owner: Step | Recipe, place: Place, span: Span | None) -> Iterator[Diagnostic]:
    """Yield an error for a place of the base without relation, a warning for the hand's unless it names a posture."""
    if not place.is_posture:
        return
    where = actions.ontology.span(place.iri) or span
    nothing = "anything" if not any(references(actions.ontology, place.iri)) else "anything that is somewhere"
    advice = f"add one of {', '.join(owl_properties())} to `{place.name}`"
    if isinstance(owner, Step) and actions.is_base_motion(owner):
        message = f"`{owner.name}` moves the base to `{place.name}`, which has no relation to {nothing}"
        yield error("R036", message, where, advice)
    elif _NO_NAME.sub("", place.name).lower() not in postures():
        message = (
            f"`{place.name}`, a place of `{owner.name}`, has no relation to {nothing}, and no bundled robot"
            f" has a posture of that name"
        )
        yield warning("R036", message, where, f"{advice}; known postures: {', '.join(sorted(postures()))}")


def statements_without_use(ontology: Ontology, place: Place) -> Iterator[Diagnostic]:
    """Report statements about a place that are no relations which locations have (R038)."""
    stated = [(triple.predicate, triple.span) for triple in ontology.triples(s=place.iri)]
    stated = [one for one in stated if one[0].partition("#")[0] not in _LANGUAGES]
    stated += [(one.property, one.span) for one in ontology.restrictions(place.iri)]
    for property_name, span in dict(reversed(stated)).items():
        if is_relation(property_name) or ANNOTATION_PROPERTY in ontology.values(property_name, RDF.type):
            continue
        short = local_name(property_name)
        meant = guess(property_name, map(expand, owl_properties()), least=0.75)
        advice = f"did you mean {meant}?" if meant else f"relations: {', '.join(owl_properties())}"
        message = f"{short} of the place `{place.name}` is ignored: it is not a relation"
        yield warning("R038", message, span, advice, meant)


_LANGUAGES = {iri.partition("#")[0] for iri in (RDF.type, RDFS.label, RDFS.comment, OWL)}


def places_of(place: Place) -> Iterator[Place]:
    """Yield a place and the places that it relates to."""
    yield place
    for _, reference in place.relations:
        if isinstance(reference, Place):
            yield from places_of(reference)


@cache
def postures() -> frozenset[str]:
    """Return the names of the postures that bundled robots have, without separators."""
    names: set[str] = set()
    for path in (bundled("ontologies") / "robots").glob("*.toml"):
        names |= set(tomllib.loads(path.read_text(encoding="utf-8")).get("postures", {}))
    return frozenset(_NO_NAME.sub("", name).lower() for name in names)


MOST_NAMES = 5
"""Names that one message lists."""


@check("R039")
def unused_names(checked: CheckedFile) -> Iterator[Diagnostic]:
    """Report location designators (a warning) and things (a note) of the main document that nothing refers to.

    A file in which things have places of their own is a map as well: there things need no use.
    """
    ontology = checked.ontology
    places, things = unused_designators(ontology)
    if places:
        yield _unused(ontology, Severity.WARNING, "location designator", places)
    if things:
        yield _unused(ontology, Severity.NOTE, "thing", things)


def unused_designators(ontology: Ontology) -> tuple[list[str], list[str]]:
    """Return the unused location designators, and the unused things, of the main document, in the order of the file.

    No things are returned if the file is a map as well. Supporting planes state what chunks act on.
    """
    planes = {triple.subject for triple in ontology.using("supportedObject")}
    places: list[str] = []
    things: list[str] = []
    is_map = any(True for _ in ontology.triples(p="eventOccursAt"))
    for name in ontology.unused():
        if ontology.is_class(name) or name in planes:
            continue
        if is_place(ontology, name):
            places.append(name)
        elif not is_map and read_thing(ontology, name) is not None:
            things.append(name)
    for names in (places, things):
        names.sort(key=lambda name: (ontology.span(name) or Span(""), name))
    return places, things


def _unused(ontology: Ontology, severity: Severity, what: str, names: list[str]) -> Diagnostic:
    listed = ", ".join(f"`{local_name(name)}`" for name in names[:MOST_NAMES])
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    message = f"unused {what}{'s' if len(names) > 1 else ''}: {listed}{more}"
    spans = [span for span in map(ontology.span, names) if span is not None]
    return Diagnostic(severity, "R039", message, min(spans, default=None), "remove it, or refer to it in a parameter")
