"""Progress reports of long work: a description, and the share that is done."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext

Share = Callable[[float], None]
"""Called with the share of the work that is done, from 0 at its start to 1 at its end."""
Report = Callable[[str, float], None]
"""Called with a description of the work and its share; NaN if the end is unknown."""

Waiting = Callable[..., AbstractContextManager[None]]
"""Entered around work whose end is unknown; takes a function that describes it, and optionally its time limit [s]."""


def unreported(what: str, share: float) -> None:
    """Ignore progress."""


def uncounted(share: float) -> None:
    """Ignore the share of undescribed work."""


def unwatched(what: Callable[[], str], most: float | None = None) -> AbstractContextManager[None]:
    """Show no progress of work whose end is unknown."""
    return nullcontext()


def part(share: Share, first: float, last: float) -> Share:
    """Scale the progress of a part to the range from ``first`` to ``last`` of the whole."""
    return lambda done: share(first + (last - first) * done)
