"""Results kept between processes.

A :class:`Cache` stores results that are costly and depend on nothing but their inputs, in the user's cache folder.
The caller builds the key from everything that the result depends on, so entries never have to be invalidated. Each
entry starts with a digest of key and content; an entry that is damaged, incomplete or belongs to another key is ignored
and computed again. Entries are written under a temporary name and renamed, so that other processes see a whole entry
or none. Without a writable folder nothing is stored.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

from planlang.files import open_regular, read_at_most
from planlang.records import dataclass

_DIGEST_BYTES = 64
"""Length of the digest before the content, in hexadecimal digits; arrays that follow it stay aligned."""


@dataclass(frozen=True, slots=True)
class Cache:
    """Entries of one kind, in a folder of their own.

    The ``most`` recent entries are kept, of ``total`` bytes together; an entry has at most ``largest`` bytes.
    """

    kind: str
    most: int
    largest: int = 64_000_000
    total: int = 250_000_000

    def load(self, key: str) -> bytes | None:
        """Return the content stored under a key; None if there is none or it was altered."""
        entry = self._entry(key)
        if entry is None or not _is_ours_alone(entry.parent):
            return None
        try:
            with open_regular(entry) as file:
                if os.fstat(file.fileno()).st_size > self.largest + _DIGEST_BYTES:
                    return None
                content = read_at_most(file, self.largest + _DIGEST_BYTES)
        except OSError:
            return None
        return unsealed(key, content)

    def keep(self, key: str, content: bytes) -> bool:
        """Store content under a key, replacing an earlier entry; return False if that is impossible."""
        entry = self._entry(key)
        if entry is None or len(content) > self.largest:
            return False
        temporary: str | None = None
        try:
            entry.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            _close_to_others(entry.parent)
            if not _is_ours_alone(entry.parent):
                return False
            handle, temporary = tempfile.mkstemp(prefix=".", dir=entry.parent)
            with os.fdopen(handle, "wb") as file:
                file.write(sealed(key, content))
            if entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry)
            os.replace(temporary, entry)
        except OSError:
            return False
        finally:
            if temporary is not None:
                with suppress(OSError):
                    os.unlink(temporary)
        self._forget_oldest(entry)
        return True

    def _entry(self, key: str) -> Path | None:
        folder = cache_folder(self.kind)
        return None if folder is None else folder / hashlib.sha256(key.encode()).hexdigest()

    def _forget_oldest(self, newest: Path) -> None:
        found = []
        for path in newest.parent.iterdir():
            with suppress(OSError):  # another process has deleted it
                entry = path.lstat()
                found.append((path != newest, -entry.st_mtime, path, entry.st_size))
        kept = 0
        for number, (is_older, _, path, size) in enumerate(sorted(found)):
            kept += size
            if is_older and (number >= self.most or kept > self.total):
                with suppress(OSError):
                    path.unlink()


def sealed(key: str, content: bytes) -> bytes:
    """Prefix content with the digest of its key and itself."""
    return hashlib.sha256(f"{key}\n".encode() + content).hexdigest().encode() + content


def unsealed(key: str, content: bytes) -> bytes | None:
    """Check the digest written by :func:`sealed` and remove it; None for other keys and altered content."""
    inner = content[_DIGEST_BYTES:]
    return inner if content == sealed(key, inner) else None


def cache_folder(kind: str) -> Path | None:
    """Return the folder for entries of a kind, which need not exist; None for a user without a home."""
    root = os.environ.get("XDG_CACHE_HOME")
    if root and Path(root).is_absolute():
        return Path(root) / "planlang" / kind
    try:
        return Path.home() / ".cache" / "planlang" / kind
    except RuntimeError:
        return None


def _is_ours_alone(folder: Path) -> bool:
    """Check that only this user may write to the folder: a digest does not protect against planted files."""
    try:
        found = folder.stat()
    except OSError:
        return False
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _close_to_others(folder: Path) -> None:
    """Close a folder that a lax umask left writable for others, and delete its files, which they may have planted."""
    found = folder.stat()
    if found.st_uid == os.getuid() and found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        folder.chmod(0o700)
        for path in folder.iterdir():
            path.unlink()
