"""Answers that are kept as long as nothing they depend on has changed."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from typing import Generic, TypeVar

from planlang.failures import PlanFailure

T = TypeVar("T")

MOST = 32
"""Questions whose answers are kept."""


class _Kept(Generic[T]):
    """A lazy series of answers that can be read again from its beginning, with the failure that ended it.

    Interrupted while it is being found, it is found anew: the same answers come out.
    """

    def __init__(self, ask: Callable[[], Iterator[T]]) -> None:
        self._ask = ask
        self._source: Iterator[T] | None = None
        self._found: list[T] = []
        self._end: PlanFailure | None = None

    def __iter__(self) -> Iterator[T]:
        number = 0
        while True:
            while number >= len(self._found) and self._end is None:
                if not self._more():
                    return
            if number >= len(self._found):
                assert self._end is not None
                raise self._end.with_traceback(None)
            yield self._found[number]
            number += 1

    def _more(self) -> bool:
        """Find one more; False if there are no more."""
        if self._source is None:
            self._found, self._source = [], self._ask()
        try:
            self._found.append(next(self._source))
        except StopIteration:
            return False
        except PlanFailure as problem:
            self._end = problem
        except BaseException:
            self._source = None
            raise
        return True


class Answers(Generic[T]):
    """Question -> answers, forgotten when the state in which they were found is no longer the present one."""

    def __init__(self) -> None:
        self._state: object = None
        self._kept: dict[Hashable, _Kept[T]] = {}

    def of(self, question: Hashable, state: object, ask: Callable[[], Iterator[T]]) -> Iterator[T]:
        """The answers to a question in a state, found by ``ask`` if they are not known."""
        if state != self._state:
            self._state, self._kept = state, {}
        if question not in self._kept:
            while len(self._kept) >= MOST:
                del self._kept[next(iter(self._kept))]
            self._kept[question] = _Kept(ask)
        return iter(self._kept[question])
