"""Progress of long work: what is being done, and which share of it is done."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Share = Callable[[float], None]
"""Given the share of a piece of work that is done: 0 when it begins, 1 when it has ended."""
Report = Callable[[str, float], None]
"""Given what is being done, in words, and its share; NaN where the end is unknown."""

Waiting = Callable[..., AbstractContextManager[None]]
"""Entered around work whose end is unknown; takes a function that describes it, and optionally its time limit [s]."""


def unreported(what: str, share: float) -> None:
    """Show no progress."""


def uncounted(share: float) -> None:
    """Show no progress of a piece of work without words."""


def unwatched(what: Callable[[], str], most: float | None = None) -> AbstractContextManager[None]:
    """Show no progress of work whose end is unknown."""
    return nullcontext()


def part(share: Share, first: float, last: float) -> Share:
    """Return the share of a part of the work: from ``first`` to ``last`` of the whole."""
    return lambda done: share(first + (last - first) * done)
