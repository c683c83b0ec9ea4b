"""Resources of the machine: limits that the shell, a service manager or a batch system has set, and what is lacking.

Limits hold for this process and its children. What is lacking is memory, files, processes, or room on a disk.
"""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path

from planlang.diagnostics import Diagnostic, error
from planlang.outputs import ADVICE, FOLDER_DELETED, is_folder_deleted, named

try:
    import resource
except ImportError:  # not on Windows
    resource = None  # type: ignore[assignment]

_NAMES = {"RLIMIT_CPU": ("-t", 1, " s of CPU time"), "RLIMIT_AS": ("-v", 1_000_000, " MB of memory")}
_NAMES |= {"RLIMIT_DATA": ("-d", 1_000_000, " MB of data"), "RLIMIT_FSIZE": ("-f", 1_000_000, " MB for a file")}
"""Limits that are not set by default: the option of ``ulimit``, the unit of the number shown, its name."""


def cpu_seconds() -> int | None:
    """Return the limit of CPU time [s]; None without one."""
    return None if resource is None else inherited(resource.RLIMIT_CPU)


def address_space() -> int | None:
    """Return the limit of the address space [bytes]; None without one."""
    return None if resource is None else inherited(resource.RLIMIT_AS)


def used_address_space() -> int:
    """Return the size of this process's address space [bytes]."""
    try:
        with open("/proc/self/statm", "rb") as statistics:
            return int(statistics.read().split()[0]) * resource.getpagesize()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def inherited(kind: int) -> int | None:
    """Return a limit of resources, such as ``RLIMIT_AS``; None without one."""
    soft, hard = resource.getrlimit(kind)
    stated = [one for one in (soft, hard) if one != resource.RLIM_INFINITY]
    return min(stated, default=None)


def lower(kind: int, amount: int) -> int:
    """Limit this process to ``amount``, or to what it inherited if that is less; return which of them it is."""
    most = inherited(kind)
    kept = amount if most is None else min(amount, most)
    resource.setrlimit(kind, (kept, kept))
    return kept


def stated() -> str:
    """List the limits that somebody has set, for a message: ``100 s of CPU time (ulimit -t)``; "" without any."""
    if resource is None:
        return ""
    known = ((getattr(resource, name), shown) for name, shown in _NAMES.items() if hasattr(resource, name))
    found = ((inherited(kind), *shown) for kind, shown in known)
    return ", ".join(
        f"{most / unit:g}{what} (ulimit {option})" for most, option, unit, what in found if most is not None
    )


LEAST = 320_000_000
"""Address space with which the bundled recipe runs [bytes]; with less, C libraries abort without a message."""

_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS}
"""Errors of a full or read-only file system."""
_NO_FILES = {errno.EMFILE, errno.ENFILE}
_NOT_MAPPED = "failed to map segment"
"""Message of the loader if memory does not suffice for a compiled module."""
_OF_PATHS = {
    errno.ENAMETOOLONG,
    errno.ENOTDIR,
    errno.EISDIR,
    errno.ELOOP,
    errno.EACCES,
    errno.EPERM,
    errno.ENXIO,
    errno.ETXTBSY,
    errno.EIO,
    errno.ESTALE,
    errno.EMFILE,
    errno.ENFILE,
}
"""Errors of a path, of its permissions, or of its disk: a user mends them, never planlang."""
_NO_THREAD = "can't start new thread"
"""Python's message if memory or the limit of processes does not suffice for a thread."""


def check_memory() -> None:
    """Raise MemoryError if the address space is limited to less than a run needs."""
    limit = address_space()
    if limit is not None and limit < LEAST:
        raise MemoryError(f"a run needs {LEAST // 1_000_000} MB of address space")


def out_of_resources(problem: Exception) -> Diagnostic | None:
    """Diagnose an error caused by a lack of memory or of a temporary folder; None for other errors."""
    no_library = isinstance(problem, ImportError) and os.strerror(errno.EMFILE) in str(problem)
    if no_library or (isinstance(problem, OSError) and problem.errno in _NO_FILES):
        advice = "raise the limit, or close other programs"
        return error("C020", f"no more files can be opened{_most('RLIMIT_NOFILE', 'files (ulimit -n)')}", help=advice)
    if isinstance(problem, BlockingIOError | ChildProcessError):
        advice = "raise the limit, or end other programs"
        return error("C020", f"no process can be started{_most('RLIMIT_NPROC', 'processes (ulimit -u)')}", help=advice)
    if (
        isinstance(problem, MemoryError)
        or (isinstance(problem, RuntimeError) and str(problem) == _NO_THREAD)
        or (isinstance(problem, OSError) and problem.errno == errno.ENOMEM)
        or (isinstance(problem, ImportError) and _NOT_MAPPED in str(problem))
    ):
        limit, reason = address_space(), f": {problem}" if str(problem) else ""
        limited = "" if limit is None else f"; the address space is limited to {limit // 1_000_000} MB (ulimit -v)"
        advice = "raise the limit, or end other programs; large maps and robots need more than 350 MB"
        return error("C020", f"not enough memory{reason}{limited}", help=advice)
    if isinstance(problem, FileNotFoundError) and not _temporary_folder():
        advice = "free space on the disk, or set TMPDIR to a writable folder"
        return error("C021", f"no folder for temporary files: {problem.strerror}", help=advice)
    return None


def _most(kind: str, what: str) -> str:
    """State a limit of the shell; "" without one."""
    most = None if resource is None else inherited(getattr(resource, kind))
    return "" if most is None else f": the shell allows {most} {what}"


def file_problem(problem: Exception) -> Diagnostic | None:
    """Diagnose an error of a file, its folder or its disk that a user can mend; None for other errors."""
    if not isinstance(problem, OSError):
        return None
    if isinstance(problem, FileNotFoundError) and is_folder_deleted():
        reason, advice = FOLDER_DELETED
        return error("C001", reason, help=advice)
    if problem.filename is not None and problem.errno in _OF_PATHS:
        name = named(Path(os.fsdecode(problem.filename)))
        return error("C001", f"{name} cannot be opened: {problem.strerror}", help=ADVICE.get(problem.errno))
    if problem.errno not in _FULL:
        return None
    message = "; ".join((f"no room to write: {problem}", *getattr(problem, "__notes__", ())))
    temporary = _temporary_folder()
    if temporary is not None and str(problem.filename or "").startswith(os.path.join(temporary, "")):
        return error("C004", message, help="free space on the disk, or set TMPDIR to a folder on another disk")
    return error("C004", message, help="free space on the disk, or write to another disk")


def _temporary_folder() -> str | None:
    try:
        return tempfile.gettempdir()
    except OSError:
        return None
