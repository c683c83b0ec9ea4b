"""One name for each term of the known vocabularies, whatever era a file is of."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.diagnostics import Diagnostic, note
from planlang.ontology.triples import Triples

OLD_HOST = "http://ias.cs.tum.edu/kb/"
HOST = "http://knowrob.org/kb/"

MOVED = (
    "knowrob",
    "srdl2",
    "srdl2-cap",
    "srdl2-comp",
    "srdl2-action",
    "srdl2-dl",
    "computable",
    "comp_temporal",
    "comp_spatial",
    "comp_cop",
    "comp_semantic_map",
    "knowrob_objects",
    "knowrob_units",
)
"""Vocabularies that moved from the old host to the new one. Recipes, maps and robots are never renamed."""

_RENAMED: dict[str, str] = {f"{OLD_HOST}{name}.owl": f"{HOST}{name}.owl" for name in MOVED}
"""Address of a document -> its address here."""


def canonical(iri: str) -> str:
    """The name of a term or document as it is used here."""
    if not iri.startswith(OLD_HOST):
        return iri
    document, hash_sign, name = iri.partition("#")
    return f"{_RENAMED.get(document, document)}{hash_sign}{name}"


def use_canonical_names(triples: Triples) -> Iterator[Diagnostic]:
    """Give the terms their canonical names; a note for each vocabulary that is renamed, where it is used first."""
    old = {number: term for term, number in triples.numbers.items() if isinstance(term, str) and _is_old(term)}
    if not old:
        return
    notes = list(_notes(triples, old))
    triples.rename({term: canonical(term) for term in old.values()})
    yield from notes


def _is_old(term: str) -> bool:
    return term.startswith(OLD_HOST) and canonical(term) != term


def _notes(triples: Triples, old: dict[int, str]) -> Iterator[Diagnostic]:
    documents = {number: term.partition("#")[0] for number, term in old.items()}
    left = {document for document in documents.values() if canonical(document) != document}
    for row, terms in enumerate(zip(triples.subjects, triples.predicates, triples.objects, strict=True)):
        for number in terms:
            if number in documents and (document := documents[number]) in left:
                left.remove(document)
                message = f"names of {document} are read as those of {canonical(document)}"
                yield note("O015", message, triples.span(row))
        if not left:
            return
