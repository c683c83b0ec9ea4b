"""Relations: grouping of their pairs, breadth-first search along them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TypeVar

K = TypeVar("K")
T = TypeVar("T")


def grouped(pairs: Iterable[tuple[K, T]]) -> dict[K, list[T]]:
    """Collect the second parts of pairs under their first, both in the order of the pairs."""
    groups: dict[K, list[T]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def reached(starts: Iterable[T], following: Callable[[T], Iterable[T]]) -> Iterator[T]:
    """Yield ``starts`` and every node reachable from them by ``following``, breadth first, each once.

    A node is expanded only when the next one is requested, so that a search can end early.
    """
    found = dict.fromkeys(starts)
    waiting = list(found)
    for node in waiting:  # grows while it is walked
        yield node
        new = dict.fromkeys(other for other in following(node) if other not in found)
        found |= new
        waiting += new


def leads_to(follows: Mapping[T, Iterable[T]], start: T, goal: T) -> bool:
    """Check whether a path leads from one node to another, or whether they are the same."""
    return goal in reached((start,), lambda node: follows.get(node, ()))
