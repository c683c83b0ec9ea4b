"""The hierarchy of classes: what is above and below a class, nearest first, in the order of the documents."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence


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
    reached = {start: None}
    queue: list[str] = [start]
    none: Sequence[str] = ()
    for node in queue:  # grows while it is walked
        for neighbour in neighbours.get(node, none):
            if neighbour not in reached:
                reached[neighbour] = None
                queue.append(neighbour)
    return tuple(queue)
