"""Temporary folders: locked while their process lives, and removed by the next process if that one was killed.

The lock is one of the kernel (``flock``) on the folder itself. It ends with the process and with those that it has
forked, so that a folder in use is never removed, and one that nobody uses is recognised without its process's number.
A folder gets its final name once it is locked: others only look at final names.
"""

from __future__ import annotations

import atexit
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

PREFIX = "planlang."
"""Beginning of the names of temporary folders; those beside an output have a dot before it."""
_UNLOCKED = ".unlocked-"
"""Beginning of the name of a folder before it is locked."""
_cleared: set[str] = set()
"""Folders in which this process has looked for abandoned ones."""


@contextmanager
def temporary_folder(beside: Path | None = None) -> Iterator[Path]:
    """Yield a new empty folder, and remove it afterwards with its content. Raises OSError if it cannot be made.

    It is made where the system keeps temporary files, or hidden in the folder ``beside``, from which its files can be
    renamed to their final places.
    """
    folder, lock = _locked(beside)
    try:
        yield folder
    finally:
        _remove(folder, lock)


@cache
def process_folder() -> Path:
    """Return a folder that lives as long as this process. Raises OSError if it cannot be made."""
    folder, lock = _locked(None)
    atexit.register(_remove, folder, lock, of=os.getpid())
    return folder


def _remove(folder: Path, lock: int | None, of: int | None = None) -> None:
    if of in (None, os.getpid()):  # not in a process that was forked, for which the folder was not made
        shutil.rmtree(folder, ignore_errors=True)
        if lock is not None:
            os.close(lock)


def _locked(beside: Path | None) -> tuple[Path, int | None]:
    """Make a folder, and return it with its lock; None where the file system has no locks."""
    root, prefix = (tempfile.gettempdir(), PREFIX) if beside is None else (os.fspath(beside), f".{PREFIX}")
    _remove_abandoned(root, prefix)
    unlocked = Path(tempfile.mkdtemp(prefix=f"{prefix}{_UNLOCKED}", dir=root))
    lock = _lock(unlocked)
    if lock is None:  # nobody could tell whether it is in use
        return unlocked, None
    folder = unlocked.with_name(unlocked.name.replace(_UNLOCKED, "", 1))
    unlocked.rename(folder)
    return folder, lock


def _lock(folder: Path) -> int | None:
    """Lock a folder; None if another process has locked it, or if it cannot be locked."""
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        if os.fstat(handle).st_uid == os.geteuid():
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return handle
    except OSError:
        pass
    os.close(handle)
    return None


def _remove_abandoned(root: str, prefix: str) -> None:
    """Remove the folders of this user whose processes were killed; once for each folder that has some."""
    if root in _cleared:
        return
    _cleared.add(root)
    with suppress(OSError), os.scandir(root) as entries:
        found = [Path(entry.path) for entry in entries if entry.name.startswith(prefix) and _UNLOCKED not in entry.name]
        for folder in found:
            if (lock := _lock(folder)) is not None:
                _remove(folder, lock)
