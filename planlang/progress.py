"""Progress reports of long work: a description, and the share that is done."""

from __future__ import annotations

from collections.abc import Callable

Share = Callable[[float], None]
"""Called with the share of the work that is done, from 0 at its start to 1 at its end."""
Report = Callable[[str, float], None]
"""Called with a description of the work and its share; NaN if the end is unknown."""


def unreported(what: str, share: float) -> None:
    """Ignore progress."""


def uncounted(share: float) -> None:
    """Ignore the share of undescribed work."""


def part(share: Share, first: float, last: float) -> Share:
    """Scale the progress of a part to the range from ``first`` to ``last`` of the whole."""
    return lambda done: share(first + (last - first) * done)
