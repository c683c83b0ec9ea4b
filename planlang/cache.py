"""What is costly to compute and follows from its inputs alone, kept in the user's cache folder between runs.

An entry is named by a digest of everything it depends on, so it never needs to be invalidated. It is written under a
temporary name and then renamed: other processes see all of it or nothing, and two that make the same entry do no harm.
Without a writable folder nothing is kept.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path


def cache_folder(kind: str) -> Path | None:
    """Where entries of a kind are kept, whether the folder exists or not; None if the user has no home."""
    root = os.environ.get("XDG_CACHE_HOME")
    if root and Path(root).is_absolute():
        return Path(root) / "planlang" / kind
    try:
        return Path.home() / ".cache" / "planlang" / kind
    except RuntimeError:
        return None


def keep(entry: Path, write: Callable[[Path], object], *, most: int) -> bool:
    """Have ``write`` fill a temporary file and rename it to ``entry``; False if that cannot be done.

    At most ``most`` entries with the suffix of this one are kept, the most recent ones.
    """
    temporary: str | None = None
    try:
        entry.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=entry.stem + "-", suffix=entry.suffix + ".part", dir=entry.parent)
        os.close(handle)
        write(Path(temporary))
        os.replace(temporary, entry)
    except OSError:
        return False
    finally:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
    _forget_oldest(entry, most)
    return True


def _forget_oldest(entry: Path, most: int) -> None:
    found = []
    for path in entry.parent.glob(f"*{entry.suffix}"):
        try:
            found.append((path.stat().st_mtime, path))
        except OSError:  # another process forgot it
            continue
    for _, path in sorted(found)[: max(0, len(found) - most)]:
        if path != entry:
            path.unlink(missing_ok=True)
