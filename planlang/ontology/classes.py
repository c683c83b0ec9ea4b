"""Class expressions in triples (superclasses, restrictions, members of intersections), and the class hierarchy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from planlang.closure import grouped, reached
from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology.terms import KNOWROB, OWL, RDF, RDFS, ROBOEARTH, SOMA, VOCABULARIES, Literal, Term
from planlang.ontology.triples import Triples


class Taxonomy:
    """Hierarchy of named classes.

    ``edges`` are pairs (class, direct superclass) in document order; equivalent classes are below each other.
    """

    def __init__(self, edges: Iterable[tuple[str, str]]) -> None:
        self._parents: dict[str, dict[str, None]] = {}
        self._children: dict[str, list[str]] = {}
        self._ancestors: dict[str, tuple[str, ...]] = {}
        for lower, upper in edges:
            above = self._parents.setdefault(lower, {})
            if upper not in above and upper != lower:
                above[upper] = None
                self._children.setdefault(upper, []).append(lower)

    def classes(self) -> tuple[str, ...]:
        """Classes that have superclasses, in document order."""
        return tuple(self._parents)

    def parents(self, cls: str) -> tuple[str, ...]:
        """Direct superclasses in document order."""
        return tuple(self._parents.get(cls, ()))

    def ancestors(self, cls: str) -> tuple[str, ...]:
        """Class itself, then its superclasses, nearest first; at equal distance in document order."""
        ancestors = self._ancestors.get(cls)
        if ancestors is None:
            ancestors = self._ancestors[cls] = by_distance(cls, self._parents)
        return ancestors

    def descendants(self, cls: str) -> tuple[str, ...]:
        """Class itself, then its subclasses, nearest first; at equal distance in document order."""
        return by_distance(cls, self._children)

    def is_below(self, cls: str, upper: str) -> bool:
        """Check whether a class is ``upper`` or one of its subclasses."""
        return cls == upper or upper in self.ancestors(cls)


def by_distance(start: str, neighbours: Mapping[str, Iterable[str]]) -> tuple[str, ...]:
    """Breadth-first search from ``start``, which comes first; each node is visited once."""
    return tuple(reached((start,), lambda node: neighbours.get(node, ())))


_FILLERS = {OWL.someValuesFrom: "some", OWL.hasValue: "value", OWL.allValuesFrom: "only"}
_CARDINALITIES = {
    OWL.minCardinality: "min",
    OWL.maxCardinality: "max",
    OWL.cardinality: "exactly",
    OWL.minQualifiedCardinality: "min",
    OWL.maxQualifiedCardinality: "max",
    OWL.qualifiedCardinality: "exactly",
}
RESTRICTING = (*_FILLERS, *_CARDINALITIES)
"""Predicates that state the filler or cardinality of a restriction; their position is the restriction's span."""

_SUPERCLASS_FORMS = {RDFS.subClassOf: "flat", OWL.equivalentClass: "equivalent", OWL.intersectionOf: "equivalent"}


class Restriction(NamedTuple):
    """Restriction of a property: ``kind`` is "some", "value", "only", "min", "max" or "exactly".

    ``filler`` is a class, an individual or a literal, and owl:Thing for an unqualified cardinality. ``form`` is "flat"
    for a superclass, "intersection" for a member of one, "equivalent" inside an equivalent class. ``span`` is the
    position of the filler.
    """

    property: str
    kind: str
    filler: Term
    cardinality: int | None
    span: Span
    form: str


def restrictions_of(triples: Triples, words: Words, cls: int) -> Iterator[Restriction]:
    """Yield the restrictions of a class, or the members of a blank expression, in source order. Terms by number."""
    for part, form in _parts(triples, words, cls):
        yield from _restriction(triples, part, form, words)


def unread_parts(triples: Triples, words: Words, cls: int) -> Iterator[int]:
    """Yield the anonymous superclasses of a class, or members of a blank expression, that are no restrictions."""
    return (part for part, form in _parts(triples, words, cls) if not _restriction(triples, part, form, words))


def _parts(triples: Triples, words: Words, cls: int) -> Iterator[tuple[int, str]]:
    """Yield the anonymous superclasses of a class, or members of a blank expression, each with its form."""
    if triples.is_node(cls):
        yield from ((member, "intersection") for member in conjuncts(triples, cls) if triples.is_node(member))
        return
    for row in triples.about(cls):
        form = words.forms.get(triples.predicates[row])
        if form is None or not triples.is_node(value := triples.objects[row]):
            continue
        is_list = triples.predicates[row] == words.intersection
        for part in _opened(triples, items(triples, value) if is_list else (value,)):
            if triples.is_node(part):
                yield part, "intersection" if form == "flat" and part != value else form


class Words(NamedTuple):
    """Term numbers of the OWL vocabulary for class expressions; -1 if unused."""

    forms: dict[int, str]
    intersection: int
    on_property: int
    fillers: dict[int, str]
    cardinalities: dict[int, str]
    ranges: frozenset[int]

    @staticmethod
    def of(triples: Triples) -> Words:
        """Look up the vocabulary in a store."""
        number = triples.numbers

        def used(meanings: Mapping[str, str]) -> dict[int, str]:
            return {number[iri]: meaning for iri, meaning in meanings.items() if iri in number}

        return Words(
            used(_SUPERCLASS_FORMS),
            number.get(OWL.intersectionOf, -1),
            number.get(OWL.onProperty, -1),
            used(_FILLERS),
            used(_CARDINALITIES),
            frozenset(number[iri] for iri in (OWL.onClass, OWL.onDataRange) if iri in number),
        )


def _restriction(triples: Triples, node: int, form: str, words: Words) -> Sequence[Restriction]:
    """Read the restrictions of a blank node: one for each filler or cardinality of its first property."""
    _, _, on_property, fillers, cardinalities, ranges = words
    predicates, objects, (rows, following) = triples.predicates, triples.objects, triples.by_subject
    first, row = -1, rows[node]
    stated: list[tuple[int, str]] = []
    qualifiers: list[int] = []
    while row >= 0:
        predicate = predicates[row]
        if predicate == on_property:
            first = row if first < 0 else first
        elif (kind := fillers.get(predicate) or cardinalities.get(predicate)) is not None:
            stated.append((row, kind))
        elif predicate in ranges:
            qualifiers.append(row)
        row = following[row]
    prop = triples.name(objects[first]) if first >= 0 else None
    if prop is None:
        return ()
    restrictions: list[Restriction] = []
    for row, kind in stated:
        number = meant(triples, objects[row])
        filler, cardinality = triples.terms[number] or triples.term(number), None
        if cardinalities and predicates[row] in cardinalities:
            cardinality = _natural_number(filler)
            if cardinality is None:
                continue
            filler = triples.term(meant(triples, objects[qualifiers[0]])) if qualifiers else OWL.Thing
        restrictions.append(Restriction(prop, kind, filler, cardinality, triples.span(row), form))
    return restrictions


DEEPEST = 50
"""Nesting of expressions up to which :func:`meant` looks for a name; it ends cyclic ones."""


def meant(triples: Triples, term: int, depth: int = 0) -> int:
    """Return the only name that an expression consists of, as ``Cup and owl:Thing`` and ``{cup1}`` do, else itself."""
    if not triples.is_node(term) or depth > DEEPEST:
        return term
    thing, one_of = triples.find(OWL.Thing), triples.find(OWL.oneOf)
    members = [one for one in conjuncts(triples, term) if one != term] or list(disjuncts(triples, term))
    for row in triples.about(term) if one_of is not None and not members else ():
        if triples.predicates[row] == one_of:
            members += items(triples, triples.objects[row])
    names = dict.fromkeys(meant(triples, one, depth + 1) for one in dict.fromkeys(members) if one != thing)
    only = next(iter(names), term)
    return only if len(names) == 1 and not triples.is_node(only) else term


def _natural_number(term: Term) -> int | None:
    if isinstance(term, Literal) and term.value.strip().isdecimal() and len(term.value) < 10:
        return int(term.value)
    return None


def conjuncts(triples: Triples, expression: int) -> Iterator[int]:
    """Yield the members of an intersection, flattened, or the expression if it is none. Terms by number."""
    return _opened(triples, [expression])


def _opened(triples: Triples, expressions: Iterable[int]) -> Iterator[int]:
    """Yield the expressions in order, with intersections flattened; a cyclic intersection is entered once."""
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


def disjuncts(triples: Triples, expression: int) -> Iterator[int]:
    """Yield the members of a union, flattened, each once; nothing if it is no union. Terms by number."""
    union = triples.find(OWL.unionOf)
    seen: set[int] = set()

    def within(node: int) -> Iterator[int]:
        for row in triples.about(node):
            if triples.predicates[row] == union:
                for member in items(triples, triples.objects[row]):
                    if member not in seen:
                        seen.add(member)
                        inner = list(within(member)) if triples.is_node(member) else []
                        yield from inner or [member]

    yield from within(expression)


def items(triples: Triples, cell: int) -> Iterator[int]:
    """Yield the items of an RDF list; a cyclic list ends before its first repeated cell. Terms by number."""
    first, rest, end = triples.find(RDF.first), triples.find(RDF.rest), triples.find(RDF.nil)
    predicates, objects, (rows, next_row) = triples.predicates, triples.objects, triples.by_subject
    seen: set[int] = set()
    while cell != end and cell not in seen:
        seen.add(cell)
        following, row = end, rows[cell]
        while row >= 0:
            predicate = predicates[row]
            if predicate == first:
                yield objects[row]
            elif predicate == rest:
                following = objects[row]
            row = next_row[row]
        if following is None:
            return
        cell = following


def edges(triples: Triples) -> Iterator[tuple[str, str]]:
    """Yield pairs (class, superclass) of named classes in document order; equivalent names are below each other."""
    intersection, equivalent = triples.find(OWL.intersectionOf), triples.find(OWL.equivalentClass)
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


def alias_edges(is_class: Callable[[str], bool], names: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Place each mentioned RoboEarth class below the KnowRob class of the same local name."""
    for name in dict.fromkeys(name for name in names if name.startswith(ROBOEARTH)):
        upper = twin(name)
        if upper is not None and is_class(upper):
            yield name, upper


def namesakes(undefined: Iterable[str], classes: Iterable[str]) -> dict[str, str]:
    """Map undefined superclasses to the only class of the same local name outside the bundled vocabularies.

    This repairs files that misspell their own namespace in some places, as knowrob.owl.owl.
    """
    missing = dict.fromkeys(name for name in undefined if not name.startswith(SOMA))  # its names have no other meaning
    if not missing:
        return {}
    foreign = (cls for cls in classes if not cls.startswith(tuple(VOCABULARIES.values())))
    by_local_name = grouped((local_name(cls), cls) for cls in foreign)
    return {name: same[0] for name in missing if len(same := by_local_name.get(local_name(name), [])) == 1}


def twin(name: str) -> str | None:
    """IRI of the KnowRob term with the same local name as a RoboEarth term; None for other IRIs."""
    local = name.removeprefix(ROBOEARTH)
    return KNOWROB + local if local and local != name else None
