"""The rows of each of many labels: most of them sorted once, and what came later."""

from __future__ import annotations

from array import array
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.int32]


class Postings:
    """Rows of labels, both numbers from 0 on."""

    def __init__(self) -> None:
        self._first = np.zeros(1, dtype=np.int64)
        self._rows = np.zeros(0, dtype=np.int32)
        self._later: dict[int, array[int]] = {}

    def add(self, labels: Numbers, rows: Numbers) -> None:
        """Add some rows. Many at a time cost least, and the first of all."""
        if self._rows.size == 0 and len(rows) > len(self._later):
            labels = np.concatenate([labels, *(np.full(len(some), one) for one, some in self._later.items())])
            rows = np.concatenate([rows, *(of_array(some) for some in self._later.values())]).astype(np.int32)
            self._rows = rows[np.argsort(labels, kind="stable")]
            self._first = np.concatenate(([0], np.cumsum(np.bincount(labels))))
            self._later = {}
            return
        for label, row in zip(labels.tolist(), rows.tolist(), strict=True):
            self._later.setdefault(label, array("i")).append(row)

    def of(self, labels: Iterable[int]) -> Numbers:
        """Return the rows of all of some labels."""
        found = []
        for label in labels:
            if label + 1 < len(self._first):
                found.append(self._rows[self._first[label] : self._first[label + 1]])
            if label in self._later:
                found.append(of_array(self._later[label]))
        return np.concatenate(found) if found else np.zeros(0, dtype=np.int32)

    def renumber(self, used: NDArray[np.bool_], numbers: Numbers) -> None:
        """Drop the rows that are not used, and give the others their new numbers."""
        kept = used[self._rows]
        self._first = np.concatenate(([0], np.cumsum(kept)))[self._first]
        self._rows = numbers[self._rows[kept]]
        later = ((label, of_array(rows)) for label, rows in self._later.items())
        renumbered = ((label, numbers[rows[used[rows]]]) for label, rows in later)
        self._later = {label: array("i", rows.tobytes()) for label, rows in renumbered if rows.size}


def of_array(rows: array[int]) -> Numbers:
    """Return the same numbers for computing, as long as the array does not grow."""
    return np.frombuffer(rows, dtype=np.int32)
