"""Source process from which workers are forked, and the loop of a worker, which answers calls within limits.

A call that exceeds its limits ends its worker. The source process has imported and read everything that calls need, so
that a replacement is ready at once.
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
from planlang.shell_limits import inherited, lower

_SET_PARENT_DEATH_SIGNAL = 1
"""``PR_SET_PDEATHSIG`` of Linux, prctl(2)."""


def main(prepare: str, arguments: Sequence[str]) -> None:
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
            return
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
            with connection.makefile("rwb") as stream:
                _work(stream, performs, limits)
            os._exit(0)
        connection.close()


def _end_with(source: int) -> None:
    """Let the kernel kill this worker when the source process ends, which itself ends with the user's process."""
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != source:  # the source ended before the call of prctl
        os._exit(0)


def _work(stream: BufferedRWPair[Any, Any], performs: Performs, limits: Limits) -> None:
    """Answer pickled calls (function, arguments) until the connection is closed."""
    size, used, most = _address_space(), 0.0, inherited(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    memory = lower(resource.RLIMIT_AS, size + limits.memory) - size
    while True:
        try:
            function, arguments = pickle.load(stream)
        except EOFError:
            return
        _limit_time(limits, most)
        ending, answer = _call(performs, function, arguments)
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


def _address_space() -> int:
    """Address space in use [bytes]."""
    try:
        with open("/proc/self/statm", "rb") as statistics:
            return int(statistics.read().split()[0]) * resource.getpagesize()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
