"""Results about base poses and hand poses, computed once for equal ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from planlang.geometry import Array

T = TypeVar("T")


def as_keys(rows: Array) -> list[bytes]:
    """Convert rows (n, k) to hashable values."""
    keys: list[bytes] = np.ascontiguousarray(rows).view(f"V{rows.itemsize * rows.shape[1]}").ravel().tolist()
    return keys


def once(known: dict[bytes, T], rows: Array, find: Callable[[Array], Sequence[T]]) -> list[T]:
    """Look up results about rows (n, k); ``find`` computes those that are not ``known``."""
    keys = as_keys(rows)
    if new := {key: number for number, key in enumerate(keys) if key not in known}:
        known.update(zip(new, find(rows[list(new.values())]), strict=True))
    return [known[key] for key in keys]
