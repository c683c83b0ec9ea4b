"""Part of the planning scene: it answers for what is believed."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from typing import Generic, TypeVar

from executive.belief.belief import Belief
from sim import PlanningWorld, WorldMirror

T = TypeVar("T")
Part = TypeVar("Part", bound="ScenePart")

MOST_KEPT = 4
"""Contents for which a value is kept: of what is believed, and of the last hypotheses about it."""


class Kept(Generic[T]):
    """Cache of values by the content from which they were computed: those of the last few contents."""

    def __init__(self, most: int = MOST_KEPT) -> None:
        self._most = most
        self._known: list[tuple[object, T]] = []

    def of(self, content: object, compute: Callable[[], T]) -> T:
        """Look up the value for a content, or compute and keep it."""
        for number, (known, value) in enumerate(self._known):
            if known == content:
                if number:
                    self._known.insert(0, self._known.pop(number))
                return value
        value = compute()
        self._known[:] = [(content, value), *self._known[: self._most - 1]]
        return value


class ScenePart:
    """Answers from a belief, and from a planning world that mirrors it."""

    def __init__(self, mirror: WorldMirror, belief: Belief) -> None:
        self._mirror, self._belief = mirror, belief

    @property
    def _world(self) -> PlanningWorld:
        """The planning world as it is believed now."""
        return self._mirror.at(self._belief.state)

    def supposing(self: Part, belief: Belief) -> Part:
        """Make the same part for another belief; it shares the caches, whose keys are what they were computed from."""
        other = copy(self)
        other._belief = belief
        return other
