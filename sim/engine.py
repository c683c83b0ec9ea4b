"""The only module that imports PyBullet; it keeps PyBullet's output off the terminal.

PyBullet prints its build time, its window options and remarks about URDFs to file descriptors 1 and 2. Both point to
the null device during import and connection, so that command line programs print nothing but their own output.
"""

from __future__ import annotations

import contextlib
import ctypes
import locale
import os
import sys
from collections.abc import Iterator
from typing import Any


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Redirect file descriptors 1 and 2 to the null device while C code runs.

    The C library's buffers are flushed before and after; otherwise text printed inside would appear later.
    """
    library = ctypes.CDLL(None)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    library.fflush(None)
    null = os.open(os.devnull, os.O_WRONLY)
    saved = {descriptor: os.dup(descriptor) for descriptor in (1, 2)}
    try:
        for descriptor in saved:
            os.dup2(null, descriptor)
        yield
    finally:
        library.fflush(None)
        for descriptor, copy in saved.items():
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(null)


_NUMERIC = 1 << locale.LC_NUMERIC
"""``LC_NUMERIC_MASK`` of <locale.h> in the C libraries of Linux."""


@contextlib.contextmanager
def c_numbers() -> Iterator[None]:
    """Let C code of this thread read numbers with a decimal point, whatever locale the process has chosen.

    In a process that has called ``setlocale``, as programs with windows do, PyBullet would read "0.35" as 0 where
    people write "0,35". ``uselocale`` changes the thread alone, so that the host's other threads keep their locale.
    """
    if locale.localeconv()["decimal_point"] == ".":
        yield
        return
    library = ctypes.CDLL(None)
    library.newlocale.restype = library.uselocale.restype = ctypes.c_void_p
    library.newlocale.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p]
    library.uselocale.argtypes = library.freelocale.argtypes = [ctypes.c_void_p]
    chosen = library.newlocale(_NUMERIC, b"C", None)
    before = library.uselocale(chosen)
    try:
        yield
    finally:
        library.uselocale(before)
        library.freelocale(chosen)


with quiet():  # it greets on stdout when it is imported
    import pybullet

bullet: Any = pybullet
"""The ``pybullet`` module, which has no type information."""


def connect(*, gui: bool = False) -> int:
    """Open a new physics client, with or without a window, and return its id.

    Raises ``RuntimeError`` if PyBullet refuses (no display, too many clients).
    """
    with quiet():
        client = bullet.connect(bullet.GUI if gui else bullet.DIRECT)
    if client < 0:
        raise RuntimeError("PyBullet refused the connection" + (": is there a display for its window?" if gui else ""))
    return int(client)
