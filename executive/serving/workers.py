"""Work in processes of its own, a bounded number at a time: checks of uploads, conversions, comparisons with robots.

Each call has limits of time and memory at which the worker is ended, and a place in a queue: first come, first served.
Who would wait for long is told at once when to come back.
"""

from __future__ import annotations

import math
import pickle
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

from executive.serving.vocabulary import Vocabulary, read_vocabulary
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.records import dataclass

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one call: seconds of CPU, bytes of memory beyond what every worker has."""

    seconds: int = 10
    memory: int = 1_000_000_000


LIMITS = Limits()
AT_A_TIME = 2
"""Checks, and likewise calls on behalf of readers, that are computed at a time."""
LONGEST_WAIT = 2.0
"""Seconds that a call may be expected to wait for its turn; nobody waits more than twice as long."""
USUAL = 0.05
"""Seconds that a call is expected to take before any has been done."""
MOST_WAITING = 100
"""Calls that wait for their turn."""
_ATTEMPTS = 2
"""Workers in which a call is tried that ends with its worker, within its limits."""
_ENDED = frozenset(("lost", "late", "memory"))
"""The ways a call ends that let its worker end, too."""


class Busy(Exception):
    """The refusal of a call while so many wait for their turn; ``seconds`` says after how long to come back."""

    def __init__(self, seconds: float, what: str = "checked") -> None:
        super().__init__(f"too much is being {what} at the moment; try again later")
        self.seconds = max(1, math.ceil(seconds))


class Failed(Exception):
    """The failure of a worker that came upon a mistake in planlang, or ended with it; the text says which."""


class Source:
    """The process that workers are forked from; it is started when the first is needed. Threads may share it."""

    def __init__(self, folders: Sequence[Path]) -> None:
        """Let workers read the vocabulary in ``folders``, beside the bundled one."""
        self._folders = folders
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None

    def connect(self, limits: Limits) -> socket.socket:
        """Return a connection to a new worker. Raises ConnectionError if the process has just ended."""
        here, there = socket.socketpair()
        message = struct.pack("qq", limits.seconds, limits.memory)
        self.start()
        with there, self._lock:
            assert self._control is not None
            try:
                socket.send_fds(self._control, [message], [there.fileno()])
            except OSError:
                here.close()
                raise
        return here

    def _start(self) -> None:
        self._end()
        self._control, theirs = socket.socketpair()
        with theirs:
            # -P: nothing is imported from this folder, where strangers' files may lie
            command = [sys.executable, "-P", "-m", "executive.serving.worker", *map(str, self._folders)]
            self._process = subprocess.Popen(
                command, stdin=theirs.fileno(), stdout=subprocess.DEVNULL, start_new_session=True
            )

    def _end(self) -> None:
        if self._control is not None:
            self._control.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._process = None

    def start(self) -> None:
        """Start the process, if there is none: the first worker waits for what it reads."""
        with self._lock:
            if self._process is None or self._process.poll() is not None:
                self._start()

    def close(self) -> None:
        """End the process; workers end when they have answered."""
        with self._lock:
            self._end()


class Workers:
    """Some workers of one source, and the queue of those who need them. Threads may share it."""

    def __init__(self, source: Source, number: int, limits: Limits, longest_wait: float = LONGEST_WAIT) -> None:
        """Refuse whoever is expected to wait longer than ``longest_wait`` [s]."""
        self._source, self._number, self._limits, self._longest = source, number, limits, longest_wait
        self._lock = threading.Lock()
        self._free: list[_Worker | None] = [None] * number  # None: one that has still to be forked
        self._waiting: deque[Future[_Worker | None]] = deque()
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
        kind = "lost"
        answer: Any = None
        try:
            for _ in range(_ATTEMPTS):
                with suppress(ConnectionError):  # the source has just ended
                    worker = worker or _Worker(self._source.connect(self._limits))
                    kind, answer = worker.ask(function, arguments, self._limits.seconds)
                if kind != "lost":
                    break
                if worker is not None:
                    worker.close()
                    worker = None
        finally:
            if kind in _ENDED and worker is not None:
                worker.close()
                worker = None
            self._give_back(worker, time.monotonic() - began)
        if kind == "done":
            return cast(T, answer)
        if kind == "refused":
            raise BadInput(answer)
        if kind == "failed":
            raise Failed(str(answer))
        if kind == "lost":
            raise Failed(f"{_ATTEMPTS} workers ended at {function.__name__}")
        raise BadInput([_beyond(self._limits, is_late=kind == "late")])

    def _turn(self) -> _Worker | None:
        with self._lock:
            if self._free:
                return self._free.pop()
            expected = (len(self._waiting) + 1) * self._usual / self._number
            if expected > self._longest or len(self._waiting) >= MOST_WAITING:
                raise Busy(expected)
            place: Future[_Worker | None] = Future()
            self._waiting.append(place)
        try:
            return place.result(None if self._longest == math.inf else 2 * self._longest)
        except TimeoutError:
            with self._lock:
                if place in self._waiting:
                    self._waiting.remove(place)
                    raise Busy(self._longest) from None
            return place.result()

    def _give_back(self, worker: _Worker | None, seconds: float) -> None:
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
                if worker is not None:
                    worker.close()
            self._free = [None] * len(self._free)


class _Worker:
    """A connection to a process."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._stream = connection.makefile("rwb")

    def ask(self, function: Callable[..., object], arguments: Sequence[object], seconds: float) -> tuple[str, Any]:
        """Return how a call ended, and with what; ``late`` if its process ended after ``seconds``, else ``lost``."""
        began = time.monotonic()
        try:
            pickle.dump((function, arguments), self._stream)
            self._stream.flush()
            kind, answer = pickle.load(self._stream)
        except (EOFError, ConnectionError, pickle.UnpicklingError):
            return "late" if time.monotonic() - began >= seconds else "lost", None
        return kind, answer

    def close(self) -> None:
        """Let the process end."""
        with suppress(OSError):
            self._stream.close()
        self._connection.close()


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
        self._source = Source(folders)
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
