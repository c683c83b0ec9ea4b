"""Completion of concepts under axioms of OWL 2 EL: to which classes a concept belongs, and to what it is linked.

After Baader, Brandt and Lutz (Pushing the EL envelope, 2005), with a node for each concept that is reached, as in the
reasoner ELK: only what a question reaches is completed. A concept is below a query exactly if its node satisfies it
(:mod:`planlang.knowledge.index`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from planlang.knowledge.axioms import NOTHING, THING, And, Axioms, Concept, Some


class TooLarge(Exception):
    """The axioms about a concept reach more than is completed."""


@dataclass(slots=True)
class Node:
    """A concept with everything that includes it (``labels``, itself too), and its links to fillers of properties.

    ``is_own`` if axioms of the entry had a part in it, so that it is not the same for every entry.
    """

    concept: Concept
    labels: dict[Concept, None] = field(default_factory=dict)
    links: dict[tuple[str, int], None] = field(default_factory=dict)
    linked_from: dict[tuple[str, int], None] = field(default_factory=dict)
    is_own: bool = False


class Completion:
    """Nodes of concepts under some axioms; more are made as they are asked for."""

    def __init__(self, axioms: Axioms, own: Axioms | None = None, *, most: int | None = None) -> None:
        """``own``: axioms of one entry, beside those of the vocabulary; ``most``: nodes that are made at most."""
        self.nodes: list[Node] = []
        self._most = most
        self._axioms = (axioms, own or Axioms())
        self._numbers: dict[Concept, int] = {}
        self._agenda: list[tuple[int, Concept]] = []
        self._some: dict[Concept, list[Some]] = {}
        self._and: dict[Concept, list[And]] = {}
        for known in self._axioms:
            self._index_conditions(known.above)
        self._properties: dict[str, frozenset[str]] = {}
        self._disjoint: dict[Concept, list[str]] = {}
        for one, other in (pair for known in self._axioms for pair in known.disjoint):
            self._disjoint.setdefault(one, []).append(other)
            self._disjoint.setdefault(other, []).append(one)

    def _index_conditions(self, conditions: Iterable[Concept]) -> None:
        """Remember the complex concepts below which something stands: they have to be noticed when they come true."""
        for condition in conditions:
            match condition:
                case Some(_, filler):
                    known = self._some.setdefault(filler, [])
                    if condition not in known:
                        known.append(condition)
                    self._index_conditions((filler,))
                case And(left, right):
                    for part in (left, right):
                        known_and = self._and.setdefault(part, [])
                        if condition not in known_and:
                            known_and.append(condition)
                    self._index_conditions((left, right))

    def number(self, concept: Concept) -> int:
        """Return the node of a concept, completed. Raises TooLarge."""
        found = self._node(concept)
        while self._agenda:
            node, label = self._agenda.pop()
            self._follow(node, label)
        return found

    def _node(self, concept: Concept) -> int:
        number = self._numbers.get(concept)
        if number is None:
            if self._most is not None and len(self.nodes) >= self._most:
                raise TooLarge(f"more than {self._most} concepts follow from each other")
            number = self._numbers[concept] = len(self.nodes)
            self.nodes.append(Node(concept))
            self._add(number, concept)
            self._add(number, THING)
        return number

    def _add(self, node: int, label: Concept) -> None:
        if label not in self.nodes[node].labels:
            self.nodes[node].labels[label] = None
            self._agenda.append((node, label))

    def above(self, prop: str) -> frozenset[str]:
        """Return a property and those above it."""
        found = self._properties.get(prop)
        if found is None:
            reached, queue = {prop}, [prop]
            for one in queue:
                for upper in (upper for known in self._axioms for upper in known.properties_above.get(one, ())):
                    if upper not in reached:
                        reached.add(upper)
                        queue.append(upper)
            found = self._properties[prop] = frozenset(reached)
        return found

    def _follow(self, number: int, label: Concept) -> None:
        """Apply every rule in which a label of a node is a condition."""
        node = self.nodes[number]
        vocabulary, own = self._axioms
        for upper in vocabulary.above.get(label, ()):
            self._add(number, upper)
        for upper in own.above.get(label, ()):
            node.is_own = True
            self._add(number, upper)
        for both in self._and.get(label, ()):
            if both.left in node.labels and both.right in node.labels:
                self._add(number, both)
        match label:
            case And(left, right):
                self._add(number, left)
                self._add(number, right)
            case Some(prop, filler):
                self._link(number, prop, self._node(self._in_range(prop, filler)))
        for condition in self._some.get(label, ()):
            for prop, source in tuple(node.linked_from):
                if condition.property in self.above(prop):
                    self._add(source, condition)
        if label == NOTHING:
            for _, source in tuple(node.linked_from):
                self._add(source, NOTHING)
        if any(other in node.labels for other in self._disjoint.get(label, ())):
            self._add(number, NOTHING)

    def _in_range(self, prop: str, filler: Concept) -> Concept:
        """Return what a filler is as one of a property: of the ranges of it and of those above it, too."""
        found, stated = filler, self._stated_above(filler)
        for upper in sorted(self.above(prop)):
            for known in self._axioms:
                for one in known.ranges.get(upper, ()):
                    if one not in stated:
                        found = And(found, one)
        return found

    def _stated_above(self, concept: Concept) -> set[Concept]:
        reached, queue = {concept}, [concept]
        for one in queue:
            for upper in (upper for known in self._axioms for upper in known.above.get(one, ())):
                if upper not in reached:
                    reached.add(upper)
                    queue.append(upper)
        return reached

    def _link(self, source: int, prop: str, target: int) -> None:
        node, filler = self.nodes[source], self.nodes[target]
        if (prop, target) in node.links:
            return
        node.links[prop, target] = None
        filler.linked_from[prop, source] = None
        upward = self.above(prop)
        for label in tuple(filler.labels):
            for condition in self._some.get(label, ()):
                if condition.property in upward:
                    self._add(source, condition)
        if NOTHING in filler.labels:
            self._add(source, NOTHING)
        for known in self._axioms:
            for upper in (domain for one in upward for domain in known.domains.get(one, ())):
                self._add(source, upper)
        for one in upward & (self._axioms[0].transitive | self._axioms[1].transitive):
            for further, end in tuple(filler.links):
                if one in self.above(further):
                    self._link(source, one, end)
            for before, start in tuple(node.linked_from):
                if one in self.above(before):
                    self._link(start, one, target)
