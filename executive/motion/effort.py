"""Bounds on what searches compute, in units that are the same on every machine: the clock decides nothing."""

from __future__ import annotations

from executive.motion.errors import OutOfEffort
from planlang.kernel import still_computing
from planlang.records import dataclass


@dataclass(slots=True)
class Effort:
    """Count of what a search has computed, and its bound; a run that is interrupted ends it, too."""

    most: int
    unit: str
    """Name of what is counted."""
    spent: int = 0

    def spend(self, units: int) -> None:
        """Count so many units more; raises :class:`OutOfEffort`, and Evaporated when the run was interrupted."""
        still_computing()
        self.spent += units
        if self.spent > self.most:
            raise OutOfEffort(self.most, self.unit)
