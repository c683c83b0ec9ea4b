"""OWL 2 EL reasoner: computes the superclasses and the links of concepts.

The completion algorithm of Baader, Brandt and Lutz (Pushing the EL envelope, 2005), with a node for each concept
reached, as in the reasoner ELK, so that only concepts reachable from a query are completed. A concept is subsumed by a
query if and only if its node satisfies it (:mod:`planlang.knowledge.index`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import field

from planlang.closure import reached
from planlang.knowledge.axioms import NOTHING, THING, And, Axioms, Concept, Some, together
from planlang.records import dataclass

FACTS_OF_A_NODE = 50
"""Maximum mean number of labels and links per node, if the number of nodes is bounded."""


class TooLarge(Exception):
    """The completion of a concept exceeds the limits."""


@dataclass(slots=True)
class Node:
    """A concept with its superconcepts, itself included (``labels``), and its links to the fillers of properties.

    ``linked_from`` has the incoming links; ``first_from`` those that do not follow from transitivity, with which every
    path begins. ``is_own``: derived with axioms of the entry, so not the same for every entry.
    """

    concept: Concept
    labels: dict[Concept, None] = field(default_factory=dict)
    links: dict[tuple[str, int], None] = field(default_factory=dict)
    linked_from: dict[tuple[str, int], None] = field(default_factory=dict)
    first_from: dict[tuple[str, int], None] = field(default_factory=dict)
    is_own: bool = False


class Completion:
    """Completion graph; nodes are created on demand."""

    def __init__(self, axioms: Axioms, own: Axioms | None = None, *, most: int | None = None) -> None:
        """Combine the axioms of the vocabulary with an entry's ``own``, for at most ``most`` nodes."""
        self.nodes: list[Node] = []
        self._most = most
        self._facts = 0
        self._axioms = (axioms, own or Axioms())
        self._numbers: dict[Concept, int] = {}
        self._agenda: list[tuple[int, Concept]] = []
        self._new_links: list[tuple[int, str, int]] = []
        self._some: dict[Concept, list[Some]] = {}
        self._and: dict[Concept, list[And]] = {}
        for known in self._axioms:
            self._index_conditions(known.above)
        self._properties: dict[str, frozenset[str]] = {}
        self._begins: dict[str, list[tuple[str, str]]] = {}
        self._ends: dict[str, list[tuple[str, str]]] = {}
        for first, second, whole in dict.fromkeys(chain for known in self._axioms for chain in known.chains):
            self._begins.setdefault(first, []).append((second, whole))
            self._ends.setdefault(second, []).append((first, whole))
        self.own_properties = frozenset(_shaped(*self._axioms))
        """Properties with additional axioms in the entry."""
        self._disjoint: dict[Concept, list[str]] = {}
        for one, other in (pair for known in self._axioms for pair in known.disjoint):
            self._disjoint.setdefault(one, []).append(other)
            self._disjoint.setdefault(other, []).append(one)

    def _index_conditions(self, conditions: Iterable[Concept]) -> None:
        """Index the complex concepts on the left of axioms by their parts, to notice when they become true."""
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
        """Return the node of a concept, after completing it. Raises TooLarge."""
        found = self._node(concept)
        while self._agenda or self._new_links:
            if self._agenda:
                self._follow(*self._agenda.pop())
            else:
                self._follow_link(*self._new_links.pop())
        return found

    def _node(self, concept: Concept) -> int:
        number = self._numbers.get(concept)
        if number is None:
            if self._most is not None and len(self.nodes) >= self._most:
                raise TooLarge(f"the completion needs more than {self._most} concepts")
            number = self._numbers[concept] = len(self.nodes)
            self.nodes.append(Node(concept))
            self._add(number, concept)
            self._add(number, THING)
        return number

    def _add(self, node: int, label: Concept) -> None:
        if label not in self.nodes[node].labels:
            self._count()
            self.nodes[node].labels[label] = None
            self._agenda.append((node, label))

    def _count(self) -> None:
        self._facts += 1
        if self._most is not None and self._facts > FACTS_OF_A_NODE * self._most:
            raise TooLarge(f"the completion needs more than {FACTS_OF_A_NODE * self._most} facts")

    def above(self, prop: str) -> frozenset[str]:
        """Return a property and its superproperties."""
        if prop not in self._properties:
            above = [known.properties_above for known in self._axioms]
            upper = reached((prop,), lambda one: (up for known in above for up in known.get(one, ())))
            self._properties[prop] = frozenset(upper)
        return self._properties[prop]

    def _follow(self, number: int, label: Concept) -> None:
        """Apply every rule that has the label as a premise."""
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
        """Intersect a filler with the ranges of the property and its superproperties."""
        stated = {*reached((filler,), lambda one: (up for known in self._axioms for up in known.above.get(one, ())))}
        upward = sorted(self.above(prop))
        ranges = (one for known in self._axioms for upper in upward for one in known.ranges.get(upper, ()))
        found = together((filler, *dict.fromkeys(one for one in ranges if one not in stated)))
        assert found is not None
        return found

    def _link(self, source: int, prop: str, target: int, *, is_first: bool = True) -> None:
        node, filler = self.nodes[source], self.nodes[target]
        is_new = (prop, target) not in node.links
        if is_new:
            self._count()
            node.links[prop, target] = None
            filler.linked_from[prop, source] = None
        if is_first and (prop, source) not in filler.first_from:
            filler.first_from[prop, source] = None
            is_new = True
        if is_new:
            self._new_links.append((source, prop, target))

    def _follow_link(self, source: int, prop: str, target: int) -> None:
        """Apply every rule that has the link as a premise."""
        node, filler = self.nodes[source], self.nodes[target]
        upward = self.above(prop)
        node.is_own |= not upward.isdisjoint(self.own_properties)
        for label in tuple(filler.labels):
            for condition in self._some.get(label, ()):
                if condition.property in upward:
                    self._add(source, condition)
        if NOTHING in filler.labels:
            self._add(source, NOTHING)
        for known in self._axioms:
            for upper in (domain for one in upward for domain in known.domains.get(one, ())):
                self._add(source, upper)
        for one in upward:
            for second, whole in self._begins.get(one, ()):
                is_transitive = one == second == whole
                if not is_transitive or (prop, source) in filler.first_from:
                    for further, end in tuple(filler.links):
                        if second in self.above(further):
                            self._link(source, whole, end, is_first=not is_transitive)
            for first, whole in self._ends.get(one, ()):
                is_transitive = one == first == whole
                for before, start in tuple(node.first_from if is_transitive else node.linked_from):
                    if first in self.above(before):
                        self._link(start, whole, target, is_first=not is_transitive)


def _shaped(vocabulary: Axioms, own: Axioms) -> Iterator[str]:
    """Yield the properties with axioms in ``own`` that the vocabulary does not have."""
    for prop, above in own.properties_above.items():
        if above - {prop} - vocabulary.properties_above.get(prop, set()):
            yield prop
    for stated, known in ((own.domains, vocabulary.domains), (own.ranges, vocabulary.ranges)):
        yield from (prop for prop, uppers in stated.items() if not set(uppers) <= set(known.get(prop, ())))
    for first, second, _ in set(own.chains) - set(vocabulary.chains):
        yield from (first, second)
