"""Descriptions of entries for the search: classes, links, words and place.

A store keeps a description beside the content of an entry, and the index is built from them. It holds what the entry
adds to the vocabulary, and refers to the vocabulary by name for everything else.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planlang.closure import reached
from planlang.knowledge.axioms import THING, Axioms, Concept, One
from planlang.knowledge.completion import Completion, Node
from planlang.records import dataclass

MOST_NODES = 20_000
"""Limit for the nodes in the completion of one entry."""

Label = str
"""A named class, or ``{IRI}``: the class of one individual."""


@dataclass(frozen=True, slots=True)
class Described:
    """A node: its most specific labels, and its links (property, index of a node or label of the vocabulary)."""

    labels: tuple[Label, ...]
    links: tuple[tuple[str, int | Label], ...] = ()


@dataclass(frozen=True, slots=True)
class Description:
    """The description of an entry. ``nodes[0]`` is the described class or individual.

    ``words`` are labels and names for the text search; ``place`` has the values of ``room``, ``floor``, ``building``,
    ``street`` and ``city`` in a map.
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
    """Describe a class or individual by the axioms of the vocabulary and of its entry. Raises TooLarge."""
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
    """Properties to record for a link: with its superproperties if the vocabulary alone does not imply them."""
    above = completion.above(prop)
    found = {prop} if above.isdisjoint(completion.own_properties) else above
    return (one for one in found if " " not in one)  # a name for part of a chain is not a property


def _spread_ownership(nodes: list[Node]) -> None:
    """Mark nodes that link to an own node as own too: they are not the same for every entry either."""
    own = (number for number, node in enumerate(nodes) if node.is_own)
    for number in reached(own, lambda number: (source for _, source in nodes[number].linked_from)):
        nodes[number].is_own = True


def label_of(concept: object) -> Label | None:
    """Label of a named class or an individual; None for any other concept."""
    if isinstance(concept, One):
        return f"{{{concept.individual}}}"
    return concept if isinstance(concept, str) else None


def _most_specific(node: Node, stated: _Stated) -> tuple[Label, ...]:
    """Labels of a node, without superclasses that the vocabulary implies."""
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
    """Find two disjoint classes that a node of the description would have to belong to; None if there are none.

    An unsatisfiable concept is a subclass of everything (owl:Nothing), and so is one that must link to it.
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
    """Transitive superclasses in the vocabulary."""

    def __init__(self, vocabulary: Axioms) -> None:
        self._vocabulary = vocabulary
        self._known: dict[Label, frozenset[Label]] = {}

    def above(self, label: Label) -> frozenset[Label]:
        """Return the labels of all superclasses."""
        if label not in self._known:
            self._known[label] = frozenset(reached((label,), self._directly_above)) - {label}
        return self._known[label]

    def _directly_above(self, label: Label) -> Iterator[Label]:
        concept: Concept = One(label[1:-1]) if label.startswith("{") else label
        return filter(None, map(label_of, self._vocabulary.above.get(concept, ())))
