"""The one place that imports PyBullet: silent import, silent connections.

PyBullet writes its build time, its window's options and remarks about URDFs to file descriptors 1 and 2; the output of
a command line program that uses this package stays clean because they point to the null device meanwhile.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Iterator
from typing import Any


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Send what C code prints to file descriptors 1 and 2 to the null device.

    The C library's buffers are flushed before and after, else what was printed inside would appear later.
    """
    library = ctypes.CDLL(None)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    library.fflush(None)
    null = os.open(os.devnull, os.O_WRONLY)
    kept = {descriptor: os.dup(descriptor) for descriptor in (1, 2)}
    try:
        for descriptor in kept:
            os.dup2(null, descriptor)
        yield
    finally:
        library.fflush(None)
        for descriptor, copy in kept.items():
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(null)


def _import() -> Any:
    with quiet():
        import pybullet

        return pybullet


bullet: Any = _import()
"""The ``pybullet`` module, which has no type information."""


def connect(*, gui: bool = False) -> int:
    """Open a physics client of its own, with or without a window; returns the client's id.

    Raises ``RuntimeError`` when PyBullet refuses (no display, too many clients).
    """
    with quiet():
        client = bullet.connect(bullet.GUI if gui else bullet.DIRECT)
    if client < 0:
        raise RuntimeError("PyBullet gave no connection" + (": is there a display for its window?" if gui else ""))
    return int(client)
