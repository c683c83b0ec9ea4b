"""Class expressions in triples: superclasses, restrictions, members of intersections."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

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
    Literal,
    Term,
)
from planlang.ontology.triples import Triples

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


class Restriction(NamedTuple):
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


def restrictions_of(triples: Triples, cls: int) -> Iterator[Restriction]:
    """The restrictions of a class in source order; of a nameless one those that it consists of. Terms by number."""
    if triples.is_node(cls):
        for member in conjuncts(triples, cls):
            if triples.is_node(member):
                yield from _restriction(triples, member, "intersection")
        return
    forms = {triples.find(predicate): form for predicate, form in _SUPERCLASS_FORMS.items()}
    intersection = triples.find(INTERSECTION_OF)
    for row in triples.about(cls):
        form, value = forms.get(triples.predicates[row]), triples.objects[row]
        if form is None or not triples.is_node(value):
            continue
        for part in _opened(triples, items(triples, value) if triples.predicates[row] == intersection else (value,)):
            if triples.is_node(part):
                nested = "intersection" if form == "flat" and part != value else form
                yield from _restriction(triples, part, nested)


def _restriction(triples: Triples, node: int, form: str) -> Iterator[Restriction]:
    rows = list(triples.about(node))
    stated: list[str] = [triples.terms[triples.predicates[row]] for row in rows]  # type: ignore[misc]
    prop = triples.name(triples.objects[rows[stated.index(ON_PROPERTY)]]) if ON_PROPERTY in stated else None
    if prop is None:
        return
    for row, predicate in zip(rows, stated, strict=True):
        if (kind := _FILLERS.get(predicate)) is not None:
            yield Restriction(prop, kind, triples.term(triples.objects[row]), None, triples.span(row), form)
        elif (kind := _CARDINALITIES.get(predicate)) is not None:
            number = _whole(triples.term(triples.objects[row]))
            ranges = (r for r, p in zip(rows, stated, strict=True) if p in (OWL + "onClass", OWL + "onDataRange"))
            filler = next((triples.term(triples.objects[r]) for r in ranges), THING)
            if number is not None:
                yield Restriction(prop, kind, filler, number, triples.span(row), form)


def _whole(term: Term) -> int | None:
    if isinstance(term, Literal) and term.value.strip().isdecimal() and len(term.value) < 10:
        return int(term.value)
    return None


def conjuncts(triples: Triples, expression: int) -> Iterator[int]:
    """The members of an intersection, nested ones opened; of anything else the expression itself. Terms by number."""
    return _opened(triples, [expression])


def _opened(triples: Triples, expressions: Iterable[int]) -> Iterator[int]:
    """The expressions in their order, intersections among them opened, each once however they are nested."""
    lists = triples.intersections
    opened: set[int] = set()
    for expression in expressions:
        if expression not in lists:
            yield expression
            continue
        stack = [expression]
        while stack:
            inner = stack.pop()
            if inner not in lists:
                yield inner
            elif inner not in opened:
                opened.add(inner)
                stack += [*items(triples, lists[inner])][::-1]


def items(triples: Triples, cell: int) -> Iterator[int]:
    """The items of an RDF list; a list that bites its own tail ends there. Terms by number."""
    first, rest, end = triples.find(FIRST), triples.find(REST), triples.find(NIL)
    seen: set[int] = set()
    while cell != end and cell not in seen:
        seen.add(cell)
        following = end
        for row in triples.about(cell):
            if triples.predicates[row] == first:
                yield triples.objects[row]
            elif triples.predicates[row] == rest:
                following = triples.objects[row]
        if following is None:
            return
        cell = following


def edges(triples: Triples) -> Iterator[tuple[str, str]]:
    """Pairs (class, superclass) of named classes, in document order; equivalent names are below each other."""
    intersection, equivalent = triples.find(INTERSECTION_OF), triples.find(EQUIVALENT_CLASS)
    for row in triples.by(*_SUPERCLASS_FORMS):
        lower, value = triples.name(triples.subjects[row]), triples.objects[row]
        if lower is None:
            continue
        upper = triples.name(value)
        if upper is not None and triples.predicates[row] != intersection:
            yield lower, upper
            if triples.predicates[row] == equivalent:
                yield upper, lower
            continue
        if triples.predicates[row] == intersection:
            members = _opened(triples, items(triples, value))
        elif value in triples.intersections:
            members = conjuncts(triples, value)
        else:
            continue
        for member in map(triples.name, members):
            if member is not None:
                yield lower, member


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
