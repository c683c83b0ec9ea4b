"""Work in processes of its own, a bounded number at a time: checks of uploads, conversions, comparisons with robots.

Each call has limits of time and memory at which the worker is ended, and a place in a queue: first come, first served.
Who would wait for long is told at once when to come back.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import cached_property
from pathlib import Path
from typing import TypeVar, cast

from executive.processes.calls import Ending, Limits
from executive.processes.workers import ATTEMPTS, Source, Worker
from executive.serving.vocabulary import Vocabulary, read_vocabulary
from planlang.diagnostics import BadInput, Diagnostic, error

T = TypeVar("T")


LIMITS = Limits()
"""Limits of one call."""
AT_A_TIME = 2
"""Checks, and likewise calls on behalf of readers, that are computed at a time."""
LONGEST_WAIT = 2.0
"""Seconds that a call may be expected to wait for its turn; nobody waits more than twice as long."""
USUAL = 0.05
"""Seconds that a call is expected to take before any has been done."""
PREPARE = "executive.serving.worker:prepared"
"""What the workers of a server are forked from has read the vocabulary."""
MOST_WAITING = 100
"""Calls that wait for their turn."""


class Busy(Exception):
    """The refusal of a call while so many wait for their turn; ``seconds`` says after how long to come back."""

    def __init__(self, seconds: float, what: str = "checked") -> None:
        super().__init__(f"too much is being {what} at the moment; try again later")
        self.seconds = max(1, math.ceil(seconds))


class Failed(Exception):
    """The failure of a worker that came upon a mistake in planlang, or ended with it; the text says which."""


class Workers:
    """Some workers of one source, and the queue of those who need them. Threads may share it."""

    def __init__(self, source: Source, number: int, limits: Limits, longest_wait: float = LONGEST_WAIT) -> None:
        """Refuse whoever is expected to wait longer than ``longest_wait`` [s]."""
        self._number, self._limits, self._longest = number, limits, longest_wait
        self._lock = threading.Lock()
        self._free = [Worker(source, limits) for _ in range(number)]
        self._waiting: deque[Future[Worker]] = deque()
        self._usual = USUAL

    @property
    def are_free(self) -> bool:
        """Whether a call would be done at once."""
        return bool(self._free)

    @property
    def waiting(self) -> int:
        """The number of calls that wait for their turn."""
        return len(self._waiting)

    def call(self, function: Callable[..., T], *arguments: object) -> T:
        """Return what a module's function returns for some arguments with, behind them, the vocabulary.

        Raises Busy; BadInput as the function does, or with K015 if it takes more than its limits; Failed.
        """
        worker, began = self._turn(), time.monotonic()
        try:
            reply = worker.call(function, *arguments)
        finally:
            self._give_back(worker, time.monotonic() - began)
        match reply.ending:
            case Ending.DONE:
                return cast(T, reply.answer)
            case Ending.REFUSED:
                raise BadInput(reply.answer)
            case Ending.FAILED:
                raise Failed(str(reply.answer))
            case Ending.LOST:
                raise Failed(f"{ATTEMPTS} workers ended at {function.__name__}")
        raise BadInput([_beyond(self._limits, is_late=reply.ending is Ending.LATE)])

    def _turn(self) -> Worker:
        with self._lock:
            if self._free:
                return self._free.pop()
            expected = (len(self._waiting) + 1) * self._usual / self._number
            if expected > self._longest or len(self._waiting) >= MOST_WAITING:
                raise Busy(expected)
            place: Future[Worker] = Future()
            self._waiting.append(place)
        try:
            return place.result(None if self._longest == math.inf else 2 * self._longest)
        except TimeoutError:
            with self._lock:
                if place in self._waiting:
                    self._waiting.remove(place)
                    raise Busy(self._longest) from None
            return place.result()

    def _give_back(self, worker: Worker, seconds: float) -> None:
        with self._lock:
            self._usual += (seconds - self._usual) / 10
            if self._waiting:
                self._waiting.popleft().set_result(worker)
            else:
                self._free.append(worker)

    def close(self) -> None:
        """Let workers end that are not at work."""
        with self._lock:
            for worker in self._free:
                worker.close()


def nothing(_: object) -> None:
    """Do nothing: a worker that has done it is there."""


def _beyond(limits: Limits, *, is_late: bool) -> Diagnostic:
    limit = f"{limits.seconds} s" if is_late else f"{limits.memory / 1e6:g} MB of memory"
    advice = "hand it in in smaller parts"
    if is_late:
        advice += ", or ask the operator for more: planlang serve --check-seconds"
    return error("K015", f"to check this takes more than {limit}", help=advice)


class Staff:
    """The workers of a server: who check, who let somebody read, one for questions, and one for what can wait."""

    def __init__(self, folders: Sequence[Path] = (), limits: Limits = LIMITS) -> None:
        """Employ workers who read the vocabulary in ``folders``, beside the bundled one."""
        self._folders = tuple(folders)
        self._source = Source(PREPARE, *map(str, folders))
        self.checking = Workers(self._source, AT_A_TIME, limits)
        self.reading = Workers(self._source, AT_A_TIME, limits)
        self.asking = Workers(self._source, 1, limits)
        self.behind = Workers(self._source, 1, limits, math.inf)

    @cached_property
    def vocabulary(self) -> Vocabulary:
        """The vocabulary that its workers know."""
        return read_vocabulary(self._folders)

    def start(self) -> None:
        """Let the process be started that workers are forked from."""
        self._source.start()

    def wait(self) -> None:
        """Wait until a check would begin at once."""
        self.behind.call(nothing)

    def close(self) -> None:
        """End all workers."""
        for some in (self.checking, self.reading, self.asking, self.behind):
            some.close()
        self._source.close()
