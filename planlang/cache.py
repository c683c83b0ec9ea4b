"""Results kept between processes.

A :class:`Cache` keeps what is costly to compute and follows from its inputs alone, in the user's cache folder. An entry
is named by a key that its user makes of everything it depends on, so it never needs to be invalidated, and it begins
with a digest of its key and content: whatever is damaged, incomplete or another entry's counts as not kept and is
computed anew. An entry is written under a temporary name and then renamed, so that other processes see all of it or
nothing. Without a writable folder nothing is kept.
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
"""Length of the digest, in hexadecimal digits, in front of the content; arrays behind it are aligned."""


@dataclass(frozen=True, slots=True)
class Cache:
    """The kept entries of one kind, in a folder of their own.

    ``most`` is how many entries are kept, the most recent ones; one of more than ``largest`` bytes is not of this kind.
    """

    kind: str
    most: int
    largest: int = 64_000_000

    def load(self, key: str) -> bytes | None:
        """Return what was kept under a key; None if nothing was, or if it is not exactly that any more."""
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
        """Keep content under a key, in the place of whatever is there; False if that cannot be done."""
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
            with suppress(OSError):  # another process forgot it
                found.append((path.lstat().st_mtime, path))
        for _, path in sorted(found)[: max(0, len(found) - self.most)]:
            if path != newest:
                with suppress(OSError):
                    path.unlink()


def sealed(key: str, content: bytes) -> bytes:
    """Return content behind a digest of it and of its key."""
    return hashlib.sha256(f"{key}\n".encode() + content).hexdigest().encode() + content


def unsealed(key: str, content: bytes) -> bytes | None:
    """Return what was sealed with a key; None if that is damaged, or was sealed with another."""
    inner = content[_DIGEST_BYTES:]
    return inner if content == sealed(key, inner) else None


def cache_folder(kind: str) -> Path | None:
    """Return the folder for entries of a kind, which need not exist; None if the user has no home."""
    root = os.environ.get("XDG_CACHE_HOME")
    if root and Path(root).is_absolute():
        return Path(root) / "planlang" / kind
    try:
        return Path.home() / ".cache" / "planlang" / kind
    except RuntimeError:
        return None


def _is_ours_alone(folder: Path) -> bool:
    """Return True for this user's folder in which nobody else may write: digests do not help against planted files."""
    try:
        found = folder.stat()
    except OSError:
        return False
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _close_to_others(folder: Path) -> None:
    """Take back a folder of this user that others may write, as a lax umask made it, without what they could plant."""
    found = folder.stat()
    if found.st_uid == os.getuid() and found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        folder.chmod(0o700)
        for path in folder.iterdir():
            path.unlink()
