"""Checks of designators: places and things of a file that nothing uses."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Severity, Span
from planlang.ontology import Ontology
from planlang.recipe.terms import is_place, read_thing

MOST_NAMES = 5
"""Names that one message lists."""


def check_designators(ontology: Ontology) -> Iterator[Diagnostic]:
    """A warning for the location designators of the main document that nothing refers to, a note for its things.

    A file in which things have places of their own is a map as well: there things need no use.
    """
    places, things = unused_designators(ontology)
    if places:
        yield _unused(ontology, Severity.WARNING, "location designator", places)
    if things:
        yield _unused(ontology, Severity.NOTE, "thing", things)


def unused_designators(ontology: Ontology) -> tuple[list[str], list[str]]:
    """The location designators, and the things, of the main document that nothing refers to, in the order of the file.

    No things if the file is a map as well. Supporting planes of an action data table say what chunks act on.
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
    message = f"nothing uses the {what}{'s' if len(names) > 1 else ''} {listed}{more}"
    spans = [span for span in map(ontology.span, names) if span is not None]
    return Diagnostic(severity, "R039", message, min(spans, default=None), "remove it, or refer to it in a parameter")
