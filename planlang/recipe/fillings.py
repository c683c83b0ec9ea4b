"""What fills the properties of actions: as it is stated, and as parameters of the model."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.ontology import BNode, Ontology, Term, expand, shorten
from planlang.ontology.terms import OWL, RDF, RDFS, TYPE
from planlang.recipe.model import Name, Parameter
from planlang.recipe.statements import Filling, filled, is_word
from planlang.recipe.terms import is_device, read_filler
from planlang.recipe.words import ON_ACTIONS, ON_INDIVIDUALS

NO_PARAMETERS = (
    *ON_ACTIONS,
    "dependsOnCapability",
    "dependsOnComponent",
    "hasCapability",
    "hasCapabilityDependency",
    "providedByMotionPrimitive",
    "lispClass",
    "startTime",
    "endTime",
)
"""Properties of actions (local names) that say how, when or with what right, not on what."""

READ_BY_DIALECTS = (*ON_INDIVIDUALS, "adtChunkSupport")
"""Properties of individuals (local names) that readers of dialects take up."""


def fillings(ontology: Ontology, iri: str, more: tuple[Filling, ...] = ()) -> Iterator[list[Filling]]:
    """What is stated to fill the properties of an action, nearest first: ``more``, its facts, its class, ancestors.

    Superclasses and equivalent classes count alike. What the bundled vocabulary says about its own classes does not.
    """
    yield [filling for filling in more if not is_word(filling.property, *NO_PARAMETERS)]
    cls = iri
    if not ontology.is_class(iri):
        cls = action_class(ontology, iri) or iri
        yield [filling for filling in _facts(ontology, iri) if not is_word(filling.property, *NO_PARAMETERS)]
    key = ("fillings", cls)
    if key not in ontology.kept:
        ancestors = ontology.ancestors(cls)
        ontology.kept[key] = [level for ancestor in ancestors if (level := _restricted(ontology, ancestor))]
    yield from ontology.kept[key]


def _restricted(ontology: Ontology, cls: str) -> list[Filling]:
    """What the restrictions of a class fill in; nothing for classes of the bundled vocabulary."""
    known: dict[str, list[Filling]] = ontology.kept.setdefault("restricted", {})
    found = known.get(cls)
    if found is None:
        is_said = shorten(cls) == cls or ontology.main(cls)
        every = filled(ontology.restrictions(cls)) if is_said else ()
        found = known[cls] = [filling for filling in every if not is_word(filling.property, *NO_PARAMETERS)]
    return found


def read_parameters(
    ontology: Ontology, iri: str, more: tuple[Filling, ...] = (), made: frozenset[str] = frozenset()
) -> tuple[Parameter, ...]:
    """What fills the properties of an action: ``more``, what it states itself, and what its ancestors state.

    A nearer filler replaces a farther one of the same property. A robot part given as a body part is the device used.
    ``made`` are individuals that need not be defined, as another step creates them.
    """
    found: dict[str, list[Parameter]] = {}
    for level in fillings(ontology, iri, more):
        nearer = set(found)
        for filling in level:
            parameter = _parameter(ontology, filling, made)
            if parameter is not None and parameter.property not in nearer:
                found.setdefault(parameter.property, []).append(parameter)
    return tuple(dict.fromkeys(parameter for parameters in found.values() for parameter in parameters))


def action_class(ontology: Ontology, individual: str) -> str | None:
    """The class of actions of an individual: of its types the first that is one, else the first that is known."""
    types = ontology.types(individual)
    for wanted in ("Action", "Event"):
        for cls in types:
            if ontology.is_a(cls, expand(wanted)):
                return cls
    return next((cls for cls in types if len(ontology.ancestors(cls)) > 1), next(iter(types), None))


def unread_facts(ontology: Ontology, individual: str) -> Iterator[Filling]:
    """The facts of an individual that neither fill a property of actions nor say how it is performed."""
    for triple in ontology.triples(s=individual):
        name = triple.predicate
        is_bookkeeping = is_word(name, *NO_PARAMETERS, *READ_BY_DIALECTS) or _is_annotation(ontology, name)
        if not is_bookkeeping and not _is_of_actions(ontology, name):
            yield Filling(name, triple.object, triple.span)


def _facts(ontology: Ontology, individual: str) -> Iterator[Filling]:
    """The facts of an individual in properties that the vocabulary lists for actions."""
    for triple in ontology.triples(s=individual):
        if _is_of_actions(ontology, triple.predicate):
            yield Filling(triple.predicate, triple.object, triple.span)


def action_properties(ontology: Ontology) -> tuple[str, ...]:
    """The properties (IRIs) that the vocabulary lists for any class of actions."""
    found = {triple.object: None for triple in ontology.triples(p=expand("hasParameter"))}
    return tuple(name for name in found if isinstance(name, str))


def _is_of_actions(ontology: Ontology, property_name: str) -> bool:
    """True for a property that the vocabulary lists for a class of actions, or one below it."""
    return any(
        True
        for above in ontology.superproperties(property_name)
        for _ in ontology.triples(p=expand("hasParameter"), o=above)
    )


def _is_annotation(ontology: Ontology, name: str) -> bool:
    return name.startswith((OWL, RDF, RDFS)) or OWL + "AnnotationProperty" in ontology.values(name, TYPE)


def _parameter(ontology: Ontology, filling: Filling, made: frozenset[str]) -> Parameter | None:
    filler = read_filler(ontology, filling.term, filling.property)
    if filler is None and filling.term in made:
        filler = Name(str(filling.term))
    if filler is None:
        return None
    property_name = shorten(filling.property)
    if property_name == "bodyPartsUsed" and _is_device_term(ontology, filling.term):
        property_name = "deviceUsed"
    return Parameter(property_name, filler, filling.span)


def _is_device_term(ontology: Ontology, term: Term) -> bool:
    return (
        isinstance(term, str)
        and not isinstance(term, BNode)
        and any(is_device(ontology, cls) for cls in (ontology.types(term) or (term,)))
    )
