"""The shortest list of choices that still does it."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence

from planlang.testing.schedules import trimmed

Choices = tuple[int, ...]


def continued(choices: Choices, sizes: Sequence[int]) -> Iterator[Choices]:
    """The lists that go on from one, with one more choice other than zero; ``sizes`` are those of its run.

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
