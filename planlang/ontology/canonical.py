"""One name for each term of the known vocabularies, whatever era a file is of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planlang.ontology.terms import Literal, Term, Triple

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


def canonical_triples(triples: Iterable[Triple]) -> Iterator[Triple]:
    """The same triples under canonical names; those that have them already are passed on as they are, not copied."""
    for triple in triples:
        subject, predicate, value = _term(triple.subject), canonical(triple.predicate), _term(triple.object)
        if subject is triple.subject and predicate is triple.predicate and value is triple.object:
            yield triple
        else:
            assert not isinstance(subject, Literal)
            yield Triple(subject, predicate, value, triple.span)


def _term(term: Term) -> Term:
    return canonical(term) if isinstance(term, str) else term
