"""Alternatives tried one after another: if all fail, the first failure is the one to report."""

from __future__ import annotations

from types import TracebackType

from planlang.failures import ManipulationFailure, NavigationFailure, PlanFailure


class Tries:
    """Context manager around each attempt: suppresses failures of some classes and keeps the first."""

    def __init__(self, *kinds: type[PlanFailure]) -> None:
        """Suppress failures of ``kinds``; by default those of manipulation and navigation."""
        self._kinds = kinds or (ManipulationFailure, NavigationFailure)
        self.problem: PlanFailure | None = None
        """First failure of any attempt."""
        self.last: PlanFailure | None = None
        """Failure of the last attempt, None if it succeeded."""

    def __enter__(self) -> None:
        self.last = None

    def __exit__(
        self, kind: type[BaseException] | None, failure: BaseException | None, at: TracebackType | None
    ) -> bool:
        if not isinstance(failure, self._kinds):
            return False
        self.problem, self.last = self.problem or failure, failure
        return True
