"""Progress of long work: what is being done, and which share of it is done."""

from __future__ import annotations

from collections.abc import Callable

Share = Callable[[float], None]
"""Given the share of a piece of work that is done: 0 when it begins, 1 when it has ended."""
Report = Callable[[str, float], None]
"""Given what is being done, in words, and its share; NaN where the end is unknown."""


def unreported(what: str, share: float) -> None:
    """Show no progress."""


def uncounted(share: float) -> None:
    """Show no progress of a piece of work without words."""


def part(share: Share, first: float, last: float) -> Share:
    """Return the share of a part of the work: from ``first`` to ``last`` of the whole."""
    return lambda done: share(first + (last - first) * done)
