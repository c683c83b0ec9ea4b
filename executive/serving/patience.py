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
"""Seconds from which on a search needs one of the few places."""
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

    def take(self) -> None:
        """Take a place. Raises Busy if there is none."""
        if not self._free.acquire(blocking=False):
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
        seconds: float = LONGEST,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._lanes, self._is_gone, self._clock = lanes, is_gone, clock
        self._seconds = seconds
        self._began = self._looked = clock()
        self._has_place = False

    def __call__(self) -> None:
        """Let others go first if this takes long. Raises Problem at the limit and for nobody, Busy without a place."""
        now = self._clock()
        if now - self._began < LONG:
            return
        if not self._has_place:
            self._lanes.take()
            self._has_place = True
        if now - self._began > self._seconds:
            detail = f"the search takes more than {self._seconds:g} s: ask for less at once"
            raise Problem(HTTPStatus.SERVICE_UNAVAILABLE, detail)
        self.look()
        time.sleep(BREATH)

    def look(self) -> None:
        """Raise Problem if nobody waits for the answer any more."""
        if self._clock() - self._looked > ASKED_EVERY:
            if self._is_gone():
                raise Problem(HTTPStatus.REQUEST_TIMEOUT, "nobody waits for the answer")
            self._looked = self._clock()

    @contextmanager
    def searching(self) -> Iterator[None]:
        """Begin to count time; give the place back at the end of the block."""
        self._began = self._clock()
        try:
            yield
        finally:
            if self._has_place:
                self._lanes.give_back()
                self._has_place = False
