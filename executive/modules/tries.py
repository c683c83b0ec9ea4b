"""Several ways to do something, one after another: the first problem is the one that is told."""

from __future__ import annotations

from types import TracebackType

from planlang import PlanFailure
from planlang.failures import ManipulationFailure, NavigationFailure


class Tries:
    """Attempts, each in a ``with`` of this: a failure of some classes ends the attempt only, and the first is kept."""

    def __init__(self, *kinds: type[PlanFailure]) -> None:
        """Without classes those of arms and of the base."""
        self._kinds = kinds or (ManipulationFailure, NavigationFailure)
        self.problem: PlanFailure | None = None
        self.last: PlanFailure | None = None
        """The problem of the last attempt, None if it had none."""

    def __enter__(self) -> None:
        self.last = None

    def __exit__(self, kind: type[BaseException] | None, found: BaseException | None, at: TracebackType | None) -> bool:
        if not isinstance(found, self._kinds):
            return False
        self.problem, self.last = self.problem or found, found
        return True
