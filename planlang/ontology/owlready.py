"""Worlds of owlready2 of an ontology's triples. Importing it needs the package owlready2."""

from __future__ import annotations

from collections.abc import Iterable
from io import BytesIO
from typing import Any

from owlready2 import World

from planlang.ontology.nested_writers import ntriples
from planlang.ontology.terms import Triple


def world_of(triples: Iterable[Triple], iri: str | None) -> Any:
    """Make a ``World`` with one ontology of these triples."""
    world = World()
    world.get_ontology(iri or "http://planlang/").load(fileobj=BytesIO(ntriples(triples).encode()))
    return world
