"""The process from which workers are forked, and what a worker does: it computes what it is asked for, within limits.

What takes too long or too much memory ends with the worker that computes it. The first process has imported and read
everything that all calls need, so that another worker is there at once.
"""

from __future__ import annotations

import ctypes
import gc
import os
import pickle
import resource
import signal
import socket
import sys
from collections.abc import Sequence
from io import BufferedRWPair
from pkgutil import resolve_name
from typing import Any

from executive.processes.calls import LAYOUT, Ending, Limits, Performs, Reply
from planlang.diagnostics import BadInput

_SET_PARENT_DEATH_SIGNAL = 1
"""``PR_SET_PDEATHSIG`` of Linux."""


def main(prepare: str, arguments: Sequence[str]) -> None:
    """Fork a worker for each connection that comes through the standard input, until that ends.

    ``prepare`` names a function (``module:function``) that takes the arguments and returns how workers call functions.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # read when numpy is imported: threads do not survive a fork
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    control = socket.socket(fileno=os.dup(0))
    performs: Performs = resolve_name(prepare)(*arguments)
    gc.collect()
    gc.freeze()  # what all share is not copied because somebody counts it
    source = os.getpid()
    while True:
        message, handles, _, _ = socket.recv_fds(control, LAYOUT.size, 1)
        if not message:
            return
        limits = Limits(*LAYOUT.unpack(message))
        connection = socket.socket(fileno=handles[0])
        if os.fork() == 0:
            _end_with(source)
            control.close()
            os.close(0)
            with connection.makefile("rwb") as stream:
                _work(stream, performs, limits)
            os._exit(0)
        connection.close()


def _end_with(source: int) -> None:
    """Let the kernel kill this process when the one that it was forked from ends, which ends with its user's."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != source:  # it has ended before the kernel was asked
        os._exit(0)


def _work(stream: BufferedRWPair[Any, Any], performs: Performs, limits: Limits) -> None:
    """Answer calls, which are (function, arguments), until there are no more."""
    size, used = _size(), 0.0
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (size + limits.memory, size + limits.memory))
    while True:
        try:
            function, arguments = pickle.load(stream)
        except EOFError:
            return
        _bound_time(limits)
        ending, answer = _performed(performs, function, arguments)
        signal.setitimer(signal.ITIMER_REAL, 0)
        before, used = used, _seconds()
        pickle.dump(Reply(ending, answer, used - before), stream)
        stream.flush()
        if ending is Ending.MEMORY:  # what is left of it is not to be shared with the next
            return


def _performed(performs: Performs, function: Any, arguments: Sequence[Any]) -> tuple[Ending, Any]:
    try:
        return Ending.DONE, performs(function, arguments)
    except BadInput as problem:
        return Ending.REFUSED, problem.diagnostics
    except MemoryError:
        return Ending.MEMORY, None
    except Exception as problem:
        return Ending.FAILED, f"{type(problem).__name__}: {problem}"


def _bound_time(limits: Limits) -> None:
    """Let this process be killed after some more seconds of CPU, or of wall clock while it hangs.

    The kernel does that by signals whose handlers are not Python's, so that it also ends code in C.
    """
    end = int(_seconds()) + limits.seconds + 1
    resource.setrlimit(resource.RLIMIT_CPU, (end, resource.getrlimit(resource.RLIMIT_CPU)[1]))
    signal.setitimer(signal.ITIMER_REAL, limits.wall)


def _seconds() -> float:
    """Return the CPU time that this process has used [s]."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _size() -> int:
    """Return the bytes of address space in use."""
    try:
        with open("/proc/self/statm", "rb") as statistics:
            return int(statistics.read().split()[0]) * resource.getpagesize()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
