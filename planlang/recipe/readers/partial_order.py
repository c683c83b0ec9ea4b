"""Dialects D1, D1f, D1e and D2: a class whose restrictions list sub-actions and the constraints that order them.

The restrictions stand in one ``owl:intersectionOf`` above the class (D1), separately (D1f), or in an equivalent
class (D1e); the sub-actions are named by ``subAction``, or by its super-property ``subEvents`` (D2). A constraint is an
individual with ``occursBeforeInOrdering A`` and ``occursAfterInOrdering B``: A before B. A class may mix these forms.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planlang.kept import kept
from planlang.ontology import BNode, Ontology, Restriction
from planlang.ontology.terms import OWL, RDF, RDFS
from planlang.recipe.model import EQUIVALENT, FLAT, INTERSECTION, SUB_EVENTS, Dialect, Ordering
from planlang.recipe.readers.alternatives import mention, read_union
from planlang.recipe.statements import (
    CONSTRAINT_CLASSES,
    KINDS,
    Filling,
    LooseEnd,
    Statements,
    SubAction,
    facts,
    fillings_of,
    is_foreign,
    is_word,
    named_iris,
)

_DIALECTS = {"intersection": INTERSECTION, "flat": FLAT, "equivalent": EQUIVALENT}


def tasks(ontology: Ontology) -> Iterator[str]:
    """Yield the named classes of the main document that state restrictions, each once."""
    store = ontology.store
    rows = store.by(RDFS.subClassOf, OWL.equivalentClass, OWL.intersectionOf)
    restricted = dict.fromkeys(store.subjects[row] for row in rows if store.is_node(store.objects[row]))
    for name in map(store.name, restricted):
        if name is not None and ontology.main(name):
            yield name


def read(ontology: Ontology, iri: str) -> Statements | None:
    """Read the sub-actions and orders of a class; None if it names no sub-action."""
    restrictions = ontology.restrictions(iri)
    subs = [restriction for restriction in restrictions if is_sub_action(restriction)]
    if not subs:
        return None
    orderings, loose = read_constraints(ontology, restrictions)
    subs = in_stated_order(subs)
    return Statements(
        iri,
        _dialect(subs),
        tuple(read_sub_action(ontology, restriction, iri) for restriction in subs),
        orderings,
        loose=loose,
        foreign=foreign_words(ontology, restrictions),
    )


def is_sub_action(restriction: Restriction) -> bool:
    """True if a restriction names a sub-action."""
    return (
        is_word(restriction.property, "subAction", "subEvents")
        and restriction.kind in KINDS
        and restriction.cardinality != 0
        and isinstance(restriction.filler, (str, BNode))
    )


def in_stated_order(restrictions: Iterable[Restriction]) -> list[Restriction]:
    """Sort restrictions: in the order of their list, then separate ones by name, because RDF does not order them."""
    every = list(restrictions)
    flat = sorted((one for one in every if one.form == "flat"), key=lambda one: str(one.filler))
    return [one for one in every if one.form != "flat"] + flat


def read_sub_action(ontology: Ontology, restriction: Restriction, task: str) -> SubAction:
    """Read a restriction of a task as a sub-action.

    For an intersection it is its named member, with its restrictions; a union states alternatives.
    """
    filler, times = restriction.filler, restriction.cardinality or 1
    if isinstance(filler, str):
        return SubAction(filler, (), restriction.span, times)
    assert isinstance(filler, BNode)
    union = read_union(ontology, filler, task, restriction.span, times)
    if union is not None:
        return union
    name = named_class(ontology, filler)
    span = mention(ontology, name, restriction.span)
    return SubAction(name, fillings_of(ontology.restrictions(filler)), span, times)


def named_class(ontology: Ontology, expression: BNode) -> str | None:
    """The first named member of an intersection, or the first one below it, which says more; None if there is none."""
    named = [member for member in ontology.members(expression) if isinstance(member, str)]
    return next((one for one in named if one != named[0] and ontology.is_a(one, named[0])), named[0] if named else None)


def read_constraints(
    ontology: Ontology, restrictions: tuple[Restriction, ...]
) -> tuple[tuple[Ordering, ...], tuple[LooseEnd, ...]]:
    """Read the orderings that constraints state, and list constraints that lack an end."""
    orderings: list[Ordering] = []
    loose: list[LooseEnd] = []
    properties = {restriction.property for restriction in restrictions}
    order_words = {name for name in properties if is_word(name, "orderingConstraints")}
    for restriction in restrictions:
        constraint = restriction.filler
        if restriction.property not in order_words or not isinstance(constraint, (str, BNode)):
            continue
        (befores, afters), span = ontology.linked_from(constraint, "occursBeforeInOrdering", "occursAfterInOrdering")
        name = str(constraint)
        if isinstance(constraint, BNode):
            span = None
        if not befores or not afters:
            missing = [("occursBeforeInOrdering", befores), ("occursAfterInOrdering", afters)]
            absent = tuple(word for word, ends in missing if not ends)
            loose.append(LooseEnd(name, absent, restriction.span if len(absent) == 2 else span or restriction.span))
        orderings += [
            Ordering(before, after, name, span=span or restriction.span) for before in befores for after in afters
        ]
    return tuple(orderings), tuple(loose)


def foreign_words(ontology: Ontology, restrictions: tuple[Restriction, ...]) -> tuple[Filling, ...]:
    """List recipe words of other namespaces among the properties and types of a class and its constraints."""
    words = ("subAction", "subEvents", "orderingConstraints", "stateTransition", "taskStartState", "taskEndState",
             "inputOutputConstraints")  # fmt: skip
    ends = ("occursBeforeInOrdering", "occursAfterInOrdering", "fromState", "toState", "causedBy", "createsOutput",
            "requiresInput", "resourceType")  # fmt: skip
    properties = dict.fromkeys(restriction.property for restriction in restrictions)
    classes = _undefined_classes(ontology)
    if not classes and not any(
        is_word(iri, *words, *ends) and is_foreign(iri) for iri in (*properties, *ontology.properties_named(*ends))
    ):
        return ()
    foreign: dict[str, Filling] = {}
    for restriction in restrictions:
        if not is_word(restriction.property, *words):
            continue
        used = [Filling(restriction.property, restriction.filler, restriction.span)]
        if isinstance(restriction.filler, (str, BNode)) and not is_sub_action(restriction):
            used += facts(ontology, restriction.filler, *ends)
            kinds = named_iris(facts(ontology, restriction.filler, "type"))
            used += (Filling(name, name, span) for name, span in kinds if name in classes)
        for filling in used:
            if is_foreign(filling.property):
                foreign.setdefault(filling.property, filling)
    return tuple(foreign.values())


@kept
def _undefined_classes(ontology: Ontology) -> frozenset[str]:
    """Undefined classes (IRIs) whose local name is that of a constraint class of the vocabulary."""
    store = ontology.store
    kinds = map(store.name, set(map(store.objects.__getitem__, store.by(RDF.type))))
    words = (name for name in kinds if name is not None and is_word(name, *CONSTRAINT_CLASSES))
    return frozenset(name for name in words if not ontology.defined(name))


def _dialect(subs: list[Restriction]) -> Dialect:
    if all(is_word(restriction.property, "subEvents") for restriction in subs):
        return SUB_EVENTS
    for form in ("flat", "intersection", "equivalent"):
        if any(restriction.form == form for restriction in subs):
            return _DIALECTS[form]
    return INTERSECTION
