"""Limits of searches: long ones run a few at a time, and end at a time limit or when the client has gone.

An ordinary search takes milliseconds and meets none of these limits.
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
"""Time limit of a search [s]."""
LONG = 0.02
"""CPU time after which a search counts as long and needs a lane [s]."""
AT_A_TIME = 2
"""Number of lanes: long searches that run concurrently."""
BREATH = 0.001
"""Pause between two steps of a long search, in which other threads get the interpreter lock [s]."""
ASKED_EVERY = 0.1
"""Time between two checks whether the client is still connected [s]."""


class Lanes:
    """Semaphore that limits the number of concurrent long searches."""

    def __init__(self, number: int = AT_A_TIME) -> None:
        self._free = threading.Semaphore(number)

    def take(self, seconds: float) -> None:
        """Acquire a lane. Raises Busy if none becomes free within ``seconds``."""
        if not self._free.acquire(timeout=max(0.0, seconds)):
            raise Busy(1, "asked")

    def give_back(self) -> None:
        """Release the lane."""
        self._free.release()


class Patience:
    """Limits of one search, which calls this object between any two of its steps."""

    def __init__(
        self,
        lanes: Lanes,
        is_gone: Callable[[], bool],
        clock: Callable[[], float] = time.monotonic,
        spent: Callable[[], float] = time.thread_time,
    ) -> None:
        """Set up the limits; ``is_gone`` is True without a client, ``spent`` is the CPU time of this thread [s]."""
        self._lanes, self._is_gone, self._clock, self._spent = lanes, is_gone, clock, spent
        self._began = self._looked = clock()
        self._spent_before = 0.0
        self._has_lane = False

    def __call__(self) -> None:
        """Yield to other threads in a long search. Raises Problem at the limit or without a client; Busy for a lane."""
        if self._spent() - self._spent_before < LONG:
            return
        if not self._has_lane:
            self._lanes.take(self._left())
            self._has_lane = True
        if self._left() < 0:
            detail = f"the search takes more than {LONGEST:g} s; use a simpler expression"
            raise Problem(HTTPStatus.SERVICE_UNAVAILABLE, detail)
        self.look()
        time.sleep(BREATH)

    def _left(self) -> float:
        return self._began + LONGEST - self._clock()

    def look(self) -> None:
        """Check that the client is still connected. Raises Problem if it is not."""
        if self._clock() - self._looked > ASKED_EVERY:
            if self._is_gone():
                raise Problem(HTTPStatus.REQUEST_TIMEOUT, "the client has closed the connection")
            self._looked = self._clock()

    @contextmanager
    def searching(self) -> Iterator[None]:
        """Start the clocks; at the end of the block, release the lane."""
        self._began, self._spent_before = self._clock(), self._spent()
        try:
            yield
        finally:
            if self._has_lane:
                self._lanes.give_back()
                self._has_lane = False
