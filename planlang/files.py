"""Opening files that a user names: regular files only, bounded in size, with one diagnostic for what goes wrong."""

from __future__ import annotations

import errno
import os
import re
import stat
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote_to_bytes

from planlang.diagnostics import BadInput, Span, error

LARGEST = 16_000_000
"""Bytes of a file unless its reader says otherwise: robot descriptions and maps in use have up to 0.7 MB."""


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading, following links. Raises OSError for anything else, with the reason in strerror.

    Nothing that blocks or has no end is ever opened: no FIFO, device or socket, also if it takes the file's place
    between the look and the opening.
    """
    try:
        _check_regular(path, os.stat(path))  # opening a device may have an effect, looking at it has none
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except ValueError as problem:  # a null character in the name
        raise OSError(errno.EINVAL, str(problem), str(path)) from None
    try:
        _check_regular(path, os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def _check_regular(path: Path, found: os.stat_result) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "is not a regular file", str(path))


def read_file(path: Path, code: str = "C001", *, largest: int = LARGEST, code_if_large: str | None = None) -> bytes:
    """Return the content of a file that a user named. Raises BadInput with one error of the given code.

    A file of more than ``largest`` bytes is refused, with ``code_if_large`` if that is given, and never read whole.
    """
    span = Span(str(path))
    name = printable(path.name[:80] or "the file")
    try:
        with open_regular(path) as file:
            content = file.read(largest + 1)
    except FileNotFoundError:
        raise BadInput([error(code, f"{name} does not exist", span)]) from None
    except OSError as problem:
        reason = problem.strerror or str(problem)
        message = f"{name} {reason}" if reason.startswith("is ") else f"{name} cannot be read: {reason}"
        raise BadInput([error(code, message, span)]) from None
    if len(content) > largest:
        limit = f"{largest // 1_000_000} MB" if largest >= 1_000_000 else f"{largest:,} bytes"
        raise BadInput([error(code_if_large or code, f"the file is larger than {limit}", span)])
    return content


def printable(name: str) -> str:
    """Return a file's name as text that every file and terminal takes; bytes that are not UTF-8 are written as %E9."""
    return re.sub("[\udc80-\udcff]", lambda byte: f"%{ord(byte[0]) - 0xDC00:02X}", name)


def from_printable(name: str) -> str:
    """Return the file's name that :func:`printable` wrote."""
    return os.fsdecode(unquote_to_bytes(name))
