"""Bounds of a search: what takes long is ended at a limit, or when the asker is gone, and is done a few at a time.

A search of the usual kind takes milliseconds and meets none of this.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus

from executive.serving.problems import Problem
from executive.serving.workers import Busy

LONGEST = 5.0
"""Seconds after which a search is ended."""
LONG = 0.02
"""Seconds of CPU from which on a search needs one of the few places."""
AT_A_TIME = 2
"""Long searches that go on at a time."""
BREATH = 0.001
"""Seconds that a long search lets others go first between two of its steps."""
ASKED_EVERY = 0.1
"""Seconds between two looks whether the asker is still there."""


class Lanes:
    """The places for long searches."""

    def __init__(self, number: int = AT_A_TIME) -> None:
        self._free = threading.Semaphore(number)

    def take(self, seconds: float) -> None:
        """Take a place. Raises Busy if none is free within some seconds."""
        if not self._free.acquire(timeout=max(0.0, seconds)):
            raise Busy(1, "asked")

    def give_back(self) -> None:
        """Let somebody else have the place."""
        self._free.release()


class Patience:
    """The bounds of one search, which asks them by a call between any two of its steps."""

    def __init__(
        self,
        lanes: Lanes,
        is_gone: Callable[[], bool],
        clock: Callable[[], float] = time.monotonic,
        spent: Callable[[], float] = time.thread_time,
    ) -> None:
        """``is_gone`` tells whether nobody waits any more; ``spent`` is the CPU time of this thread [s]."""
        self._lanes, self._is_gone, self._clock, self._spent = lanes, is_gone, clock, spent
        self._began = self._looked = clock()
        self._spent_before = 0.0
        self._has_place = False

    def __call__(self) -> None:
        """Let others go first if this takes long. Raises Problem at the limit and for nobody, Busy without a place."""
        if self._spent() - self._spent_before < LONG:
            return
        if not self._has_place:
            self._lanes.take(self._left())
            self._has_place = True
        if self._left() < 0:
            detail = f"the search takes more than {LONGEST:g} s: ask for less at once"
            raise Problem(HTTPStatus.SERVICE_UNAVAILABLE, detail)
        self.look()
        time.sleep(BREATH)

    def _left(self) -> float:
        return self._began + LONGEST - self._clock()

    def look(self) -> None:
        """Raise Problem if nobody waits for the answer any more."""
        if self._clock() - self._looked > ASKED_EVERY:
            if self._is_gone():
                raise Problem(HTTPStatus.REQUEST_TIMEOUT, "nobody waits for the answer")
            self._looked = self._clock()

    @contextmanager
    def searching(self) -> Iterator[None]:
        """Begin to count time; give the place back at the end of the block."""
        self._began, self._spent_before = self._clock(), self._spent()
        try:
            yield
        finally:
            if self._has_place:
                self._lanes.give_back()
                self._has_place = False
