"""Candidates in columns: arrays of which each has one row for each candidate, chosen and joined together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from planlang.records import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Base class of tables: its fields that are arrays are the columns, the others apply to all rows."""

    def chosen(self, rows: ArrayLike) -> Self:
        """Return some of the rows, by indices or a mask."""
        index = np.asarray(rows)
        return replace(self, **{name: getattr(self, name)[index] for name in self._columns()})

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of one or more tables, one after another; all else is that of the first."""
        names = parts[0]._columns()
        return replace(parts[0], **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})

    def _columns(self) -> list[str]:
        return [field.name for field in fields(self) if isinstance(getattr(self, field.name), np.ndarray)]
