"""Classes of other ontologies, matched by name with those of the map's vocabulary.

A plan compiled from a recipe in one ontology runs in a map in another. A class that the map's vocabulary does not
define is matched by local name, then by an annotation (``Class: Egg-Chickens Annotations: alsoCalled "Egg"``), and
finally by an unambiguous first part: ``Bed`` is Bed-PieceOfFurniture.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, note, warning
from planlang.ontology import Literal, Ontology, expand, once_per_ontology
from planlang.ontology.terms import RDF
from planlang.spelling import similar


def known(ontology: Ontology, cls: str) -> str:
    """Map a class to its IRI in the vocabulary: the best of its :func:`meanings`."""
    return meanings(ontology, cls)[0]


def is_kind(ontology: Ontology, one: str, cls: str) -> bool:
    """Check whether class ``one`` is ``cls`` or a subclass of it, matching unknown classes by name.

    By IRI only if the map has objects of ``cls`` itself: unknown classes of one name in two namespaces differ.
    """
    iri = expand(cls)
    if not ontology.defined(iri) and iri in _used(ontology):
        return expand(one) == iri or ontology.is_a(one, iri)
    known_one = known(ontology, one)
    return any(ontology.is_a(known_one, meaning) for meaning in meanings(ontology, cls))


def meanings(ontology: Ontology, cls: str) -> tuple[str, ...]:
    """List the classes that a class can mean: itself if defined or without match, else matches by name, best first."""
    iri = expand(cls)
    if ontology.defined(iri):
        return (iri,)
    return tuple(_classes_by_name(ontology).get(local_name(iri).lower(), (iri,)))


@once_per_ontology
def _classes_by_name(ontology: Ontology) -> dict[str, dict[str, None]]:
    """Lower-case name -> classes with it: local names, other names, and first parts that only one class has."""
    names: dict[str, dict[str, None]] = {}
    for name in ontology.class_names():
        names.setdefault(local_name(name).lower(), {})[name] = None
    for triple in ontology.triples(p=expand("alsoCalled")):
        if isinstance(triple.object, Literal) and isinstance(triple.subject, str):
            names.setdefault(triple.object.value.lower(), {})[triple.subject] = None
    short: dict[str, dict[str, None]] = {}
    for name in ontology.class_names():
        short.setdefault(local_name(name).lower().partition("-")[0], {})[name] = None
    return {key: classes for key, classes in short.items() if len(classes) == 1} | names


@once_per_ontology
def _used(ontology: Ontology) -> frozenset[object]:
    """Classes with individuals in the ontology."""
    return frozenset(triple.object for triple in ontology.triples(p=RDF.type))


def with_known_classes(ontology: Ontology, things: Iterable[str], notes: list[Diagnostic]) -> Ontology:
    """Replace undefined classes of objects (IRIs) by defined classes of the same name, with a note for each.

    A class without a match gets a warning, with similar names. Undefined classes of the same name in different
    namespaces are left alone: :func:`is_kind` distinguishes them.
    """
    unknown = {cls: iri for iri in things for cls in ontology.types(iri) if not ontology.defined(cls)}
    counts = Counter(map(local_name, unknown))
    names: dict[str, str] = {}
    for cls, iri in unknown.items():
        if counts[local_name(cls)] > 1:
            continue
        subject, span = f"{local_name(cls)}, the class of {local_name(iri)}", ontology.span(iri)
        if (match := known(ontology, cls)) != expand(cls):
            names[cls] = match
            notes.append(note("M031", f"{subject}, is read as {local_name(match)}", span))
            continue
        defined_names = {local_name(name) for name in ontology.class_names()}
        close = similar(local_name(cls), sorted(defined_names), least=0.8)
        advice = f"did you mean {close[0]}?" if close else f"define it: Class: {local_name(cls)} SubClassOf: ..."
        notes.append(warning("M031", f"{subject}, is not defined: such objects have no known properties", span, advice))
    return ontology.renamed(names) if names else ontology
