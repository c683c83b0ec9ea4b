"""Make calls in worker processes, which are forked from a warm source process and have limits of time and memory."""

from __future__ import annotations

import pickle
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from executive.processes.calls import LAYOUT, Ending, Limits, Reply

ATTEMPTS = 2
"""Processes in which a call is tried if its worker dies within the limits."""
_ENDED = (Ending.LOST, Ending.LATE, Ending.MEMORY)
"""Endings of a call that also end its worker."""


class Source:
    """The process that workers are forked from, started on demand. Thread-safe.

    It ends with this process, even if that is killed; its workers end with it (on Linux at once, elsewhere after their
    current call).
    """

    def __init__(self, prepare: str, *arguments: str) -> None:
        """Configure the source; ``prepare`` (``module:function``) is called in it with ``arguments``.

        It returns the function by which workers make calls (:data:`~executive.processes.calls.Performs`).
        """
        self._prepare = (prepare, *arguments)
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._is_closed = False

    def connect(self, limits: Limits) -> socket.socket:
        """Fork a worker and connect to it. Raises ConnectionError if the source has just ended, or is closed."""
        here, there = socket.socketpair()
        message = LAYOUT.pack(limits.seconds, limits.memory, limits.wall)
        self.start()
        with there, self._lock:
            if self._control is None:
                here.close()
                raise ConnectionError("the source of workers is closed")
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
            # -P: imports nothing from the current folder, which may contain untrusted files
            command = [sys.executable, "-P", "-m", "executive.processes.forking", *self._prepare]
            self._process = subprocess.Popen(
                command, stdin=theirs.fileno(), stdout=subprocess.DEVNULL, start_new_session=True
            )

    def _end(self) -> None:
        if self._control is not None:
            self._control.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._control = self._process = None

    def start(self) -> None:
        """Start the process if it is not running; the first worker waits until it is prepared."""
        with self._lock:
            if not self._is_closed and (self._process is None or self._process.poll() is not None):
                self._start()

    def close(self) -> None:
        """End the process and its workers for good; calls lost by this are not tried again."""
        with self._lock:
            self._is_closed = True
            self._end()


class Worker:
    """A worker process, replaced when it has ended. Not thread-safe."""

    def __init__(self, source: Source, limits: Limits) -> None:
        """Configure the worker, which is forked by the first call; ``limits`` apply to each call."""
        self._source, self._limits = source, limits.within_shell()
        self._connection: socket.socket | None = None

    def call(self, function: Callable[..., object], *arguments: object) -> Reply:
        """Call a module-level function in the worker; if that dies within the limits, try once more in a new one."""
        reply = Reply(Ending.LOST)
        for _ in range(ATTEMPTS):
            try:
                with suppress(ConnectionError):  # the source has just ended
                    reply = self._try(function, arguments)
            finally:
                if reply.is_last or reply.ending in _ENDED:
                    self.close()
            if reply.ending is not Ending.LOST:
                break
        return reply

    def _try(self, function: Callable[..., object], arguments: tuple[object, ...]) -> Reply:
        if self._connection is None:
            self._connection = self._source.connect(self._limits)
            self._stream = self._connection.makefile("rwb")
        began, limits = time.monotonic(), self._limits
        try:
            pickle.dump((function, arguments), self._stream)
            self._stream.flush()
            reply: Reply = pickle.load(self._stream)
        except (EOFError, ConnectionError, pickle.UnpicklingError):
            longest = min(limits.seconds, limits.wall or limits.seconds)  # of CPU time it takes as long by the clock
            return Reply(Ending.LATE if time.monotonic() - began >= longest else Ending.LOST)
        return reply

    def close(self) -> None:
        """Close the connection, so that the worker ends after its current call."""
        if self._connection is not None:
            with suppress(OSError):
                self._stream.close()
            self._connection.close()
        self._connection = None
