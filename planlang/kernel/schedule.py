"""Schedules, which order the tasks that can run: first come, first served, or random choices, or a list of choices.

A choice is the index, in order of arrival, of the task to run next; it is made only between two or more tasks. Random
numbers come from streams that count their draws, so that a resumed run can restore their positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Any

from planlang.kernel.core import ChoiceSource, Task
from planlang.misuse import WrongValue, contrast, whole_number, written

MAX_WORDS = 1_000_000_000
"""Maximum number of draws to repeat, in about 3 s: larger numbers occur only in damaged traces."""
_WORDS_PER_CALL = 100_000
"""Words per call of ``getrandbits``: 400 kB."""


class CountedRandom(Random):
    """Stream of random numbers that counts the words of 32 bits drawn from its generator.

    All methods of Python's :class:`random.Random` draw through ``random`` (two words) and ``getrandbits``.
    """

    def __init__(self, seed: str) -> None:
        super().__init__(seed)
        self.moved = 0
        """Words drawn, plus one for each seeding by the plan, so that it changes whenever the state may have."""
        self._is_counted = True

    def random(self) -> float:
        """Draw a number from [0, 1)."""
        self.moved += 2
        return super().random()

    def getrandbits(self, k: int, /) -> int:
        """Draw an integer of ``k`` bits."""
        self.moved += (k + 31) // 32
        return super().getrandbits(k)

    def seed(self, *arguments: Any, **named: Any) -> None:
        """Seed the stream again; its position is no longer given by the number of draws."""
        super().seed(*arguments, **named)
        self._lose_count()

    def setstate(self, state: Any) -> None:
        """Set the state; the position is no longer given by the number of draws."""
        super().setstate(state)
        self._lose_count()

    def _lose_count(self) -> None:
        self.moved = getattr(self, "moved", 0) + 1
        self._is_counted = False

    @property
    def draws(self) -> Any:
        """Position of the stream as JSON: the words drawn, with the second number that ``gauss`` holds ready, if any.

        ValueError if the plan has seeded the stream itself.
        """
        if not self._is_counted:
            raise ValueError("a stream of random numbers that was seeded by the plan")
        gauss_next = getattr(self, "gauss_next", None)
        return self.moved if gauss_next is None else [self.moved, gauss_next]

    def go_to(self, draws: Any) -> None:
        """Advance the stream to a position of :attr:`draws`; ValueError if it is malformed or already passed."""
        words, gauss_next = parse_draws(draws)
        if not self._is_counted or self.moved > words:
            raise ValueError(f"a stream of random numbers cannot go back to {words} draws")
        while self.moved < words:
            self.getrandbits(32 * min(_WORDS_PER_CALL, words - self.moved))
        self.gauss_next = gauss_next


Schedule = int | Sequence[int] | ChoiceSource | None
"""None is first come, first served; an integer seeds random choices; a list of choices is followed to its end."""


def parse_draws(draws: Any) -> tuple[int, float | None]:
    """Read words drawn and ``gauss_next`` from a value of ``CountedRandom.draws``; ValueError if malformed."""
    gauss_next: float | None = None
    if isinstance(draws, list) and len(draws) == 2 and isinstance(draws[1], float):
        draws, gauss_next = draws
    if type(draws) is not int or not 0 <= draws <= MAX_WORDS:
        raise ValueError("the position of a stream of random numbers must be a number of draws")
    return draws, gauss_next


class RandomSchedule:
    """Chooses at random, from a stream of its own."""

    def __init__(self, number: int) -> None:
        self._random = CountedRandom(f"schedule {number}")

    def choose(self, ready: Sequence[Task]) -> int:
        """Choose any of the tasks, with equal probability."""
        return self._random.randrange(len(ready))

    def state(self) -> Any:
        """Position of the stream, as JSON."""
        return self._random.draws

    def restore(self, state: Any) -> None:
        """Continue from a state; ValueError if it is malformed."""
        self._random.go_to(state)


class ListedSchedule:
    """Follows a list of choices, then first come, first served; a choice beyond the last task means the last task."""

    def __init__(self, choices: Sequence[int]) -> None:
        indices = [whole_number(choice) for choice in choices]
        self._choices = tuple(index for index in indices if index is not None and index >= 0)
        if len(self._choices) < len(indices):
            code = written(list(choices))
            message = f"a schedule is a list of indices, whole numbers from 0, not {code}"
            raise WrongValue(contrast(message, f"schedule={code}", "schedule=[0, 2, 1]"))
        self._used = 0

    def choose(self, ready: Sequence[Task]) -> int:
        """Choose the next index of the list."""
        choice = self._choices[self._used] if self._used < len(self._choices) else 0
        self._used += 1
        return min(choice, len(ready) - 1)

    def state(self) -> Any:
        """Number of choices made."""
        return self._used

    def restore(self, state: Any) -> None:
        """Continue after a number of choices; ValueError if it is not one."""
        if type(state) is not int or state < 0:
            raise ValueError("the state of a schedule must be its number of choices")
        self._used = state


def source_of(schedule: Schedule) -> ChoiceSource | None:
    """Make the source of choices for a schedule; None for first come, first served."""
    if schedule is None or hasattr(schedule, "choose"):
        return schedule
    if isinstance(schedule, int):
        return RandomSchedule(schedule)
    return ListedSchedule(schedule)


def described(schedule: Schedule) -> object:
    """Describe a schedule in the header of a trace, so that it can be repeated unless its class is the user's."""
    return str(schedule) if hasattr(schedule, "choose") else schedule
