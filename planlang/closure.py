"""What is reached from some nodes of a graph that nobody has written down."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


def reached(starts: Iterable[T], following: Callable[[T], Iterable[T]]) -> Iterator[T]:
    """Yield nodes and everything that ``following`` leads to from them: breadth first, each once, the starts first.

    A node is followed only when the one after it is asked for, so that a search can end early.
    """
    found = dict.fromkeys(starts)
    waiting = list(found)
    for node in waiting:  # grows while it is walked
        yield node
        new = dict.fromkeys(other for other in following(node) if other not in found)
        found |= new
        waiting += new
