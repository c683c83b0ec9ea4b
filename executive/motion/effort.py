"""Search budgets in units that are the same on every machine: results never depend on the clock."""

from __future__ import annotations

from executive.motion.errors import OutOfEffort
from planlang.kernel import still_computing
from planlang.records import dataclass


@dataclass(slots=True)
class Effort:
    """Budget of a search, counted in units of computing; interrupting the run ends the search as well."""

    most: int
    unit: str
    """Name of the unit."""
    spent: int = 0

    def spend(self, units: int) -> None:
        """Add to the count; raises :class:`OutOfEffort` beyond the budget, and Evaporated after an interrupt."""
        still_computing()
        self.spent += units
        if self.spent > self.most:
            raise OutOfEffort(self.most, self.unit)
