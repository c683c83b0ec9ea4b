"""Where the order of tasks that can run comes from: first come first served, a stream of numbers, or a list.

A choice is the place, in order of coming, of the task that runs next. It is asked for only where there is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from random import Random
from typing import TYPE_CHECKING, Any, Protocol

from planlang.kernel.numbers import packed, unpacked
from planlang.misuse import WrongValue, contrast, whole_number, written

if TYPE_CHECKING:
    from planlang.kernel.task import Task


class ChoiceSource(Protocol):
    """Picks among tasks that can run; its text is what the trace's header says of it."""

    def choose(self, ready: Sequence[Task]) -> int:
        """The place in ``ready``, two or more tasks in order of coming, of the one that runs next."""


Schedule = int | Sequence[int] | ChoiceSource | None
"""None is first come, first served; a number is that stream; a list is taken one by one, then as None."""


class Stream:
    """Picks at random, by a stream of numbers of its own."""

    def __init__(self, number: int) -> None:
        self._random = Random(f"schedule {number}")

    def choose(self, ready: Sequence[Task]) -> int:
        """Any of them."""
        return self._random.randrange(len(ready))

    def state(self) -> Any:
        """How far the stream has come, as JSON."""
        return packed(self._random)

    def restore(self, state: Any) -> None:
        """Go on from a state; ValueError for what is none."""
        self._random.setstate(unpacked(state))


class Recorded:
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
        """The next of the list."""
        choice = self._choices[self._taken] if self._taken < len(self._choices) else 0
        self._taken += 1
        return min(choice, len(ready) - 1)

    def state(self) -> Any:
        """How many choices were taken."""
        return self._taken

    def restore(self, state: Any) -> None:
        """Go on after so many choices; ValueError for what is no number of them."""
        if type(state) is not int or state < 0:
            raise ValueError("a state is a number of choices")
        self._taken = state


def source_of(schedule: Schedule) -> ChoiceSource | None:
    """What picks, or None for first come, first served."""
    if schedule is None or hasattr(schedule, "choose"):
        return schedule
    if isinstance(schedule, int):
        return Stream(schedule)
    return Recorded(schedule)


def described(schedule: Schedule) -> object:
    """What the header of a trace says about the schedule: enough to repeat it, unless it is somebody else's source."""
    return str(schedule) if hasattr(schedule, "choose") else schedule
