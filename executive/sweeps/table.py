"""What the rows of a sweep come to: outcomes with their intervals, causes by how often they occur, plan times."""

from __future__ import annotations

import csv
import io
import math
import re
import statistics
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from executive.sweeps.records import CRASHED, Row, first_sentence, is_reached
from planlang.records import dataclass

REACHED = "reached"
_Z = 1.959964
"""Of the standard normal distribution: 95 % lie within so many deviations."""


@dataclass(frozen=True, slots=True)
class Share:
    """The number of worlds with an outcome, and the 95 % interval of its probability."""

    outcome: str
    count: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Cause:
    """A way to fail, how many worlds did so, and the command that repeats the first of them."""

    name: str
    """The class of the failure, and of what it came from."""
    sentence: str
    """The first sentence of its message, in the first of these worlds."""
    count: int
    world: Any
    repeat: str


def wilson(count: int, total: int) -> tuple[float, float]:
    """Return the 95 % interval of a probability after ``count`` of ``total``, by Wilson's score."""
    if total == 0:
        return 0.0, 1.0
    share, square = count / total, _Z * _Z / total
    middle = (share + square / 2) / (1 + square)
    half = _Z / (1 + square) * math.sqrt(share * (1 - share) / total + square / (4 * total))
    return max(0.0, middle - half), min(1.0, middle + half)


def shares(rows: Sequence[Row]) -> list[Share]:
    """Return how many worlds ended how: what was reached, what failed and what crashed first."""
    counts = Counter({REACHED: 0, "failed": 0, CRASHED: 0})
    counts.update(map(_outcome, rows))
    return [Share(name, count, *wilson(count, len(rows))) for name, count in counts.items()]


def causes(rows: Sequence[Row]) -> list[Cause]:
    """Return why worlds were not reached, most frequent first; messages that differ in numbers only are one cause."""
    found: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if not is_reached(row):
            name, sentence = _cause(row)
            found.setdefault((name, re.sub(r"\d+(\.\d+)?", "#", sentence)), []).append(row)
    ranked = sorted(found.items(), key=lambda item: -len(item[1]))
    return [
        Cause(name, _cause(same[0])[1], len(same), same[0]["world"], str(same[0].get("repeat", "")))
        for (name, _), same in ranked
    ]


def table(rows: Sequence[Row], total: int | None = None) -> str:
    """Return the table as text; ``total`` is the number of worlds that there should be."""
    number = len(rows) if total in (None, len(rows)) else f"{len(rows)} of {total}"
    lines = [f"{number} world" + "s" * (number != 1)]
    for one in shares(rows):
        part = one.count / len(rows) if rows else 0.0
        interval = f"95 %: {100 * one.low:.1f} to {100 * one.high:.1f} %"
        lines.append(f"{one.outcome:<20}{one.count:>7}  {100 * part:5.1f} %  ({interval})")
    times = sorted(row["duration"] for row in rows if is_reached(row) and "duration" in row)
    if times:
        late = times[math.ceil(0.95 * len(times)) - 1]
        lines.append(f"plan time where reached: median {statistics.median(times):.1f} s, 95 % within {late:.1f} s")
    lines += _cause_lines(causes(rows))
    return "\n".join(lines)


def csv_text(rows: Sequence[Row]) -> str:
    """Return the rows as CSV: what is a list is joined, what is deeper is left out."""
    flat = [{key: _cell(value) for key, value in row.items() if not isinstance(value, dict)} for row in rows]
    names = dict.fromkeys(name for row in flat for name in row)
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(flat)
    return text.getvalue()


def _cell(value: Any) -> Any:
    return " < ".join(map(str, value)) if isinstance(value, list) else value


def _cause_lines(found: Sequence[Cause]) -> Iterator[str]:
    if found:
        yield "\ncauses"
    for one in found:
        yield f"{one.count:>7}  {one.name}: {one.sentence}" if one.sentence else f"{one.count:>7}  {one.name}"
        yield f"         {one.repeat or f'world {one.world}'}"


def _outcome(row: Row) -> str:
    if is_reached(row):
        return REACHED
    outcome = str(row.get("outcome"))
    return "goal not reached" if outcome == "done" else outcome


def _cause(row: Row) -> tuple[str, str]:
    """Return the classes of what ended a world, and the first sentence of its message."""
    failure = row.get("failure") or [_outcome(row)]
    sentence = first_sentence(str(row.get("message") or row.get("cause") or ""))
    return " < ".join(map(str, failure)), sentence.removeprefix(f"{failure[0]}: ")
