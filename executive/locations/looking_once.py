"""What is found out about base poses and poses of hands, once for all that are the same."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array

T = TypeVar("T")


def as_keys(rows: Array) -> list[bytes]:
    """Return rows (n, k) as values that can be looked up."""
    keys: list[bytes] = np.ascontiguousarray(rows).view(f"V{rows.itemsize * rows.shape[1]}").ravel().tolist()
    return keys


def once(known: dict[bytes, T], rows: Array, find: Callable[[Array], Sequence[T]]) -> list[T]:
    """Return what is ``known`` of rows (n, k); of those of which nothing is known it is found."""
    keys = as_keys(rows)
    new = {key: number for number, key in enumerate(keys) if key not in known}
    known.update(zip(new, find(rows[list(new.values())]), strict=True))
    return [known[key] for key in keys]


Numbered = tuple[Array, NDArray[np.intp]]
"""Different rows (u, k), and which of these each row of a table is (n,)."""


def numbered(rows: Array) -> Numbered:
    """Return the different ones of rows (n, k): equal ones come together in the order of a sum that few others have."""
    order = np.argsort(rows @ np.sqrt(np.arange(2.0, rows.shape[1] + 2.0)))
    new = np.append(True, (np.diff(rows[order], axis=0) != 0.0).any(axis=1))[: len(rows)]
    number = np.empty(len(rows), np.intp)
    number[order] = np.cumsum(new) - 1
    return rows[order[new]], number


class LookedAt(Generic[T]):
    """What is found out about rows (n, k) of a table, bit by bit; ``known`` before, and of more from then on."""

    def __init__(self, rows: Numbered, known: dict[bytes, T], find: Callable[[Array], Sequence[T]]) -> None:
        self._rows, self._number, self._known, self._find = *rows, known, find
        self._done, self._found = np.zeros(len(self._rows), bool), np.empty(len(self._rows), object)

    def __call__(self, index: NDArray[np.intp]) -> list[T]:
        """Return what is found about some of the rows, by numbers (m,)."""
        number = self._number[index]
        new = np.unique(number[~self._done[number]])
        if len(new):
            self._found[new] = once(self._known, self._rows[new], self._find)
            self._done[new] = True
        return list(self._found[number])
