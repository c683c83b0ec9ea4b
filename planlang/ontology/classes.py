"""Class expressions in triples (superclasses, restrictions, members of intersections), and the hierarchy of classes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from planlang.closure import reached
from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology.terms import KNOWROB, OWL, RDF, RDFS, ROBOEARTH, VOCABULARIES, Literal, Term
from planlang.ontology.triples import Triples


class Taxonomy:
    """Named classes and which are directly below which.

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
        """Return the classes that have superclasses, in document order."""
        return tuple(self._parents)

    def parents(self, cls: str) -> tuple[str, ...]:
        """Return the direct superclasses in document order."""
        return tuple(self._parents.get(cls, ()))

    def ancestors(self, cls: str) -> tuple[str, ...]:
        """Return the class itself, then what is above it, nearest first; at the same distance in document order."""
        found = self._ancestors.get(cls)
        if found is None:
            found = self._ancestors[cls] = by_distance(cls, self._parents)
        return found

    def descendants(self, cls: str) -> tuple[str, ...]:
        """Return the class itself, then what is below it, nearest first; at the same distance in document order."""
        return by_distance(cls, self._children)

    def is_below(self, cls: str, upper: str) -> bool:
        """Return True if the classes are the same or the first is below the second."""
        return cls == upper or upper in self.ancestors(cls)


def by_distance(start: str, neighbours: Mapping[str, Iterable[str]]) -> tuple[str, ...]:
    """Return everything that is reached from ``start``, itself first, level by level; circles are walked once."""
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
"""The words of OWL whose triples say what a restriction asks for; where they stand is the restriction's span."""

_SUPERCLASS_FORMS = {RDFS.subClassOf: "flat", OWL.equivalentClass: "equivalent", OWL.intersectionOf: "equivalent"}


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


def restrictions_of(triples: Triples, words: Words, cls: int) -> Iterator[Restriction]:
    """Return the restrictions of a class in source order, for a nameless one its parts. Terms by number."""
    if triples.is_node(cls):
        for member in conjuncts(triples, cls):
            if triples.is_node(member):
                yield from _restriction(triples, member, "intersection", words)
        return
    for row in triples.about(cls):
        form = words.forms.get(triples.predicates[row])
        if form is None or not triples.is_node(value := triples.objects[row]):
            continue
        is_list = triples.predicates[row] == words.intersection
        for part in _opened(triples, items(triples, value) if is_list else (value,)):
            if triples.is_node(part):
                nested = "intersection" if form == "flat" and part != value else form
                yield from _restriction(triples, part, nested, words)


class Words(NamedTuple):
    """The words of class expressions by their numbers; -1 for one that is not used."""

    forms: dict[int, str]
    intersection: int
    on_property: int
    fillers: dict[int, str]
    cardinalities: dict[int, str]
    ranges: frozenset[int]

    @staticmethod
    def of(triples: Triples) -> Words:
        """Return the words that these triples use."""
        number = triples.numbers

        def used(words: Mapping[str, str]) -> dict[int, str]:
            return {number[word]: meaning for word, meaning in words.items() if word in number}

        return Words(
            used(_SUPERCLASS_FORMS),
            number.get(OWL.intersectionOf, -1),
            number.get(OWL.onProperty, -1),
            used(_FILLERS),
            used(_CARDINALITIES),
            frozenset(number[word] for word in (OWL.onClass, OWL.onDataRange) if word in number),
        )


def _restriction(triples: Triples, node: int, form: str, words: Words) -> Sequence[Restriction]:
    """Return the restrictions that a nameless node is: one for each filler or cardinality of its first property."""
    _, _, on_property, fillers, cardinalities, ranges = words
    predicates, objects, (rows, following) = triples.predicates, triples.objects, triples.by_subject
    first, row = -1, rows[node]
    stated: list[tuple[int, str]] = []
    within: list[int] = []
    while row >= 0:
        predicate = predicates[row]
        if predicate == on_property:
            first = row if first < 0 else first
        elif (kind := fillers.get(predicate) or cardinalities.get(predicate)) is not None:
            stated.append((row, kind))
        elif predicate in ranges:
            within.append(row)
        row = following[row]
    prop = triples.name(objects[first]) if first >= 0 else None
    if prop is None:
        return ()
    found: list[Restriction] = []
    for row, kind in stated:
        number = objects[row]
        filler, times = triples.terms[number] or triples.term(number), None
        if cardinalities and predicates[row] in cardinalities:
            times = _whole(filler)
            if times is None:
                continue
            filler = triples.term(objects[within[0]]) if within else OWL.Thing
        found.append(Restriction(prop, kind, filler, times, triples.span(row), form))
    return found


def _whole(term: Term) -> int | None:
    if isinstance(term, Literal) and term.value.strip().isdecimal() and len(term.value) < 10:
        return int(term.value)
    return None


def conjuncts(triples: Triples, expression: int) -> Iterator[int]:
    """Yield the members of an intersection, flattened; of anything else the expression itself. Terms by number."""
    return _opened(triples, [expression])


def _opened(triples: Triples, expressions: Iterable[int]) -> Iterator[int]:
    """Yield the expressions in their order, intersections among them flattened, each expression once."""
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
    """Yield the members of a union, flattened, each once; nothing for anything else. Terms by number."""
    union = triples.find(OWL.unionOf)
    found: set[int] = set()

    def within(node: int) -> Iterator[int]:
        for row in triples.about(node):
            if triples.predicates[row] == union:
                for member in items(triples, triples.objects[row]):
                    if member not in found:
                        found.add(member)
                        inner = list(within(member)) if triples.is_node(member) else []
                        yield from inner or [member]

    yield from within(expression)


def items(triples: Triples, cell: int) -> Iterator[int]:
    """Yield the items of an RDF list; a cyclic list ends where it repeats. Terms by number."""
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
    """RoboEarth's class of the same name as one of KnowRob's is below it, wherever a document mentions it."""
    for name in dict.fromkeys(name for name in names if name.startswith(ROBOEARTH)):
        upper = twin(name)
        if upper is not None and is_class(upper):
            yield name, upper


def namesakes(undefined: Iterable[str], classes: Iterable[str]) -> dict[str, str]:
    """Return for undefined superclasses the only class of the same local name that is in no vocabulary's namespace.

    Files whose own namespace is misspelt somewhere, such as knowrob.owl.owl, name their classes so.
    """
    wanted = dict.fromkeys(undefined)
    if not wanted:
        return {}
    found: dict[str, list[str]] = {}
    for cls in classes:
        if not cls.startswith(tuple(VOCABULARIES.values())):
            found.setdefault(local_name(cls), []).append(cls)
    return {name: same[0] for name in wanted if len(same := found.get(local_name(name), [])) == 1}


def twin(name: str) -> str | None:
    """Return KnowRob's name for a term that RoboEarth calls the same; None for anything else."""
    local = name.removeprefix(ROBOEARTH)
    return KNOWROB + local if local and local != name else None
