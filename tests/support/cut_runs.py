"""Runs that were killed, for tests of resuming and replaying: what is left of them, and what has to be the same."""

from collections.abc import Awaitable, Callable
from typing import Any

from planlang.runs import RecordedRun
from planlang.testing import PlanRun, replay


def cut(run: PlanRun[Any], records: int) -> RecordedRun:
    """Return what is left of a run that was killed after so many records."""
    return RecordedRun.of(run.trace.events[:records])


def completed(run: PlanRun[Any]) -> list[int]:
    """After how many records each step had completed."""
    return [number for number, event in enumerate(run.trace.events, 1) if event["event"] == "completed"]


def without_mark(run: PlanRun[Any]) -> list[dict[str, Any]]:
    """The trace without the record that says where it was resumed."""
    return [event for event in run.trace.events if event["event"] != "resumed"]


def at_every_cut(top: Callable[[], Awaitable[Any]], run: PlanRun[Any]) -> list[int]:
    """After how many records of a run its replay is not equal."""
    return [n for n in range(1, len(run.trace.events) + 1) if not replay(top, cut(run, n)).equal]


def difference(top: Callable[[], Awaitable[Any]], run: PlanRun[Any]) -> tuple[Any, Any]:
    """Return what was recorded and what was found at the first difference."""
    found = replay(top, run).difference
    assert found is not None
    return found.recorded, found.found
