"""Readable names for IRIs whose local name is a number or random letters, from their labels.

WebProtege, OBO ontologies and Wikidata name terms so. The IRI still identifies a term; messages, plans and traces show
its label instead.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping

from planlang.designators import local_part
from planlang.ontology.terms import OWL, RDFS, Literal
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
