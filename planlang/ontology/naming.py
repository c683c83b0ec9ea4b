"""Names of terms: readable ones for IRIs that end in a number or random letters, and one of several for an individual.

WebProtege, OBO ontologies and Wikidata name terms by numbers or random letters. The IRI still identifies a term;
messages, plans and traces show its label instead. Of the names of an individual (``owl:sameAs``) one stands for all.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from planlang.designators import local_part
from planlang.ontology.terms import OWL, RDF, RDFS, Literal
from planlang.ontology.triples import Triples

PREF_LABEL = "http://www.w3.org/2004/02/skos/core#prefLabel"
LABELS = (RDFS.label, PREF_LABEL)
"""Properties whose values are labels, the preferred one first."""
LONGEST = 60
"""Characters of a readable name."""

_HEX = "[0-9A-Fa-f]"
_NUMBERED = re.compile(
    rf"""[A-Za-z]{{1,12}}[_:-]\d{{5,9}}                        # OBI_0000070
    | [QPL]\d+                                                 # Q42 of Wikidata
    | \d{{3,}}                                                 # 71388002 of SNOMED CT
    | (?:[A-Za-z]+[_-])?{_HEX}{{8}}(?:[-_]?{_HEX}{{4}}){{3}}[-_]?{_HEX}{{12}}  # a UUID
    | (?:OWL|Owl)?(?:Class|NamedIndividual|Individual|ObjectProperty|DataProperty|AnnotationProperty)_(?=[\w-]*\d)[\w-]+
    | genid[\w-]*""",
    re.VERBOSE,
)
_PIECE = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+")
_RANDOM_LENGTH, _RANDOM_PIECES = 16, 2.6
"""Least length of random letters, and greatest average length of the words and numbers that they seem to consist of."""
_WORDS = re.compile(r"[^\W_]+")


def is_opaque(name: str) -> bool:
    """Check whether a local name tells people nothing: a numbered term, a UUID, or random letters and digits."""
    if _NUMBERED.fullmatch(name):
        return True
    if len(name) < _RANDOM_LENGTH or not name.isascii() or not name.isalnum():
        return False
    return len(name) / len(_PIECE.findall(name)) < _RANDOM_PIECES


def best_label(labels: Iterable[Literal]) -> str | None:
    """Label in English or without language tag, else the first one; None if all are blank."""
    stated = [label for label in labels if label.value.strip()]
    stated.sort(key=lambda label: not (label.language or "en").startswith("en"))
    return stated[0].value.strip() if stated else None


def readable_names(documents: Iterable[Triples]) -> Mapping[str, str]:
    """Readable names of the opaque terms that these documents label.

    Terms with equal labels, and those labelled as another term is named, get the end of their own local name as well.
    """
    wanted: dict[str, str] = {}
    others: set[str] = set()
    for triples in documents:
        labels: dict[str, list[Literal]] = {}
        for prop in LABELS:
            for row in triples.by(prop):
                iri, label = triples.name(triples.subjects[row]), triples.terms[triples.objects[row]]
                if iri is not None and isinstance(label, Literal) and is_opaque(local_part(iri)):
                    labels.setdefault(iri, []).append(label)
        for iri, stated in labels.items():
            name = "_".join(_WORDS.findall(best_label(stated) or ""))[:LONGEST].strip("_")
            if name:
                wanted.setdefault(iri, name)
        if labels:
            ontology = triples.find(OWL.Ontology)
            rows = triples.with_object(ontology) if ontology is not None else ()
            own = {triples.subjects[row] for row in rows}
            terms = (term for number, term in enumerate(triples.terms) if number not in own)
            others.update(local_part(term) for term in terms if isinstance(term, str))
    counts = Counter(wanted.values())
    return {iri: distinct(name, iri) if counts[name] > 1 or name in others else name for iri, name in wanted.items()}


def distinct(name: str, iri: str) -> str:
    """Readable name with the end of the local name."""
    return f"{name}_{local_part(iri)[-4:]}"


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
