"""The tables of the series, in Markdown: what was reached, recovered, noticed and named, with 95 % intervals."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from executive.sweeps import Row
from executive.sweeps.records import CRASHED
from planlang.faults.kinds import kind_of
from planlang.proportions import wilson

BEGIN, END = "<!-- begin of the measurements -->", "<!-- end of the measurements -->"
SOON = 1.0
"""Time within which what a sense carries should be noticed [s]."""


def tables(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of all tables."""
    rates = [row for row in rows if row.get("kind") is None]
    kinds = [row for row in rows if row.get("kind") is not None]
    if rates:
        yield from _grid(RATE_HEAD, [_rate(some) for some in _groups(rates, _cell_of).values()])
    if kinds:
        yield from ("",) if rates else ()
        yield from _grid(KIND_HEAD, [_kind(some) for some in _groups(kinds, lambda row: row["kind"]).values()])
    yield ""
    yield from _totals(rows)
    if wrong := [*_wrong(rows)]:
        yield ""
        yield from _grid(("what", "where", "said", "command"), wrong)


# Rates

RATE_HEAD = (
    "task", "robot", "camera", "rate", "recoveries", "worlds", "reached", "faults a run", "reached given a fault",
    "false successes", "in vain held", "mute", "plan time [s]", "CPU [s]",
)  # fmt: skip


def _cell_of(row: Row) -> Hashable:
    return tuple(row.get(key) for key in ("task", "robot", "camera", "rate", "bare"))


def _rate(rows: Sequence[Row]) -> list[str]:
    first = rows[0]
    fired = [row for row in rows if row.get("faults")]
    often = sum(len(row.get("faults", ())) for row in rows) / len(rows)
    return [
        str(first["task"]),
        str(first["robot"]),
        str(first["camera"]),
        f"{first['rate']:g}",
        "no" if first["bare"] else "yes",
        str(len(rows)),
        share(count(rows, is_reached), len(rows)),
        f"{often:.2f}",
        share(count(fired, is_reached), len(fired)),
        *_ends(rows),
        _median(row["duration"] for row in rows if is_reached(row)),
        _median(row["cpu"] for row in rows if "cpu" in row),
    ]


# Kinds

KIND_HEAD = (
    "fault", "task", "happened", "recovered", "noticed within 1 s", "harmless", "not sensed", "noticed after [s]",
    "named when noticed", "named at the end", "false successes", "in vain held", "mute",
)  # fmt: skip


def _kind(rows: Sequence[Row]) -> list[str]:
    fired = [row for row in rows if row.get("faults")]
    failed = [row for row in fired if row.get("failure")]
    found = [one for row in fired for one in row["faults"] if one["kind"] == row["kind"]]
    sensed = [one for one in found if one["carried"] is not None]
    times = [one["noticed"] - one["time"] for one in found if one["noticed"] is not None]
    told = [one for one in found if one["failure"]]
    return [
        f"`{rows[0]['kind']}`",
        str(rows[0]["task"]),
        f"{len(fired)} of {len(rows)}",
        share(count(fired, is_reached), len(fired)),
        share(count(sensed, is_soon), len(sensed)),
        str(sum(count(row["faults"], is_unnoticed) for row in fired if is_reached(row))),
        str(len(found) - len(sensed)),
        f"{median(times):.1f}" if times else "-",
        share(count(told, is_named), len(told)),
        share(count(failed, is_cause_named), len(failed)),
        *_ends(rows),
    ]


# All


def _totals(rows: Sequence[Row]) -> Iterator[str]:
    """Yield a line for each figure over all runs with recoveries."""
    whole = [row for row in rows if not row.get("bare")]
    stated = [row for row in whole if row.get("kind") is not None and row.get("faults")]
    fired = [row for row in whole if row.get("faults")]
    found = [one for row in stated for one in row["faults"]]
    sensed = [one for one in found if one["carried"] is not None]
    told = [one for one in found if one["failure"]]
    failed = [row for row in fired if row.get("failure")]
    yield "With recoveries, over all worlds:"
    yield ""
    if stated:
        harmless = sum(count(row["faults"], is_unnoticed) for row in stated if is_reached(row))
        yield f"* recovered from a stated fault that happened: {share(count(stated, is_reached), len(stated))}"
        yield (
            f"* noticed within 1 s of what a sense carries: {share(count(sensed, is_soon), len(sensed))}; "
            f"{harmless} were not noticed, and did no harm; no sense carried {len(found) - len(sensed)} of {len(found)}"
        )
        yield f"* named by the first failure after it: {share(count(told, is_named), len(told))}"
    yield f"* reached although something went wrong: {share(count(fired, is_reached), len(fired))}"
    yield f"* named by the failure that ends the run: {share(count(failed, is_cause_named), len(failed))}"
    yield f"* false successes: {share(count(whole, is_false), len(whole))}"
    yield f"* said to be held, and was not: {share(count(whole, is_held_in_vain), len(whole))}"
    yield f"* ended without a statement: {share(count(whole, is_mute), len(whole))}"


def _wrong(rows: Sequence[Row]) -> Iterator[Sequence[str]]:
    """Yield what nobody should do without looking into it, with its command."""
    of: Sequence[tuple[str, Callable[[Row], bool]]] = (
        ("false success", is_false),
        ("held in vain", is_held_in_vain),
        ("mute", is_mute),
        ("another cause named", lambda row: bool(row.get("faults") and row.get("failure")) and not is_cause_named(row)),
    )
    for what, is_such in of:
        for row in rows:
            if not row.get("bare") and is_such(row):
                kinds = ", ".join(one["kind"] for one in row.get("faults", ()))
                said = " < ".join(row.get("failure", ())) or str(row.get("message", "")).partition("\n")[0]
                yield what, f"{row['task']}: {kinds}", _plain(said), f"`{row.get('repeat', '')}`"


def is_reached(row: Row) -> bool:
    """Check whether the plan ended as done, and its goals hold in the true world."""
    return bool(row.get("claimed")) and bool(row.get("reached"))


def is_false(row: Row) -> bool:
    """Check whether a plan says done in a world in which its goals do not hold."""
    return bool(row.get("claimed")) and not row.get("reached")


def is_held_in_vain(row: Row) -> bool:
    """Check whether a robot said at the end, or believed for a while, that it held what it did not."""
    return bool(row.get("in_vain") or row.get("held_in_vain"))


def is_mute(row: Row) -> bool:
    """Check whether a run ended without a statement: neither done nor with a failure of the plan."""
    return row.get("outcome") == CRASHED or not (row.get("claimed") or row.get("failure"))


def is_soon(fault: Mapping[str, Any]) -> bool:
    """Check whether a fault was noticed within a second after a sense carried it."""
    noticed, carried = fault["noticed"], fault["carried"]
    return noticed is not None and carried is not None and noticed - carried <= SOON


def is_unnoticed(fault: Mapping[str, Any]) -> bool:
    """Check whether a sense carried a fault, and nothing shows that it was noticed."""
    return fault["carried"] is not None and fault["noticed"] is None


def is_named(fault: Mapping[str, Any]) -> bool:
    """Check whether the first failure after a fault names it, or what the table declares as its consequence."""
    kind = kind_of(*str(fault["kind"]).split(":"))
    return kind is not None and bool(set(kind.shows) & set(fault["failure"]))


def is_cause_named(row: Row) -> bool:
    """Check whether the failure that ends a run names a fault that happened, or a declared consequence of it."""
    return any(is_named({**one, "failure": row.get("failure", ())}) for one in row.get("faults", ()))


def count(found: Sequence[Any], is_such: Callable[[Any], bool]) -> int:
    """Count what is such."""
    return sum(map(is_such, found))


def share(good: int, total: int) -> str:
    """A share with its interval."""
    if not total:
        return "-"
    low, high = wilson(good, total)
    return f"{good} of {total} ({100 * low:.0f} to {100 * high:.0f} %)"


def _ends(rows: Sequence[Row]) -> tuple[str, str, str]:
    return str(count(rows, is_false)), str(count(rows, is_held_in_vain)), str(count(rows, is_mute))


def _median(values: Iterable[float]) -> str:
    found = [*values]
    return f"{median(found):.1f}" if found else "-"


def _groups(rows: Sequence[Row], key: Callable[[Row], Hashable]) -> Mapping[Hashable, list[Row]]:
    groups = defaultdict[Hashable, list[Row]](list)
    for row in rows:
        groups[key(row)].append(row)
    return groups


def _plain(text: str) -> str:
    return text.replace("|", "/").replace("\n", " ")[:160]


def _grid(head: Sequence[str], lines: Iterable[Sequence[str]]) -> Iterator[str]:
    yield f"| {' | '.join(head)} |"
    yield f"|{len(head) * '---|'}"
    yield from (f"| {' | '.join(line)} |" for line in lines)
