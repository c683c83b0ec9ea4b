"""The process from which workers are forked, and what a worker does: it computes what it is told, within limits.

Contents come from strangers, and no reader is proof against every one of them: what takes too long or too much memory
ends with the worker that it is done in. The first process has read everything that all work needs, so that another
worker is there at once.
"""

from __future__ import annotations

import gc
import os
import pickle
import resource
import signal
import socket
import struct
import sys
from collections.abc import Sequence
from io import BufferedRWPair
from pathlib import Path
from typing import Any

from executive.serving.uploads import as_here, warm_up
from executive.serving.vocabulary import Vocabulary, read_vocabulary
from planlang.diagnostics import BadInput

LIMITS = struct.Struct("qq")
"""What comes with a connection: seconds of CPU of a call, and bytes of memory beyond what every worker has."""


def main(folders: Sequence[str]) -> None:
    """Fork a worker for each connection that comes through the standard input, until that ends."""
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    control = socket.socket(fileno=os.dup(0))
    vocabulary = read_vocabulary([Path(folder) for folder in folders])
    warm_up(vocabulary)
    gc.collect()
    gc.freeze()  # what all share is not copied because somebody counts it
    while True:
        message, handles, _, _ = socket.recv_fds(control, LIMITS.size, 1)
        if not message:
            return
        seconds, memory = LIMITS.unpack(message)
        connection = socket.socket(fileno=handles[0])
        if os.fork() == 0:
            control.close()
            os.close(0)
            with connection.makefile("rwb") as stream:
                _work(stream, vocabulary, seconds, memory)
            os._exit(0)
        connection.close()


def _work(stream: BufferedRWPair[Any, Any], vocabulary: Vocabulary, seconds: int, memory: int) -> None:
    """Answer calls, which are (function, arguments), until there are no more; each has ``seconds`` of CPU."""
    os.nice(5)  # whoever only reads goes first
    size = _size()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (size + memory, size + memory))
    while True:
        try:
            function, arguments = pickle.load(stream)
        except EOFError:
            return
        _bound_time(seconds)
        is_last = False
        try:
            answer = ("done", function(*arguments, vocabulary))
        except BadInput as problem:
            answer = ("refused", [as_here(one, vocabulary) for one in problem.diagnostics])
        except MemoryError:
            answer, is_last = ("memory", None), True  # what is left of it is not to be shared with the next
        except Exception as problem:
            answer = ("failed", f"{type(problem).__name__}: {problem}")
        pickle.dump(answer, stream)
        stream.flush()
        if is_last:
            return


def _bound_time(seconds: int) -> None:
    """Let this process be killed after ``seconds`` more of CPU."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    end = int(used.ru_utime + used.ru_stime) + seconds + 1
    resource.setrlimit(resource.RLIMIT_CPU, (end, resource.getrlimit(resource.RLIMIT_CPU)[1]))


def _size() -> int:
    """Return the bytes of address space in use."""
    try:
        with open("/proc/self/statm", "rb") as statistics:
            return int(statistics.read().split()[0]) * resource.getpagesize()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


if __name__ == "__main__":
    main(sys.argv[1:])
