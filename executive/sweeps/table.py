"""Statistics of a sweep: outcomes with confidence intervals, causes of failure by frequency, plan times."""

from __future__ import annotations

import csv
import io
import math
import re
import statistics
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from executive.sweeps.records import CRASHED, DONE, Row, first_sentence, is_reached
from planlang.proportions import wilson
from planlang.records import dataclass
from planlang.visible import visible

REACHED = "reached"
FALSE_SUCCESS = "false success"
"""What the plan calls done in a world in which its goal does not hold."""


@dataclass(frozen=True, slots=True)
class Share:
    """Number of worlds with an outcome, and the 95 % confidence interval of its probability."""

    outcome: str
    count: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Cause:
    """A cause of failure, its number of worlds, and the command that repeats the first of them."""

    name: str
    """Class of the failure and of its causes, joined by ``<``."""
    sentence: str
    """First sentence of the message in the first of these worlds."""
    count: int
    world: Any
    repeat: str


def shares(rows: Sequence[Row]) -> list[Share]:
    """Count the worlds by outcome; "reached", "failed" and "crashed" come first."""
    counts = Counter({REACHED: 0, "failed": 0, CRASHED: 0})
    counts.update(map(outcome_of, rows))
    return [Share(name, count, *wilson(count, len(rows))) for name, count in counts.items()]


def causes(rows: Sequence[Row]) -> list[Cause]:
    """The causes of failure, most frequent first."""
    return [cause for cause, _ in rows_by_cause(rows)]


def rows_by_cause(rows: Sequence[Row]) -> list[tuple[Cause, Sequence[Row]]]:
    """Group failed worlds by cause, most frequent first; messages that differ only in numbers are one cause."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if not is_reached(row):
            name, sentence = cause_of(row)
            found.setdefault((name, re.sub(r"\d+(\.\d+)?", "#", sentence)), []).append(row)
    ranked = sorted(found.items(), key=lambda item: -len(item[1]))
    return [
        (Cause(name, cause_of(same[0])[1], len(same), same[0]["world"], str(same[0].get("repeat", ""))), same)
        for (name, _), same in ranked
    ]


def cause_of(row: Row) -> tuple[str, str]:
    """Classes of a world's failure and its causes, and the first sentence of the message."""
    failure = row.get("failure") or [outcome_of(row)]
    sentence = first_sentence(str(row.get("message") or row.get("cause") or ""))
    return " < ".join(map(str, failure)), sentence.removeprefix(f"{failure[0]}: ")


def table(rows: Sequence[Row], total: int | None = None) -> str:
    """Format the statistics as text; ``total`` is the number of worlds in the whole sweep."""
    number = len(rows) if total in (None, len(rows)) else f"{len(rows)} of {total}"
    lines = [f"{number} world" + "s" * (number != 1)]
    for one in shares(rows):
        part = one.count / len(rows) if rows else 0.0
        interval = f"95 %: {100 * one.low:.1f} to {100 * one.high:.1f} %"
        lines.append(f"{one.outcome:<20}{one.count:>7}  {100 * part:5.1f} %  ({interval})")
    if anyway := sum(row.get("reached") is True and row.get("outcome") != DONE for row in rows):
        lines.append(f"in {anyway} of these the goal holds although the plan did not end as done")
    lines += filter(None, [fault_line(rows)])
    times = sorted(row["duration"] for row in rows if is_reached(row) and "duration" in row)
    if times:
        late = times[math.ceil(0.95 * len(times)) - 1]
        lines.append(f"plan time where reached: median {statistics.median(times):.1f} s, 95 % within {late:.1f} s")
    lines += _cause_lines(causes(rows))
    return "\n".join(lines)


def fault_line(rows: Sequence[Row]) -> str:
    """Say how many faults happened in the worlds, of those that were stated and in a run; empty without faults."""
    told = [row["faults"] for row in rows if isinstance(row.get("faults"), dict)]
    if not told:
        return ""
    fired, stated = sum(len(one["fired"]) for one in told), sum(one["stated"] for one in told)
    opportunities = sum(one["opportunities"] for one in told) / len(told)
    often = f"{fired / len(told):.2f} faults a run, at {opportunities:.1f} opportunities"
    if not stated:
        return often
    return f"{often}; of {stated} that were stated, {stated - sum(len(one['never']) for one in told)} happened"


def csv_text(rows: Sequence[Row]) -> str:
    """Format the rows as CSV; lists are joined, nested objects left out."""
    flat = [{key: _cell(value) for key, value in row.items() if not isinstance(value, dict)} for row in rows]
    names = dict.fromkeys(name for row in flat for name in row)
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return text.getvalue()


def _cell(value: Any) -> Any:
    text = " < ".join(map(str, value)) if isinstance(value, list) else value
    return visible(text) if isinstance(text, str) else text


def _cause_lines(found: Sequence[Cause]) -> Iterator[str]:
    if found:
        yield "\ncauses"
    for one in found:
        yield f"{one.count:>7}  {one.name}: {one.sentence}" if one.sentence else f"{one.count:>7}  {one.name}"
        yield f"         {one.repeat or f'world {one.world}'}"


def outcome_of(row: Row) -> str:
    """How a world ended, in the words of tables."""
    if is_reached(row):
        return REACHED
    outcome = str(row.get("outcome"))
    return FALSE_SUCCESS if outcome == DONE else outcome
