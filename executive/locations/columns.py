"""Tables of candidates: parallel arrays with one row per candidate, which are selected and joined together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from planlang.records import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Base class of tables: array fields are the columns, other fields apply to all rows."""

    def chosen(self, rows: ArrayLike) -> Self:
        """Select rows by indices or a mask."""
        index = np.asarray(rows)
        return replace(self, **{name: getattr(self, name)[index] for name in self._columns()})

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Concatenate the rows of one or more tables; other fields are taken from the first."""
        names = parts[0]._columns()
        return replace(parts[0], **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})

    def _columns(self) -> list[str]:
        return [field.name for field in fields(self) if isinstance(getattr(self, field.name), np.ndarray)]
