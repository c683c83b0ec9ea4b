"""What looking ahead has cost, in a decision or in a run: numbers, unlike time, repeat exactly."""

from __future__ import annotations

from planlang.records import dataclass


@dataclass(slots=True)
class Spent:
    """Counts of looking ahead."""

    questions: int = 0
    """Candidates of which was asked whether they leave a way."""
    searches: int = 0
    """Searches for a base pose in a state that is supposed."""
    checks: int = 0
    """Base poses that were checked exactly in one."""
