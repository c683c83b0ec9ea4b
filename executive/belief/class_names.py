"""Classes by the names that other ontologies have for them: what a map's vocabulary lacks is known by its local name.

A plan of a recipe in one ontology runs in a map in another. A class that the map's vocabulary does not describe means
the one that is called so there, or of which it says so: ``Class: Egg-Chickens Annotations: alsoCalled "Egg"``.
"""

from __future__ import annotations

from planlang.designators import local_name
from planlang.ontology import Literal, Ontology, expand
from planlang.ontology.terms import RDF

_KEPT = "executive.belief.class_names"
_USED = f"{_KEPT} used"


def known(ontology: Ontology, cls: str) -> str:
    """Return the IRI of a class; of one that the vocabulary lacks, that of the first which it calls so."""
    return meanings(ontology, cls)[0]


def is_kind(ontology: Ontology, one: str, cls: str) -> bool:
    """Return whether a class is another, or below it, by either's name; by IRI where the map says that of a thing.

    Of two classes of one name in two namespaces, both unknown to the vocabulary, each means its own things.
    """
    iri = expand(cls)
    if not ontology.defined(iri) and iri in _used(ontology):
        return expand(one) == iri or ontology.is_a(one, iri)
    below = known(ontology, one)
    return any(ontology.is_a(below, meant) for meant in meanings(ontology, cls))


def meanings(ontology: Ontology, cls: str) -> tuple[str, ...]:
    """Return the IRI of a class; of one that the vocabulary lacks, of all that it calls so: by their own name first."""
    iri = expand(cls)
    if ontology.defined(iri):
        return (iri,)
    if _KEPT not in ontology.kept:
        names: dict[str, dict[str, None]] = {}
        for name in ontology.class_names():
            names.setdefault(local_name(name).lower(), {})[name] = None
        for triple in ontology.triples(p=expand("alsoCalled")):
            if isinstance(triple.object, Literal) and isinstance(triple.subject, str):
                names.setdefault(triple.object.value.lower(), {})[triple.subject] = None
        ontology.kept[_KEPT] = names
    return tuple(ontology.kept[_KEPT].get(local_name(iri).lower(), (iri,)))


def _used(ontology: Ontology) -> frozenset[object]:
    """Return the classes that individuals are said to be of."""
    if _USED not in ontology.kept:
        ontology.kept[_USED] = frozenset(triple.object for triple in ontology.triples(p=RDF.type))
    return frozenset(ontology.kept[_USED])
