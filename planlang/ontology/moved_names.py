"""Names of vocabularies at another address, read as those of today: KnowRob's, SOMA's modules, https for http."""

from __future__ import annotations

import re
from collections.abc import Iterator

from planlang.diagnostics import Diagnostic, note
from planlang.ontology.terms import SOMA
from planlang.ontology.triples import Triples

OLD_HOST = "http://ias.cs.tum.edu/kb/"
HOST = "http://knowrob.org/kb/"
_SECURE = re.compile(r"https(?=://(?:(?:www\.)?knowrob\.org/kb/|ias\.cs\.tum\.edu/kb/|www\.ease-crc\.org/ont/"
                     r"|www\.ontologydesignpatterns\.org/ont/|www\.roboearth\.org/kb/))")  # fmt: skip
"""Scheme of a vocabulary whose names begin with http."""
_MOVED_FROM = (OLD_HOST, "http://www.ease-crc.org/ont/", "https://")

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
"""Vocabularies that moved from the old host to the new one. Recipes, maps and robots keep their old names."""

_RENAMED: dict[str, str] = {f"{OLD_HOST}{name}.owl": f"{HOST}{name}.owl" for name in MOVED}
"""Old address of a document -> its current address."""
_EASE = re.compile(r"http://www\.ease-crc\.org/ont/(?:EASE|SOMA)(?:[-_]\w+)?\.owl#(?=.)")
"""Namespaces that SOMA's names had in its modules, and before it was called so; its documents keep their addresses."""


def canonical(iri: str) -> str:
    """Map a term or document of the old host, or a term of SOMA, to its current IRI; other IRIs are unchanged.

    Vocabularies are served under https too, but their names begin with http.
    """
    if not iri.startswith(_MOVED_FROM):
        return iri
    iri = _SECURE.sub("http", iri, count=1)
    document, hash_sign, name = iri.partition("#")
    return f"{_RENAMED.get(document, document)}{hash_sign}{name}" if not _EASE.match(iri) else SOMA + name


def use_canonical_names(triples: Triples) -> Iterator[Diagnostic]:
    """Rename terms of old vocabularies, with a note for each vocabulary at its first use."""
    names = ((term, number) for term, number in triples.numbers.items() if isinstance(term, str))
    old = {number: term for term, number in names if term.startswith(_MOVED_FROM) and canonical(term) != term}
    if not old:
        return
    notes = list(_notes(triples, old))
    triples.rename({term: canonical(term) for term in old.values()})
    yield from notes


def _notes(triples: Triples, old: dict[int, str]) -> Iterator[Diagnostic]:
    documents = {number: term.partition("#")[0] for number, term in old.items()}
    renamed = {document: canonical(f"{document}#name").partition("#")[0] for document in documents.values()}
    unreported = {document for document, name in renamed.items() if name != document}
    for row, terms in enumerate(zip(triples.subjects, triples.predicates, triples.objects, strict=True)):
        for number in terms:
            if number in documents and (document := documents[number]) in unreported:
                unreported.remove(document)
                message = f"names of {document} are read as those of {renamed[document]}"
                yield note("O015", message, triples.span(row))
        if not unreported:
            return
