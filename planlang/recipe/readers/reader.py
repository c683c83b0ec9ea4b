"""What a reader of a dialect does, and all readers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from planlang.ontology import Ontology
from planlang.recipe.readers import action_table, finite_state, partial_order, workflow
from planlang.recipe.readers.data_flow import read_data_flow
from planlang.recipe.statements import Statements


class Reader(Protocol):
    """A module that reads one dialect."""

    def tasks(self, ontology: Ontology) -> Iterator[str]:
        """The classes or individuals (IRIs) of the main document that may state a recipe in this dialect."""

    def read(self, ontology: Ontology, iri: str) -> Statements | None:
        """What a class or an individual states; None if that is no recipe in this dialect."""


READERS: tuple[Reader, ...] = (finite_state, partial_order, workflow, action_table)
"""In the order in which they are asked: the first that finds a recipe reads it."""


def statements_of(ontology: Ontology, iri: str) -> Statements | None:
    """What a class or an individual states, with its data flow; None if it states no recipe."""
    for reader in READERS:
        found = reader.read(ontology, iri)
        if found is not None:
            return read_data_flow(ontology, found)
    return None


def tasks_of(ontology: Ontology) -> tuple[str, ...]:
    """The classes and individuals of the main document that may state a recipe, each once."""
    return tuple(dict.fromkeys(iri for reader in READERS for iri in reader.tasks(ontology)))
