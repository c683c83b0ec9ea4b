"""What looking ahead, and tidying up, has cost and may cost: numbers, unlike time, repeat exactly."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

from planlang.records import dataclass

T = TypeVar("T")

MOST_BATCHES = 24
"""Batches of base poses with which one door is closed again, in all attempts, until it is shut."""

AT_FIRST = 4
"""Batches that take as long as a search takes before its first one."""


@dataclass(slots=True)
class Spent:
    """Counts of looking ahead."""

    questions: int = 0
    """Candidates of which was asked whether they leave a way."""
    searches: int = 0
    """Searches for a base pose in a state that is supposed."""
    checks: int = 0
    """Base poses that were checked exactly in one."""


@dataclass(slots=True)
class Share:
    """Searching that is left for what no later step needs, as closing a door again."""

    batches: int = MOST_BATCHES

    def renew(self) -> None:
        """Leave as much as at first: what it was for has been done."""
        self.batches = MOST_BATCHES

    @property
    def is_used_up(self) -> bool:
        """Whether nothing more is searched."""
        return self.batches <= 0

    def within(self, candidates: Iterable[T | None]) -> Iterator[T | None]:
        """Yield candidates, of which each None ends a batch, until the share is used up."""
        if self.is_used_up:
            return
        self.batches -= AT_FIRST
        for candidate in candidates:
            yield candidate
            self.batches -= candidate is None
            if self.is_used_up:
                return
