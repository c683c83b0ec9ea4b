"""Results about base poses and hand poses, computed once for equal ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array

T = TypeVar("T")


def as_keys(rows: Array) -> list[bytes]:
    """Convert rows (n, k) to hashable values."""
    keys: list[bytes] = np.ascontiguousarray(rows).view(f"V{rows.itemsize * rows.shape[1]}").ravel().tolist()
    return keys


def once(known: dict[bytes, T], rows: Array, find: Callable[[Array], Sequence[T]]) -> list[T]:
    """Look up results about rows (n, k); ``find`` computes those that are not ``known``."""
    keys = as_keys(rows)
    new = {key: number for number, key in enumerate(keys) if key not in known}
    known.update(zip(new, find(rows[list(new.values())]), strict=True))
    return [known[key] for key in keys]


Numbered = tuple[Array, NDArray[np.intp]]
"""Distinct rows (u, k), and the index of each table row among them (n,)."""


def numbered(rows: Array) -> Numbered:
    """Find the distinct ones of rows (n, k), sorted by a weighted sum that rarely coincides for different rows."""
    order = np.argsort(rows @ np.sqrt(np.arange(2.0, rows.shape[1] + 2.0)))
    new = np.append(True, (np.diff(rows[order], axis=0) != 0.0).any(axis=1))[: len(rows)]
    number = np.empty(len(rows), np.intp)
    number[order] = np.cumsum(new) - 1
    return rows[order[new]], number


class CachedRows(Generic[T]):
    """Results about the rows (n, k) of a table, computed on demand and kept in ``known``."""

    def __init__(self, rows: Numbered, known: dict[bytes, T], find: Callable[[Array], Sequence[T]]) -> None:
        self._rows, self._number, self._known, self._find = *rows, known, find
        self._done, self._found = np.zeros(len(self._rows), bool), np.empty(len(self._rows), object)

    def __call__(self, index: NDArray[np.intp]) -> list[T]:
        """Get the results for some rows, by index (m,)."""
        number = self._number[index]
        new = np.unique(number[~self._done[number]])
        if len(new):
            self._found[new] = once(self._known, self._rows[new], self._find)
            self._done[new] = True
        return list(self._found[number])
