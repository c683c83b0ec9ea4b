"""Resuming a run: which records agree with it, what it takes over, and how the world gets back to where it was."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from planlang.kernel import Scheduler, Trace
from planlang.kernel.answers import Noted
from planlang.kernel.continued import Continued
from planlang.kernel.journal import Journal
from planlang.language.budgets import charge

if TYPE_CHECKING:
    from planlang.kernel.past import Past
    from planlang.language.executive import Executive


def differences(recorded: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """What is recorded otherwise than it is now: key -> (recorded, now), for the keys of ``now``."""
    return {key: (recorded.get(key), value) for key, value in now.items() if recorded.get(key) != value}


def refuse_other(past: Past, now: Mapping[str, Any]) -> None:
    """Raise ValueError if the past is that of another run than one with ``now`` in its header."""
    if past.recorded.header.get("resumable") is not True:
        raise ValueError("the trace does not tell which steps have completed: it was not written with resumable=True")
    found = differences(past.recorded.header, now)
    if found:
        told = "; ".join(f"{key} was {before!r} and is {after!r}" for key, (before, after) in found.items())
        raise ValueError(f"the trace is that of another run: {told}")


def restore(executive: object, past: Past) -> bool:
    """Bring world and belief to where the past left them; False if the past or the executive cannot tell.

    Raises ValueError when what was recorded does not fit.
    """
    back = getattr(executive, "restore", None)
    if past.last is None:
        return True
    if back is None or past.left is None:
        return False
    back(past.left)
    return True


def prepare(scheduler: Scheduler, trace: Trace, executive: Executive | None, past: Past | None) -> Trace:
    """Give a scheduler its journal; returns the trace to write into."""
    snapshot = getattr(executive, "snapshot", None)
    journal = scheduler.journal = Journal(scheduler, snapshot=snapshot, past=past, account=charge)
    scheduler.answers = Noted(scheduler, past)
    if past is None:
        return trace
    ahead = journal.ahead = Continued(trace, past)
    if past.last is None:
        journal.go_on()
    return ahead


def check_repeated(scheduler: Scheduler) -> None:
    """Raise Different if a resumed plan has ended otherwise than by going on from its past."""
    ahead = None if scheduler.journal is None else scheduler.journal.ahead
    if ahead is not None:
        ahead.check(sys.maxsize)
