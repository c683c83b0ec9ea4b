"""Repair on reading: names of old namespaces, terms in the wrong namespace, restrictions without their type."""

from __future__ import annotations

from collections.abc import Iterator
from difflib import get_close_matches
from functools import cache

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, error, note, warning
from planlang.ontology.terms import OWL, RDF, RDFS
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
    """Return the current name of a term or document."""
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


TERMS: dict[str, frozenset[str]] = {space: space.terms for space in (RDFS, OWL, RDF)}
"""Namespace -> local names of its terms; a term is looked for in this order."""

_W3C = tuple(TERMS)

MISSPELT = 0.8
"""The similarity (of difflib) at which something is read as a term: ``abuot`` is similar enough to ``about``."""

_ATTRIBUTES = frozenset(("about", "resource", "ID", "nodeID", "datatype", "parseType"))
"""Names of RDF that RDF/XML has as attributes only."""

MOST_WARNINGS = 100
"""Warnings about one file; further terms are repaired silently."""

_SPELT = {OWL + "DataProperty": OWL.DatatypeProperty, OWL + "Individual": OWL.NamedIndividual}
_PREFIX: dict[str, str] = {RDFS: "rdfs", OWL: "owl", RDF: "rdf"}


def repair(triples: Triples) -> list[Diagnostic]:
    """Put the terms that were meant in the place of those that are written. Returns what was changed.

    ``owl:subClassOf`` becomes ``rdfs:subClassOf`` and the like; a nameless node with owl:onProperty becomes a
    restriction.
    """
    meant = _Meanings()
    wrong = {
        number
        for term, number in triples.numbers.items()
        if isinstance(term, str) and term.startswith(_W3C) and _correction(term)
    }
    if wrong:
        _correct(triples, wrong, meant)
    return [*meant.diagnostics, *_add_restrictions(triples)]


def _correct(triples: Triples, wrong: set[int], meant: _Meanings) -> None:
    """Correct predicates, and what things are said to be."""
    types = {
        number for number in dict.fromkeys(triples.predicates) if meant_term(triples.name(number) or "") == RDF.type
    }
    for row, (predicate, value) in enumerate(zip(triples.predicates, triples.objects, strict=True)):
        if predicate in wrong:
            triples.predicates[row] = meant.number(triples, predicate, row)
        if predicate in types and value in wrong:
            triples.objects[row] = meant.number(triples, value, row)


class _Meanings:
    """Looks up what terms mean, and reports those that are not what they say."""

    def __init__(self) -> None:
        self.diagnostics: list[Diagnostic] = []
        self._known: dict[int, tuple[str, str, str | None]] = {}

    def number(self, triples: Triples, wrong: int, row: int) -> int:
        """Return the number of the term that an undefined one stands for; of the term itself if unknown."""
        iri = triples.name(wrong) or ""
        known = self._known.get(wrong)
        if known is None:
            known = self._known[wrong] = _correction(iri) or (iri, "", None)
            if _is_misspelt(iri):
                self.diagnostics.append(error("O013", known[1], triples.span(row), known[2]))
        read, message, advice = known
        if len(self.diagnostics) < MOST_WARNINGS and not _is_misspelt(iri):
            found = warning("O013" if read == iri else "O012", message, triples.span(row), advice)
            self.diagnostics.append(found)
        return triples.number(read)


def meant_term(iri: str) -> str:
    """Return the term of RDF, RDFS or OWL that an IRI means: itself, or the same name in the namespace that has it."""
    correction = _correction(iri)
    return iri if correction is None else correction[0]


def _correction(iri: str) -> tuple[str, str, str | None] | None:
    """Return what a term is read as, why, and what to write; None if there is nothing to correct."""
    local = local_name(iri)
    namespace = iri.removesuffix(local)
    if namespace not in TERMS or not local or local in TERMS[namespace] or (namespace == RDF and local[0] == "_"):
        return None
    written = f"{_PREFIX[namespace]}:{local}"
    read = next((home + local for home, terms in TERMS.items() if local in terms), _SPELT.get(iri))
    if read is not None:
        name = local_name(read)
        right = f"{_PREFIX[read.removesuffix(name)]}:{name}"
        return read, f"{written} is read as {right}", f"write {right}"
    near = _near(namespace, local, MISSPELT) or _near(namespace, local, 0.6)
    advice = f"did you mean {_PREFIX[namespace]}:{near[0]}?" if near else None
    is_term = bool(near) and near[0] in TERMS[namespace] and _is_misspelt(iri)
    return namespace + near[0] if is_term else iri, f"there is no {written}", advice


def _near(namespace: str, local: str, least: float) -> list[str]:
    terms = TERMS[namespace] | (_ATTRIBUTES if namespace == RDF else frozenset())
    return get_close_matches(local, sorted(terms), n=1, cutoff=least)


@cache
def _is_misspelt(iri: str) -> bool:
    """Return True for a name that is nearly a term of RDF, RDFS or OWL, or an attribute of RDF/XML, but is none."""
    local = local_name(iri)
    namespace = iri.removesuffix(local)
    if namespace not in TERMS or iri in _SPELT or any(local in terms for terms in TERMS.values()):
        return False
    return bool(_near(namespace, local, MISSPELT))


def _add_restrictions(triples: Triples) -> list[Diagnostic]:
    """Say owl:Restriction of the nameless nodes that have owl:onProperty."""
    kind, restriction, on_property = map(triples.numbers.get, (RDF.type, OWL.Restriction, OWL.onProperty))
    if on_property is None:
        return []
    rows = [row for row, number in enumerate(triples.predicates) if number == on_property]
    subjects = set(map(triples.subjects.__getitem__, rows))
    if kind is not None and restriction is not None:
        subjects.difference_update(
            subject
            for subject, predicate, value in zip(triples.subjects, triples.predicates, triples.objects, strict=True)
            if value == restriction and predicate == kind
        )
    bare = {triples.subjects[row]: row for row in reversed(rows) if triples.subjects[row] in subjects}
    bare = {subject: row for subject, row in bare.items() if triples.is_node(subject)}
    if not bare:
        return []
    first = min(map(triples.span, bare.values()))
    what = "a restriction does not say owl:Restriction"
    if len(bare) > 1:
        what = f"{len(bare)} restrictions do not say owl:Restriction"
    triples.repeat(bare.values(), triples.number(RDF.type), triples.number(OWL.Restriction))
    return [note("O014", f"{what}; owl:onProperty is taken for it", first)]
