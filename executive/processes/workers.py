"""Workers: calls in processes forked from a warm one, which end at limits of time and memory."""

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
"""Processes in which a call is tried that ends with its process, within its limits."""
_ENDED = (Ending.LOST, Ending.LATE, Ending.MEMORY)
"""The ways a call ends that let its process end, too."""


class Source:
    """The process that workers are forked from; it is started when the first is needed. Threads may share it.

    When it ends, so do its workers (on Linux at once, elsewhere after the call that they are at).
    It ends when this process does, however that ends.
    """

    def __init__(self, prepare: str, *arguments: str) -> None:
        """``prepare`` (``module:function``) gets the arguments and returns how workers call functions."""
        self._prepare = (prepare, *arguments)
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._is_closed = False

    def connect(self, limits: Limits) -> socket.socket:
        """Return a connection to a new process. Raises ConnectionError if the source has just ended, or is closed."""
        here, there = socket.socketpair()
        message = LAYOUT.pack(limits.seconds, limits.memory, limits.wall)
        self.start()
        with there, self._lock:
            if self._control is None:
                here.close()
                raise ConnectionError("no process is started any more")
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
        """Start the process, if there is none: the first worker waits for what it reads."""
        with self._lock:
            if not self._is_closed and (self._process is None or self._process.poll() is not None):
                self._start()

    def close(self) -> None:
        """End the process and its workers, for good: a call that is lost thereby is not tried again."""
        with self._lock:
            self._is_closed = True
            self._end()


class Worker:
    """A process of a source, replaced when it has ended. One thread uses it at a time."""

    def __init__(self, source: Source, limits: Limits) -> None:
        """Fork it with the first call; ``limits`` are those of each call."""
        self._source, self._limits = source, limits
        self._connection: socket.socket | None = None

    def call(self, function: Callable[..., object], *arguments: object) -> Reply:
        """Call a module's function in the process; once more in a new one if that ends within the limits."""
        reply = Reply(Ending.LOST)
        for _ in range(ATTEMPTS):
            try:
                with suppress(ConnectionError):  # the source has just ended
                    reply = self._asked(function, arguments)
            finally:
                if reply.ending in _ENDED:
                    self.close()
            if reply.ending is not Ending.LOST:
                break
        return reply

    def _asked(self, function: Callable[..., object], arguments: tuple[object, ...]) -> Reply:
        if self._connection is None:
            self._connection = self._source.connect(self._limits)
            self._stream = self._connection.makefile("rwb")
        began, limits = time.monotonic(), self._limits
        try:
            pickle.dump((function, arguments), self._stream)
            self._stream.flush()
            reply: Reply = pickle.load(self._stream)
        except (EOFError, ConnectionError, pickle.UnpicklingError):
            longest = min(limits.seconds, limits.wall or limits.seconds)
            return Reply(Ending.LATE if time.monotonic() - began >= longest else Ending.LOST)
        return reply

    def close(self) -> None:
        """Let the process end once it has answered."""
        if self._connection is not None:
            with suppress(OSError):
                self._stream.close()
            self._connection.close()
        self._connection = None
