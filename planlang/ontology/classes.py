"""Class expressions in triples: superclasses, restrictions, members of intersections."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from planlang.diagnostics import Span
from planlang.ontology.terms import (
    EQUIVALENT_CLASS,
    FIRST,
    INTERSECTION_OF,
    KNOWROB,
    NIL,
    ON_PROPERTY,
    OWL,
    REST,
    ROBOEARTH,
    SUBCLASS_OF,
    THING,
    BNode,
    Literal,
    Term,
    Triple,
)

if TYPE_CHECKING:
    from planlang.ontology.ontology import Ontology

_FILLERS = {OWL + "someValuesFrom": "some", OWL + "hasValue": "value", OWL + "allValuesFrom": "only"}
_CARDINALITIES = {
    OWL + "minCardinality": "min",
    OWL + "maxCardinality": "max",
    OWL + "cardinality": "exactly",
    OWL + "minQualifiedCardinality": "min",
    OWL + "maxQualifiedCardinality": "max",
    OWL + "qualifiedCardinality": "exactly",
}
_SUPERCLASS_FORMS = {SUBCLASS_OF: "flat", EQUIVALENT_CLASS: "equivalent", INTERSECTION_OF: "equivalent"}


@dataclass(frozen=True, slots=True)
class Restriction:
    """A restriction of a property: ``kind`` is "some", "value", "only", "min", "max" or "exactly".

    ``filler`` is a class, an individual or a value; of an unqualified cardinality it is owl:Thing. ``form`` tells where
    it stands: "flat" directly above the class, in an "intersection" above it, or in an "equivalent" class.
    ``span`` is where the filler stands.
    """

    property: str
    kind: str
    filler: Term
    cardinality: int | None
    span: Span
    form: str


def restrictions_of(ontology: Ontology, cls: str | BNode) -> Iterator[Restriction]:
    """The restrictions of a class in source order; of a nameless one those that it consists of."""
    if isinstance(cls, BNode):
        for member in conjuncts(ontology, cls):
            if isinstance(member, BNode):
                yield from _restriction(ontology, member, "intersection")
        return
    for triple in ontology.triples(s=cls):
        form = _SUPERCLASS_FORMS.get(triple.predicate)
        if form is None or not isinstance(triple.object, BNode):
            continue
        if triple.predicate == INTERSECTION_OF:
            parts: Iterable[Term] = _opened(ontology, items(ontology, triple.object))
        else:
            parts = conjuncts(ontology, triple.object)
        for part in parts:
            if isinstance(part, BNode):
                nested = "intersection" if form == "flat" and part != triple.object else form
                yield from _restriction(ontology, part, nested)


def _restriction(ontology: Ontology, node: BNode, form: str) -> Iterator[Restriction]:
    statements = list(ontology.triples(s=node))
    prop = next((t.object for t in statements if t.predicate == ON_PROPERTY), None)
    if not isinstance(prop, str):
        return
    for triple in statements:
        if (kind := _FILLERS.get(triple.predicate)) is not None:
            yield Restriction(prop, kind, triple.object, None, triple.span, form)
        elif (kind := _CARDINALITIES.get(triple.predicate)) is not None:
            number = _whole(triple.object)
            filler = next(
                (t.object for t in statements if t.predicate in (OWL + "onClass", OWL + "onDataRange")), THING
            )
            if number is not None:
                yield Restriction(prop, kind, filler, number, triple.span, form)


def _whole(term: Term) -> int | None:
    if isinstance(term, Literal) and term.value.strip().isdecimal() and len(term.value) < 10:
        return int(term.value)
    return None


def conjuncts(ontology: Ontology, expression: Term) -> Iterator[Term]:
    """The members of an intersection, nested ones opened; of anything else the expression itself."""
    yield from _opened(ontology, [expression])


def _opened(ontology: Ontology, expressions: Iterable[Term]) -> Iterator[Term]:
    """The expressions in their order, intersections among them opened, each once however they are nested."""
    opened: set[Term] = set()
    stack = [*expressions][::-1]
    while stack:
        expression = stack.pop()
        if isinstance(expression, BNode) and expression not in opened:
            members = next(ontology.triples(s=expression, p=INTERSECTION_OF), None)
            if members is not None:
                opened.add(expression)
                stack += [*items(ontology, members.object)][::-1]
                continue
        if expression not in opened:
            yield expression


def items(ontology: Ontology, cell: Term) -> Iterator[Term]:
    """The items of an RDF list; a list that bites its own tail ends there."""
    seen: set[Term] = set()
    while isinstance(cell, (str, BNode)) and cell != NIL and cell not in seen:
        seen.add(cell)
        following: Term = NIL
        for triple in ontology.triples(s=cell):
            if triple.predicate == FIRST:
                yield triple.object
            elif triple.predicate == REST:
                following = triple.object
        cell = following


def edges(ontology: Ontology) -> Iterator[tuple[str, str]]:
    """Pairs (class, superclass) of named classes, in document order; equivalent names are below each other."""
    for triple in ontology.triples():
        if triple.predicate in _SUPERCLASS_FORMS and isinstance(triple.subject, str):
            yield from _edges(ontology, triple)


def _edges(ontology: Ontology, triple: Triple) -> Iterator[tuple[str, str]]:
    assert isinstance(triple.subject, str)
    if isinstance(triple.object, str) and triple.predicate != INTERSECTION_OF:
        yield triple.subject, triple.object
        if triple.predicate == EQUIVALENT_CLASS:
            yield triple.object, triple.subject
        return
    if triple.predicate == INTERSECTION_OF:
        members: Iterator[Term] = _opened(ontology, items(ontology, triple.object))
    else:
        members = conjuncts(ontology, triple.object)
    for member in members:
        if isinstance(member, str):
            yield triple.subject, member


def alias_edges(ontology: Ontology, names: Iterable[str]) -> Iterator[tuple[str, str]]:
    """RoboEarth's class of the same name as one of KnowRob's is below it, wherever a document mentions it."""
    for name in dict.fromkeys(name for name in names if name.startswith(ROBOEARTH)):
        upper = twin(name)
        if upper is not None and ontology.is_class(upper):
            yield name, upper


def twin(name: str) -> str | None:
    """KnowRob's name for a term that RoboEarth calls the same; None for anything else."""
    local = name.removeprefix(ROBOEARTH)
    return KNOWROB + local if local and local != name else None
