"""Turns at what takes long to compute: checks of uploads, conversions, comparisons with robots.

Python computes one thing at a time: the more of these share its time, the longer everybody waits who only reads.
"""

from __future__ import annotations

import threading
from types import TracebackType

AT_A_TIME = 2
PATIENCE = 30.0
"""Seconds that a request waits for its turn."""
MOST_THREADS = 200
"""Requests that are worked on at a time, those among them that wait for their turn."""


class Busy(Exception):
    """Too many others wait for their turn."""


class Turns:
    """A number of turns that are taken at a time, each by ``with``, which raises Busy if none comes."""

    def __init__(self, number: int, patience: float) -> None:
        """``patience``: how long a turn is waited for [s]."""
        self._free = threading.Semaphore(number)
        self._patience = patience

    def __enter__(self) -> None:
        if not self._free.acquire(timeout=self._patience):
            raise Busy("too much is being checked at the moment; try again later")

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, where: TracebackType | None
    ) -> None:
        self._free.release()


TURNS = Turns(AT_A_TIME, PATIENCE)
