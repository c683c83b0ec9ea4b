"""Sources of choices for exploration, and a recorder of what any of them chose."""

from __future__ import annotations

from collections.abc import Sequence
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
        """What the source chooses."""
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
        """The task of the highest priority; at a moment of change it becomes the lowest first."""
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
    """Without the zeros at the end, which a list of choices need not say."""
    end = len(choices)
    while end and choices[end - 1] == 0:
        end -= 1
    return tuple(choices[:end])
