"""Individuals of several names (``owl:sameAs``): which name stands for all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from planlang.ontology.terms import OWL, RDF, RDFS
from planlang.ontology.triples import Triples


def same_names(triples: Triples, own: str | None) -> Mapping[str, str]:
    """Map the other names of each individual to the one that stands for it.

    That is the first of its names in the namespace of the ontology ``own``, else the first one in document order. Names
    that nothing else mentions are left alone, and so are classes and properties: OWL has other words for these.
    """
    rows = triples.by(OWL.sameAs)
    standing: dict[str, str] = {}
    for one, other in _pairs(triples, rows) if rows else ():
        roots = {_standing(standing, one), _standing(standing, other)}
        first, *rest = sorted(roots, key=lambda iri: (not _is_in(iri, own), triples.numbers[iri]))
        standing.update(dict.fromkeys(rest, first))
    return {name: _standing(standing, name) for name in standing}


def _pairs(triples: Triples, rows: Sequence[int]) -> Iterator[tuple[str, str]]:
    """Yield the pairs of IRIs that are stated to be the same individual, if something else mentions both."""
    told = _told(triples, {column[row] for row in rows for column in (triples.subjects, triples.objects)})
    for row in rows:
        numbers = triples.subjects[row], triples.objects[row]
        one, other = map(triples.name, numbers)
        if one is not None and other is not None and one != other and told.issuperset(numbers):
            yield one, other


def _told(triples: Triples, wanted: set[int]) -> set[int]:
    """Find which of some terms are those of individuals of which more is said than what they are the same as."""
    same, kind, above = map(triples.numbers.get, (OWL.sameAs, RDF.type, RDFS.subClassOf))
    told: set[int] = set()
    others = set(triples.used)
    for subject, predicate, value in zip(triples.subjects, triples.predicates, triples.objects, strict=True):
        if predicate == same:
            continue
        if value in wanted:
            (others if predicate == kind else told).add(value)
        if subject in wanted:
            cls = triples.name(value) or ""
            is_kind = cls.startswith((OWL, RDF, RDFS)) and cls.endswith(("Class", "Property"))
            is_individual = predicate != above and (predicate != kind or not is_kind)
            (told if is_individual else others).add(subject)
    return told - others


def _standing(standing: Mapping[str, str], name: str) -> str:
    while name in standing:
        name = standing[name]
    return name


def _is_in(iri: str, own: str | None) -> bool:
    return own is not None and iri.startswith(own) and iri[len(own.rstrip("#/")) :].startswith(("#", "/"))
