"""Descriptions of entries, by which they are found: their classes, their links, its words, its place.

A description is what a store keeps beside an entry's content and what an index is built from: it holds what the entry
adds to the vocabulary, and names of the vocabulary for everything else.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planlang.closure import reached
from planlang.knowledge.axioms import THING, Axioms, Concept, One
from planlang.knowledge.completion import Completion, Node
from planlang.records import dataclass

MOST_NODES = 20_000
"""Nodes that the completion of one entry may have."""

Label = str
"""A named class, or ``{IRI}``: the class of one individual."""


@dataclass(frozen=True, slots=True)
class Described:
    """A node of a description: its most specific labels, and links (property, number of a node or vocabulary label)."""

    labels: tuple[Label, ...]
    links: tuple[tuple[str, int | Label], ...] = ()


@dataclass(frozen=True, slots=True)
class Description:
    """The description of an entry. ``nodes[0]`` is the described class or individual.

    ``words`` are labels and names that a reader may search for; ``place`` has the values of ``room``, ``floor``,
    ``building``, ``street`` and ``city`` that a map states.
    """

    nodes: tuple[Described, ...]
    words: tuple[str, ...] = ()
    place: tuple[tuple[str, str], ...] = ()


def described(
    about: str,
    vocabulary: Axioms,
    own: Axioms,
    *,
    is_individual: bool = False,
    words: Iterable[str] = (),
    place: Iterable[tuple[str, str]] = (),
) -> Description:
    """Return the description of a class or individual by axioms of the vocabulary and of its entry. Raises TooLarge."""
    completion = Completion(vocabulary, own, most=MOST_NODES)
    root = completion.number(One(about) if is_individual else about)
    nodes = completion.nodes
    _spread_ownership(nodes)
    nodes[root].is_own = True
    numbers = {root: 0}
    queue = [root]
    found, stated = [], _Stated(vocabulary)
    for number in queue:
        links: list[tuple[str, int | Label]] = []
        for prop, target in nodes[number].links:
            end: int | Label | None = label_of(nodes[target].concept)
            if nodes[target].is_own or nodes[target].concept not in vocabulary.above or end is None:
                if target not in numbers:
                    numbers[target] = len(numbers)
                    queue.append(target)
                end = numbers[target]
            links += [(one, end) for one in _shown(completion, prop)]
        found.append(Described(_most_specific(nodes[number], stated), tuple(sorted(set(links), key=repr))))
    return Description(tuple(found), tuple(words), tuple(place))


def _shown(completion: Completion, prop: str) -> Iterable[str]:
    """Return the properties of a link that are not known from the vocabulary."""
    above = completion.above(prop)
    found = {prop} if above.isdisjoint(completion.own_properties) else above
    return (one for one in found if " " not in one)  # a part of a chain is no property


def _spread_ownership(nodes: list[Node]) -> None:
    """Mark what is linked to a node that the entry's axioms shaped: it is not the same for every entry either."""
    own = (number for number, node in enumerate(nodes) if node.is_own)
    for number in reached(own, lambda number: (source for _, source in nodes[number].linked_from)):
        nodes[number].is_own = True


def label_of(concept: object) -> Label | None:
    """Return the label of a named class or of an individual; None for any other concept."""
    if isinstance(concept, One):
        return f"{{{concept.individual}}}"
    return concept if isinstance(concept, str) else None


def _most_specific(node: Node, stated: _Stated) -> tuple[Label, ...]:
    """Return the labels of a node without those that the vocabulary states above another of them."""
    kept: list[Label] = []
    implied: set[Label] = {THING}
    for label in map(label_of, node.labels):
        if label is not None and label not in implied:
            above = stated.above(label)
            kept = [one for one in kept if one not in above]
            kept.append(label)
            implied |= above
    return tuple(kept)


def contradiction(description: Description, vocabulary: Axioms, own: Axioms | None = None) -> tuple[str, str] | None:
    """Return two classes that exclude each other and that something in a description would have to be, if there are.

    What cannot be is below everything (owl:Nothing), and so is what has to be linked to such a thing.
    """
    disjoint: dict[str, set[str]] = {}
    for one, other in (pair for known in (vocabulary, own or Axioms()) for pair in known.disjoint):
        disjoint.setdefault(one, set()).add(other)
        disjoint.setdefault(other, set()).add(one)
    stated = _Stated(vocabulary)
    linked = (end for node in description.nodes for _, end in node.links if isinstance(end, str))
    for labels in (*(node.labels for node in description.nodes), *((label,) for label in linked)):
        above = set(labels).union(*map(stated.above, labels))
        for one in sorted(above):
            if others := sorted(disjoint.get(one, set()) & above):
                return one, others[0]
    return None


class _Stated:
    """The labels that the vocabulary states above others, through any number of them."""

    def __init__(self, vocabulary: Axioms) -> None:
        self._vocabulary = vocabulary
        self._known: dict[Label, frozenset[Label]] = {}

    def above(self, label: Label) -> frozenset[Label]:
        """Return the labels above one."""
        if label not in self._known:
            self._known[label] = frozenset(reached((label,), self._directly_above)) - {label}
        return self._known[label]

    def _directly_above(self, label: Label) -> Iterator[Label]:
        concept: Concept = One(label[1:-1]) if label.startswith("{") else label
        return filter(None, map(label_of, self._vocabulary.above.get(concept, ())))
