"""Classes by the names that other ontologies have for them: what a map's vocabulary lacks is known by its local name.

A plan of a recipe in one ontology runs in a map in another. A class that the map's vocabulary does not describe means
the one that is called so there, or of which it says so: ``Class: Egg-Chickens Annotations: alsoCalled "Egg"``; at last
the only one that begins so: ``Bed`` is Bed-PieceOfFurniture.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, note, warning
from planlang.ontology import Literal, Ontology, expand
from planlang.ontology.terms import RDF
from planlang.spelling import similar

_KEPT = "executive.maps.class_names"
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
        short: dict[str, dict[str, None]] = {}
        for name in ontology.class_names():
            short.setdefault(local_name(name).lower().partition("-")[0], {})[name] = None
        ontology.kept[_KEPT] = {key: some for key, some in short.items() if len(some) == 1} | names
    return tuple(ontology.kept[_KEPT].get(local_name(iri).lower(), (iri,)))


def _used(ontology: Ontology) -> frozenset[object]:
    """Return the classes that individuals are said to be of."""
    if _USED not in ontology.kept:
        ontology.kept[_USED] = frozenset(triple.object for triple in ontology.triples(p=RDF.type))
    return frozenset(ontology.kept[_USED])


def with_known_classes(ontology: Ontology, things: Iterable[str], found: list[Diagnostic]) -> Ontology:
    """Return the ontology with classes of things (IRIs) that nothing defines replaced by those that are called so.

    Says so, and for those that nothing is called what they may mean. Of two classes of one name in two namespaces each
    keeps its own things: :func:`is_kind` tells them apart.
    """
    unknown = {cls: iri for iri in things for cls in ontology.types(iri) if not ontology.defined(cls)}
    called = Counter(map(local_name, unknown))
    names: dict[str, str] = {}
    for cls, iri in unknown.items():
        if called[local_name(cls)] > 1:
            continue
        said, span = f"{local_name(cls)}, the class of {local_name(iri)}", ontology.span(iri)
        if (meant := known(ontology, cls)) != expand(cls):
            names[cls] = meant
            found.append(note("M031", f"{said}, is read as {local_name(meant)}", span))
            continue
        every = {local_name(name) for name in ontology.class_names()}
        close = similar(local_name(cls), sorted(every), least=0.8)
        advice = f"did you mean {close[0]}?" if close else f"say what it is: Class: {local_name(cls)} SubClassOf: ..."
        found.append(warning("M031", f"{said}, is unknown: nothing is known of such things", span, advice))
    return ontology.renamed(names) if names else ontology
