"""Schedules, the order of tasks that can run: first come first served, by random numbers, or by a list.

A choice is the place, in order of coming, of the task that runs next. It is asked for only where there is one. Random
numbers come from streams that count their draws, so that a resumed run can bring them to where they were.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import Any

from planlang.kernel.core import ChoiceSource, Task
from planlang.misuse import WrongValue, contrast, whole_number, written

MOST_WORDS = 1_000_000_000
"""Draws that are repeated at most, in about 3 s: more can only stand in a damaged trace."""
_AT_ONCE = 100_000
"""Words drawn by one call: 400 kB."""


class CountedRandom(Random):
    """A stream of random numbers that knows how many words of 32 bits were drawn from its generator.

    All numbers of Python's :class:`random.Random` are made by ``random`` (two words) and ``getrandbits``.
    """

    def __init__(self, seed: str) -> None:
        super().__init__(seed)
        self.moved = 0
        """Another number after whatever has changed the state: words drawn, and seedings by the plan."""
        self._is_counted = True

    def random(self) -> float:
        """Return the next number from [0, 1)."""
        self.moved += 2
        return super().random()

    def getrandbits(self, k: int, /) -> int:
        """Return an integer of ``k`` random bits."""
        self.moved += (k + 31) // 32
        return super().getrandbits(k)

    def seed(self, *arguments: Any, **named: Any) -> None:
        """Begin anew, as a plan may ask for: from then on the count of draws does not tell the state."""
        super().seed(*arguments, **named)
        self._lose_count()

    def setstate(self, state: Any) -> None:
        """Go to a state: from then on the count of draws does not tell it."""
        super().setstate(state)
        self._lose_count()

    def _lose_count(self) -> None:
        self.moved = getattr(self, "moved", 0) + 1
        self._is_counted = False

    @property
    def draws(self) -> Any:
        """Return the position of the stream as JSON: the words drawn, with the second number that ``gauss`` has ready.

        ValueError if that is not known, since the plan has seeded the stream itself.
        """
        if not self._is_counted:
            raise ValueError("a stream of random numbers that was seeded by the plan")
        ready = getattr(self, "gauss_next", None)
        return self.moved if ready is None else [self.moved, ready]

    def go_to(self, draws: Any) -> None:
        """Draw as often as it was drawn before; raises ValueError for what is no such number."""
        words, ready = checked_draws(draws)
        if not self._is_counted or self.moved > words:
            raise ValueError(f"a stream of random numbers cannot go back to {words} draws")
        while self.moved < words:
            self.getrandbits(32 * min(_AT_ONCE, words - self.moved))
        self.gauss_next = ready


Schedule = int | Sequence[int] | ChoiceSource | None
"""None is first come, first served; a number is that stream; a list is taken one by one, then as None."""


def checked_draws(draws: Any) -> tuple[int, float | None]:
    """Return words and ready number from a value of ``CountedRandom.draws``; raises ValueError for what is none."""
    ready: float | None = None
    if isinstance(draws, list) and len(draws) == 2 and isinstance(draws[1], float):
        draws, ready = draws
    if type(draws) is not int or not 0 <= draws <= MOST_WORDS:
        raise ValueError("a stream of random numbers is recorded by the number of its draws")
    return draws, ready


class RandomSchedule:
    """Picks at random, by a stream of numbers of its own."""

    def __init__(self, number: int) -> None:
        self._random = CountedRandom(f"schedule {number}")

    def choose(self, ready: Sequence[Task]) -> int:
        """Return the place of any of them."""
        return self._random.randrange(len(ready))

    def state(self) -> Any:
        """Return how far the stream has come, as JSON."""
        return self._random.draws

    def restore(self, state: Any) -> None:
        """Go on from a state; ValueError for what is none."""
        self._random.go_to(state)


class ListedSchedule:
    """Takes choices from a list, then first come, first served; a choice beyond the last task is the last task."""

    def __init__(self, choices: Sequence[int]) -> None:
        places = [whole_number(choice) for choice in choices]
        self._choices = tuple(place for place in places if place is not None and place >= 0)
        if len(self._choices) < len(places):
            code = written(list(choices))
            message = f"a schedule is a list of places, whole numbers from 0, not {code}"
            raise WrongValue(contrast(message, f"schedule={code}", "schedule=[0, 2, 1]"))
        self._taken = 0

    def choose(self, ready: Sequence[Task]) -> int:
        """Return the next of the list."""
        choice = self._choices[self._taken] if self._taken < len(self._choices) else 0
        self._taken += 1
        return min(choice, len(ready) - 1)

    def state(self) -> Any:
        """Return how many choices were taken."""
        return self._taken

    def restore(self, state: Any) -> None:
        """Go on after so many choices; ValueError for what is no number of them."""
        if type(state) is not int or state < 0:
            raise ValueError("a state is a number of choices")
        self._taken = state


def source_of(schedule: Schedule) -> ChoiceSource | None:
    """Return what picks, or None for first come, first served."""
    if schedule is None or hasattr(schedule, "choose"):
        return schedule
    if isinstance(schedule, int):
        return RandomSchedule(schedule)
    return ListedSchedule(schedule)


def described(schedule: Schedule) -> object:
    """Return what the header of a trace says about the schedule: enough to repeat it, unless it is the user's own."""
    return str(schedule) if hasattr(schedule, "choose") else schedule
