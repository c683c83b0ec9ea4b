"""What a run may search for places before it gives up: a number, which unlike time repeats exactly."""

from __future__ import annotations

from planlang.designators import Location
from planlang.failures import BudgetExceeded
from planlang.records import dataclass

SEARCHES = "searches for places"
"""What a failure says was used up."""


@dataclass(slots=True, eq=False)
class SearchCount:
    """Number of searches for base poses that somebody waits for.

    Those that only ask whether there is one are part of another search, which bounds them.
    """

    most: int | None = None
    """Number after which no further search begins; None: any number."""
    used: int = 0
    last: Location | None = None
    """What was searched for last."""

    def begin(self, location: Location) -> None:
        """Count a search. Raises BudgetExceeded if it is one too many."""
        if self.most is not None and self.used >= self.most:
            message = f"{self.used} {SEARCHES} are used up, the last for {self.last}; another was asked for {location}"
            raise BudgetExceeded(message, used={SEARCHES: self.most})
        self.last = location
        self.used += 1

    def allow(self, more: int) -> None:
        """Let so many more searches begin from now on."""
        if self.most is not None:
            self.most = max(self.most, self.used + more)
