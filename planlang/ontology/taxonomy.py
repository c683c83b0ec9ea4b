"""The hierarchy of classes: owlready2 stores it and answers what lies above and below; the order is the documents'."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


class Taxonomy:
    """Named classes and which are directly below which, kept in an owlready2 world of its own.

    ``edges`` are pairs (class, direct superclass) in document order; equivalent classes are below each other.
    """

    def __init__(self, edges: Iterable[tuple[str, str]]) -> None:
        import owlready2

        self._world: Any = owlready2.World()
        self._below: int = owlready2.rdfs_subclassof
        store: Any = self._world.get_ontology("http://knowrob.org/kb/planlang_taxonomy.owl#")
        self._numbers: dict[str, int] = {}
        self._names: dict[int, str] = {}
        self._parents: dict[str, list[str]] = {}
        self._children: dict[str, list[str]] = {}
        for lower, upper in edges:
            above = self._parents.setdefault(lower, [])
            if upper not in above and upper != lower:
                above.append(upper)
                self._children.setdefault(upper, []).append(lower)
                store._add_obj_triple_raw_spo(self._number(lower), self._below, self._number(upper))
        self._ancestors: dict[str, tuple[str, ...]] = {}

    @property
    def world(self) -> Any:
        """The owlready2 ``World`` that holds the hierarchy."""
        return self._world

    def parents(self, cls: str) -> tuple[str, ...]:
        """Direct superclasses in document order."""
        return tuple(self._parents.get(cls, ()))

    def ancestors(self, cls: str) -> tuple[str, ...]:
        """The class itself, then what is above it, nearest first; at the same distance in document order."""
        found = self._ancestors.get(cls)
        if found is None:
            found = self._ancestors[cls] = self._by_distance(cls, self._parents, self._closure(cls, upwards=True))
        return found

    def descendants(self, cls: str) -> tuple[str, ...]:
        """The class itself, then what is below it, nearest first; at the same distance in document order."""
        return self._by_distance(cls, self._children, self._closure(cls, upwards=False))

    def is_below(self, cls: str, upper: str) -> bool:
        """True if the classes are the same or the first is below the second."""
        return cls == upper or upper in self.ancestors(cls)

    def _number(self, iri: str) -> int:
        number = self._numbers.get(iri)
        if number is None:
            number = self._numbers[iri] = self._world._abbreviate(iri)
            self._names[number] = iri
        return number

    def _closure(self, cls: str, *, upwards: bool) -> set[str]:
        if upwards and cls not in self._children:  # most classes are so; what is above their parents is known
            return {cls}.union(*(self.ancestors(parent) for parent in self._parents.get(cls, ())))
        number = self._numbers.get(cls)
        if number is None:
            return {cls}
        if upwards:
            reached = self._world._get_obj_triples_transitive_sp(number, self._below)
        else:
            reached = self._world._get_obj_triples_transitive_po(self._below, number)
        return {cls, *(self._names[other] for other in reached if other in self._names)}

    @staticmethod
    def _by_distance(start: str, neighbours: dict[str, list[str]], closure: set[str]) -> tuple[str, ...]:
        order = dict.fromkeys((start,))
        for cls in order_walk(start, neighbours):
            if cls in closure:
                order[cls] = None
        return tuple(order)


def order_walk(start: str, neighbours: dict[str, list[str]]) -> list[str]:
    """Everything that is reached from ``start``, itself first, level by level; circles are walked once."""
    reached = {start: None}
    queue = [start]
    for node in queue:
        for neighbour in neighbours.get(node, ()):
            if neighbour not in reached:
                reached[neighbour] = None
                queue.append(neighbour)
    return queue
