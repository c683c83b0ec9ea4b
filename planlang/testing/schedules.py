"""Sources of choices for exploration, and a recorder of what any of them chose."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from random import Random
from typing import TYPE_CHECKING

from planlang.kernel.core import ChoiceSource

if TYPE_CHECKING:
    from planlang.kernel import Task


class Recorder:
    """Passes choices on, first come first served without a source, and keeps them with what there was to choose."""

    def __init__(self, source: ChoiceSource | None = None) -> None:
        self._source = source
        self.choices: list[int] = []
        self.sizes: list[int] = []
        """Of how many tasks each choice was."""

    def choose(self, ready: Sequence[Task]) -> int:
        """Return what the source chooses, and keep it."""
        choice = 0 if self._source is None else self._source.choose(ready)
        self.choices.append(choice)
        self.sizes.append(len(ready))
        return choice

    def __str__(self) -> str:
        return "first come, first served" if self._source is None else str(self._source)


class Priorities:
    """Probabilistic concurrency testing: tasks have random priorities, which change at a few random moments.

    Where ``depth`` steps must come in a certain order for something to happen, one such schedule finds it with a
    probability of at least 1 / (tasks * length ** (depth - 1)) (Burckhardt et al., ASPLOS 2010). ``length`` is how
    many choices a run is expected to have.
    """

    def __init__(self, number: int, length: int, depth: int = 3) -> None:
        self._number = number
        self._random = Random(f"priorities {number}")
        self._priorities: dict[Task, float] = {}
        self._changes = {self._random.randrange(max(1, length)) for _ in range(depth - 1)}
        self._asked = 0
        self._lowest = 0.0

    def choose(self, ready: Sequence[Task]) -> int:
        """Choose the task of the highest priority; at a moment of change it becomes the lowest first."""
        priorities = self._priorities
        for task in ready:
            if task not in priorities:
                priorities[task] = self._random.random()
        best = self._best(ready)
        if self._asked in self._changes:
            self._lowest -= 1.0
            priorities[ready[best]] = self._lowest
            best = self._best(ready)
        self._asked += 1
        return best

    def _best(self, ready: Sequence[Task]) -> int:
        return max(range(len(ready)), key=lambda place: self._priorities[ready[place]])

    def __str__(self) -> str:
        return f"priorities {self._number}"


def trimmed(choices: Sequence[int]) -> tuple[int, ...]:
    """Return choices without the zeros at the end, which are implied."""
    end = len(choices)
    while end and choices[end - 1] == 0:
        end -= 1
    return tuple(choices[:end])


Choices = tuple[int, ...]


def continued(choices: Choices, sizes: Sequence[int]) -> Iterator[Choices]:
    """Yield the lists that go on from one, with one more choice other than zero; ``sizes`` are those of its run.

    Every list without zeros at its end comes from exactly one other, so that all are met once, beginning with ().
    """
    for place in range(len(choices), len(sizes)):
        for choice in range(1, sizes[place]):
            yield (*choices, *(0,) * (place - len(choices)), choice)


class Shrinker:
    """Looks for the shortest list, of the shortest the smallest, for which ``breaks`` holds.

    ``breaks`` runs the plan with a list and returns whether it still does it, and of how many tasks each choice of
    that run was. At most ``runs`` runs are made; ``proven`` says whether all shorter lists were tried.
    """

    def __init__(self, breaks: Callable[[Choices], tuple[bool, Sequence[int]]], runs: int) -> None:
        self._breaks = breaks
        self.left = runs
        self.proven = False
        self._known: dict[Choices, tuple[bool, Sequence[int]]] = {}

    def shrink(self, choices: Sequence[int]) -> Choices:
        """From a list that breaks to the best one found."""
        best = trimmed(choices)
        while self.left > 0:
            better = self._once(best)
            if better == best:
                break
            best = better
        return self._search(best)

    def _run(self, choices: Choices) -> tuple[bool, Sequence[int]]:
        if choices not in self._known:
            if self.left <= 0:
                return False, ()
            self.left -= 1
            self._known[choices] = self._breaks(choices)
        return self._known[choices]

    def _once(self, best: Choices) -> Choices:
        """One pass: leave out pieces, large ones first, then set choices to zero, then lower them."""
        size = max(1, len(best) // 2)
        while True:
            place = 0
            while place < len(best):
                best, changed = self._better(best, (*best[:place], *best[place + size :]))
                place += 0 if changed else size
            if size == 1:
                break
            size //= 2
        for place in range(len(best)):
            if place < len(best) and best[place]:
                best, changed = self._better(best, (*best[:place], 0, *best[place + 1 :]))
                for lower in range(1, best[place] if not changed and place < len(best) else 0):
                    best, changed = self._better(best, (*best[:place], lower, *best[place + 1 :]))
                    if changed:
                        break
        return best

    def _better(self, best: Choices, other: Choices) -> tuple[Choices, bool]:
        other = trimmed(other)
        if (len(other), other) < (len(best), best) and self._run(other)[0]:
            return other, True
        return best, False

    def _search(self, best: Choices) -> Choices:
        """Try all lists that come before the best one, shortest first, as long as there are runs left."""
        queue: list[tuple[int, Choices]] = [(0, ())]
        while queue:
            length, choices = heapq.heappop(queue)
            if (length, choices) >= (len(best), best):
                self.proven = True
                return best
            if self.left <= 0 and choices not in self._known:
                return best
            broken, sizes = self._run(choices)
            if broken:
                self.proven = True
                return choices
            for longer in continued(choices, sizes[: len(best)]):
                heapq.heappush(queue, (len(longer), longer))
        self.proven = True
        return best
