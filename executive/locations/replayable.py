"""Series of answers that are found lazily, and can be asked for again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
from typing import Generic, TypeVar

from planlang.failures import PlanFailure

T = TypeVar("T")


class Replayable(Generic[T]):
    """Lazy series of answers that can be iterated again, with the failure that ended it.

    If the search is interrupted, the next iteration starts it again and yields the same answers.
    """

    def __init__(self, ask: Callable[[], Iterator[T]]) -> None:
        self._ask = ask
        self._source: Iterator[T] | None = None
        self._found: list[T] = []
        self._end: PlanFailure | None = None

    def __iter__(self) -> Iterator[T]:
        for number in count():
            while number >= len(self._found):
                if not self._more():
                    return
            yield self._found[number]

    def _more(self) -> bool:
        """Find one more answer; False if there are none."""
        if self._end is not None:
            raise self._end.with_traceback(None)
        if self._source is None:
            self._found, self._source = [], self._ask()
        try:
            self._found.append(next(self._source))
        except StopIteration:
            return False
        except PlanFailure as problem:
            self._end = problem
            raise
        except BaseException:
            self._source = None
            raise
        return True
