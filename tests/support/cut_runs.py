"""Runs that were killed, for tests of resuming: what is left of them, and what has to be the same."""

from typing import Any

from planlang.runs import RecordedRun
from planlang.testing import PlanRun


def cut(run: PlanRun[Any], records: int) -> RecordedRun:
    """Return what is left of a run that was killed after so many records."""
    return RecordedRun.of(run.trace.events[:records])


def completed(run: PlanRun[Any]) -> list[int]:
    """After how many records each step had completed."""
    return [number for number, event in enumerate(run.trace.events, 1) if event["event"] == "completed"]


def without_mark(run: PlanRun[Any]) -> list[dict[str, Any]]:
    """The trace without the record that says where it was resumed."""
    return [event for event in run.trace.events if event["event"] != "resumed"]
