"""Results that are remembered by the digest of what they were made from, the latest asked for, up to some bytes."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterable
from typing import Generic, TypeVar

T = TypeVar("T")
OVERHEAD = 200
"""Bytes that remembering something takes beside it."""


class Remembered(Generic[T]):
    """Results by keys of fixed size; which was not asked for longest is forgotten first. Threads may share it."""

    def __init__(self, most: int) -> None:
        """Remember ``most`` bytes."""
        self._most, self._bytes = most, 0
        self._known: dict[bytes, tuple[T, int]] = {}
        self._lock = threading.Lock()

    def get(self, key: bytes) -> T | None:
        """Return a result, None for one that is not known any more."""
        with self._lock:
            if key not in self._known:
                return None
            result, _ = self._known[key] = self._known.pop(key)
            return result

    def keep(self, key: bytes, result: T, size: int) -> T:
        """Remember a result of some bytes and return it; what is larger than everything permitted is not kept."""
        with self._lock:
            _, before = self._known.pop(key, (result, 0))
            self._known[key] = result, size + OVERHEAD
            self._bytes += size + OVERHEAD - before
            while self._bytes > self._most:
                _, freed = self._known.pop(next(iter(self._known)))
                self._bytes -= freed
        return result


def digest(parts: Iterable[str]) -> bytes:
    """Return the digest of texts, another one for any other texts."""
    each = (hashlib.sha256(part.encode(errors="surrogatepass")).digest() for part in parts)
    return hashlib.sha256(b"".join(each)).digest()
