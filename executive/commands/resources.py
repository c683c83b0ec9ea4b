"""What a command needs of the machine: memory, and folders that take files."""

from __future__ import annotations

import errno
import os
import tempfile

from planlang.diagnostics import Diagnostic, error

try:
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]

LEAST = 320_000_000
"""Bytes of address space with which the bundled recipe runs; below, libraries in C end the process without a word."""

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS}
"""Errors of a file system that takes no more."""
_NO_THREAD = "can't start new thread"
"""Python's words for want of memory, or of processes, when a thread is started."""


def check_memory() -> None:
    """Raise MemoryError if the address space is limited to less than a run needs."""
    limit = _limit()
    if limit is not None and limit < LEAST:
        raise MemoryError(f"a run needs {LEAST // 1_000_000} MB of address space")


def out_of_resources(problem: Exception) -> Diagnostic | None:
    """Return what the machine lacks if that is the cause of an error, else None."""
    if isinstance(problem, MemoryError) or (isinstance(problem, RuntimeError) and str(problem) == _NO_THREAD):
        limit, reason = _limit(), f": {problem}" if str(problem) else ""
        limited = "" if limit is None else f"; the address space is limited to {limit // 1_000_000} MB (ulimit -v)"
        advice = "raise the limit, or end other programs; large maps and robots need more than 350 MB"
        return error("C020", f"there is not enough memory{reason}{limited}", help=advice)
    if isinstance(problem, FileNotFoundError) and not _temporary_folder():
        advice = "free space on the disk, or set TMPDIR to a folder in which you may write"
        return error("C021", f"no folder takes temporary files: {problem.strerror}", help=advice)
    return None


def no_room(problem: Exception) -> Diagnostic | None:
    """Return the diagnostic of a write error if the file system takes no more, else None."""
    if not isinstance(problem, OSError) or problem.errno not in _FULL:
        return None
    message = "; ".join((f"no room to write: {problem}", *getattr(problem, "__notes__", ())))
    temporary = _temporary_folder()
    if temporary is not None and str(problem.filename or "").startswith(os.path.join(temporary, "")):
        return error("C004", message, help="free space on the disk, or set TMPDIR to a folder on another one")
    return error("C004", message, help="free space on the disk, or name another place")


def _temporary_folder() -> str | None:
    try:
        return tempfile.gettempdir()
    except OSError:
        return None


def _limit() -> int | None:
    """Return how large the address space may become [bytes]; None without a limit."""
    if resource is None:
        return None
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if soft == resource.RLIM_INFINITY else soft
