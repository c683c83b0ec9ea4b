"""Pools of worker processes for checks of uploads, conversions and comparisons with robots.

Workers parse untrusted contents, isolated from the server's own process. Each call has limits of time and memory, at
which its worker is killed. Calls wait in a first-in-first-out queue; a call that would have to wait for long is refused
at once, with the time after which to try again.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

from executive.processes.workers import Ending, Limits, Performs, Source, Worker
from executive.serving.uploads import as_here, warm_up
from executive.serving.vocabulary import Vocabulary, read_vocabulary
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.words import Option, Text

T = TypeVar("T")


LIMITS = Limits()
"""Limits of one call."""
AT_A_TIME = 2
"""Number of workers that check uploads, and of those that serve readers."""
LONGEST_WAIT = 2.0
"""Longest expected wait in the queue [s]; the actual wait is limited to twice this time."""
USUAL = 0.05
"""Initial estimate of the duration of a call [s]."""
PREPARE = "executive.serving.workers:prepared"
"""Function that reads the vocabulary in the process that workers are forked from."""
MOST_WAITING = 100
"""Longest queue."""


class Busy(Exception):
    """A call was refused because the queue is too long; try again after ``seconds``."""

    def __init__(self, seconds: float, what: str = "checked") -> None:
        super().__init__(f"too much is being {what} at the moment; try again later")
        self.seconds = max(1, math.ceil(seconds))


class Failed(Exception):
    """A worker raised an unexpected exception or died (an error in planlang); the text has the reason."""


class Workers:
    """Pool of worker processes with a queue. Thread-safe."""

    def __init__(self, source: Source, number: int, limits: Limits, longest_wait: float = LONGEST_WAIT) -> None:
        """Set up ``number`` workers; calls with an expected wait above ``longest_wait`` [s] are refused."""
        self._number, self._limits, self._longest = number, limits, longest_wait
        self._lock = threading.Lock()
        self._free = [Worker(source, limits) for _ in range(number)]
        self._waiting: deque[Future[Worker]] = deque()
        self._usual = USUAL

    @property
    def are_free(self) -> bool:
        """Whether a worker is idle."""
        return bool(self._free)

    @property
    def waiting(self) -> int:
        """Number of calls in the queue."""
        return len(self._waiting)

    def call(self, function: Callable[..., T], *arguments: object) -> T:
        """Run a module-level function in a worker, with the vocabulary as an additional last argument.

        Raises Busy; BadInput as the function does, or with K015 if it exceeds its limits; Failed.
        """
        worker, began = self._acquire(), time.monotonic()
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
                raise Failed(f"{function.__name__}: {reply.beyond(self._limits)}")
        raise BadInput([_beyond(self._limits.within_shell(), reply.ending)])

    def _acquire(self) -> Worker:
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
            return place.result()  # a worker was assigned between the timeout and the lock

    def _give_back(self, worker: Worker, seconds: float) -> None:
        with self._lock:
            self._usual += (seconds - self._usual) / 10
            if self._waiting:
                self._waiting.popleft().set_result(worker)
            else:
                self._free.append(worker)

    def close(self) -> None:
        """End the idle workers."""
        with self._lock:
            for worker in self._free:
                worker.close()


def nothing(_: object) -> None:
    """Do nothing; the call returns once a worker is ready."""


def _beyond(limits: Limits, ending: Ending) -> Diagnostic:
    limit = f"{limits.seconds} s" if ending is Ending.LATE else f"{limits.memory / 1e6:g} MB of memory"
    advice: str = "split the upload into smaller parts"
    if ending is Ending.LATE:
        advice = Text(advice, ", or ask the operator for a higher limit: ", Option("check_seconds"))
    return error("K015", f"the check takes more than {limit}", help=advice)


class Staff:
    """Worker pools of a server: for uploads, for readers, for parsing queries, and for background work."""

    def __init__(self, folders: Sequence[Path] = (), limits: Limits = LIMITS) -> None:
        """Set up the pools; workers know the bundled vocabulary and the ontologies in ``folders``."""
        self._folders = tuple(folders)
        self._source = Source(PREPARE, *map(str, folders))
        self.checking = Workers(self._source, AT_A_TIME, limits)
        self.reading = Workers(self._source, AT_A_TIME, limits)
        self.asking = Workers(self._source, 1, limits)
        self.behind = Workers(self._source, 1, limits, math.inf)

    @cached_property
    def vocabulary(self) -> Vocabulary:
        """Vocabulary of the workers, read in this process."""
        return read_vocabulary(self._folders)

    def start(self) -> None:
        """Start the process that workers are forked from."""
        self._source.start()

    def wait(self) -> None:
        """Wait until workers are ready."""
        self.behind.call(nothing)

    def close(self) -> None:
        """End all workers."""
        for some in (self.checking, self.reading, self.asking, self.behind):
            some.close()
        self._source.close()


def prepared(*folders: str) -> Performs:
    """Read the vocabulary with the ontologies in ``folders``; calls get it as their last argument."""
    vocabulary = read_vocabulary([Path(folder) for folder in folders])
    warm_up(vocabulary)
    os.nice(5)  # lets the server's own process, which answers plain reads, go first

    def perform(function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
        try:
            return function(*arguments, vocabulary)
        except BadInput as problem:
            raise BadInput([as_here(one, vocabulary) for one in problem.diagnostics]) from None

    return perform
