"""Worker processes, forked warm from a source process, for calls within limits of time and memory.

The source process has imported and read everything that calls need, so that a worker that exceeded its limits, and
ended by that, is replaced at once. From above: a call, its limits and how it can end; the caller's side; the source
process and the loop of a worker.
"""

from __future__ import annotations

import ctypes
import fcntl
import gc
import os
import pickle
import resource
import select
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from enum import Enum
from io import BufferedRWPair
from pkgutil import resolve_name
from typing import Any

from planlang.diagnostics import BadInput
from planlang.machine import cpu_seconds, inherited, lower, stated, used_address_space
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one call."""

    seconds: int = 10
    """CPU time [s]."""
    memory: int = 1_000_000_000
    """Memory in addition to that of a new worker [bytes]."""
    wall: float = 0.0
    """Wall-clock time [s], for calls that may block forever; 0 means no limit."""

    def within_shell(self) -> Limits:
        """Return the limits that apply where the shell limits CPU time to less."""
        most = cpu_seconds()
        return self if most is None or most > self.seconds else replace(self, seconds=max(1, most - 1))


LAYOUT = struct.Struct("qqd")
"""Binary layout of the limits that are sent with a worker's connection."""


class Ending(Enum):
    """How a call ended."""

    DONE = "done"
    REFUSED = "refused"
    """The function raised BadInput; the answer has the diagnostics."""
    FAILED = "failed"
    """The function raised another exception; the answer is its class and message."""
    MEMORY = "memory"
    """The function exceeded its memory limit."""
    LATE = "late"
    """The worker was killed at its time limit."""
    LOST = "lost"
    """The worker died within its limits: it crashed, or was killed from outside."""


@dataclass(frozen=True, slots=True)
class Reply:
    """Result of a call."""

    ending: Ending
    answer: Any = None
    seconds: float = 0.0
    """CPU time of the worker since its last reply [s]; 0 if it died."""
    is_last: bool = False
    """True if the worker has ended after it."""

    def beyond(self, limits: Limits) -> str:
        """Say which limit the call exceeded, its own or the shell's."""
        of_shell = stated()
        match self.ending:
            case Ending.MEMORY if self.answer is not None and self.answer < limits.memory:
                return f"it needed more than {self.answer / 1e6:.0f} MB of memory; the shell's limit: {of_shell}"
            case Ending.MEMORY:
                return f"it needed more than {limits.memory / 1e6:g} MB of memory"
            case Ending.LATE:
                seconds = limits.within_shell().seconds
                wall = f", or {limits.wall:g} s in all" if limits.wall else ""
                whose = f"; the shell's limit: {of_shell}" if seconds < limits.seconds else ""
                return f"it took more than {seconds} s of CPU time{wall}{whose}"
        whose = f"; the shell's limits: {of_shell}" if of_shell else ""
        return f"several processes in a row died without a result{whose}"


Performs = Callable[[Callable[..., Any], Sequence[Any]], Any]
"""Calls a function with its arguments in a worker, and possibly with data shared by all workers."""


ATTEMPTS = 2
"""Processes in which a call is tried if its worker dies within the limits."""
START = "import sys; from executive.processes.workers import fork_workers; fork_workers(*sys.argv[1:])"
"""The program of the source process; a call's reply has the same class there, as this is no main program."""
_ENDED = (Ending.LOST, Ending.LATE, Ending.MEMORY)
"""Endings of a call that also end its worker."""


def other_environment() -> dict[str, str]:
    """Environment variables for another installation's interpreter, without those that name modules of this one."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}


class Source:
    """The process that workers are forked from, started on demand. Thread-safe.

    It ends with this process, even if that is killed; its workers end with it (on Linux at once, elsewhere after their
    current call).
    """

    def __init__(self, prepare: str, *arguments: str, python: str | None = None) -> None:
        """Configure the source; ``prepare`` (``module:function``) is called in it with ``arguments``.

        It returns the function by which workers make calls (:data:`~executive.processes.workers.Performs`). ``python``
        is the interpreter of another installation, which then has all modules.
        """
        self._prepare, self._python = (prepare, *arguments), python
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
            command = [self._python or sys.executable, "-P", "-c", START, *self._prepare]
            self._process = subprocess.Popen(
                command,
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                start_new_session=True,
                env=None if self._python is None else other_environment(),
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
        self._is_stopped = False

    def call(self, function: Callable[..., object], *arguments: object) -> Reply:
        """Call a module-level function in the worker; if that dies within the limits, try once more in a new one."""
        reply = Reply(Ending.LOST)
        for _ in range(ATTEMPTS):
            if self._is_stopped:
                break
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
            if self._is_stopped:  # meanwhile
                return Reply(Ending.LOST)
        began, limits = time.monotonic(), self._limits
        try:
            pickle.dump((function, arguments), self._stream)
            self._stream.flush()
            reply: Reply = pickle.load(self._stream)
        except (EOFError, ConnectionError, pickle.UnpicklingError):
            longest = min(limits.seconds, limits.wall or limits.seconds)  # of CPU time it takes as long by the clock
            return Reply(Ending.LATE if time.monotonic() - began >= longest else Ending.LOST)
        return reply

    def stop(self) -> None:
        """End the process for good, and the call that it may be in, from any thread: the call is lost.

        On Linux it ends at once, elsewhere after its current call.
        """
        self._is_stopped = True
        if (connection := self._connection) is not None:
            with suppress(OSError):  # it has just ended
                connection.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the connection, so that the worker ends after its current call."""
        if self._connection is not None:
            with suppress(OSError):
                self._stream.close()
            self._connection.close()
        self._connection = None


_SET_PARENT_DEATH_SIGNAL = 1
"""``PR_SET_PDEATHSIG`` of Linux, prctl(2)."""


def fork_workers(prepare: str, *arguments: str) -> None:
    """Fork a worker for each connection received through the standard input, until that is closed.

    ``prepare`` (``module:function``) is called with ``arguments`` and returns the function by which workers make calls.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is imported: threads do not survive a fork
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    control = socket.socket(fileno=os.dup(0))
    performs: Performs = resolve_name(prepare)(*arguments)
    gc.collect()
    gc.freeze()  # keeps the collector off shared objects, whose pages would be copied in each worker
    source = os.getpid()
    while True:
        message, handles, _, _ = socket.recv_fds(control, LAYOUT.size, 1)
        if not message:
            os._exit(0)  # at once, as workers end with it: to tidy up all that was imported takes a second
        limits = Limits(*LAYOUT.unpack(message))
        connection = socket.socket(fileno=handles[0])
        try:
            process = os.fork()
        except OSError:  # no memory, or no more processes (ulimit -u): the caller finds the connection closed
            process = -1
        if process == 0:
            _end_with(source)
            control.close()
            os.close(0)
            with suppress(ConnectionError), connection.makefile("rwb") as stream:  # unless the caller was killed
                _work(connection, stream, performs, limits)
            os._exit(0)
        connection.close()


def _end_with(source: int) -> None:
    """Let the kernel kill this worker when the source process ends, which itself ends with the user's process."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != source:  # the source ended before the call of prctl
        os._exit(0)


def _end_with_caller(connection: socket.socket, *, ends: bool) -> None:
    """Let the kernel end this worker when its caller hangs up, by the signal of a socket on which something happens."""
    if not sys.platform.startswith("linux"):  # where the default action of that signal differs
        return
    fcntl.fcntl(connection, fcntl.F_SETOWN, os.getpid())
    flags = fcntl.fcntl(connection, fcntl.F_GETFL)
    fcntl.fcntl(connection, fcntl.F_SETFL, flags | os.O_ASYNC if ends else flags & ~os.O_ASYNC)
    if ends and select.select([connection], [], [], 0)[0]:  # it has hung up already
        os._exit(0)


def _work(connection: socket.socket, stream: BufferedRWPair[Any, Any], performs: Performs, limits: Limits) -> None:
    """Answer pickled calls (function, arguments) until the connection is closed."""
    size, used, most = used_address_space(), 0.0, inherited(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    memory = lower(resource.RLIMIT_AS, size + limits.memory) - size
    while True:
        try:
            function, arguments = pickle.load(stream)
        except EOFError:
            return
        _limit_time(limits, most)
        _end_with_caller(connection, ends=True)
        ending, answer = _call(performs, function, arguments)
        _end_with_caller(connection, ends=False)
        signal.setitimer(signal.ITIMER_REAL, 0)
        before, used = used, _cpu_time()
        # its state is unreliable, or the shell's limit near: the next call gets a new worker
        is_last = ending is Ending.MEMORY or (most is not None and used + limits.seconds + 1 > most)
        pickle.dump(Reply(ending, memory if ending is Ending.MEMORY else answer, used - before, is_last), stream)
        stream.flush()
        if is_last:
            return


def _call(performs: Performs, function: Any, arguments: Sequence[Any]) -> tuple[Ending, Any]:
    try:
        return Ending.DONE, performs(function, arguments)
    except BadInput as problem:
        return Ending.REFUSED, problem.diagnostics
    except MemoryError:
        return Ending.MEMORY, None
    except Exception as problem:
        return Ending.FAILED, f"{type(problem).__name__}: {problem}"


def _limit_time(limits: Limits, most: int | None) -> None:
    """Set the limits of CPU and wall-clock time for the next call; of CPU time at ``most`` what the shell allows [s].

    The kernel enforces them by signals with their default action, which also end code in C.
    """
    end = int(_cpu_time()) + limits.seconds + 1
    soft = end if most is None else min(end, most)
    resource.setrlimit(resource.RLIMIT_CPU, (soft, resource.getrlimit(resource.RLIMIT_CPU)[1]))
    signal.setitimer(signal.ITIMER_REAL, limits.wall)


def _cpu_time() -> float:
    """CPU time of this process [s]."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime
