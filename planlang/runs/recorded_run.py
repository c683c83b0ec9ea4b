"""A trace that was written, read back: its records with their places in the tree, and what a resumed run takes over.

That is all up to the last step of the top-level plan that completed. Such a step is recorded with its result and with
what it left behind: draws from random streams, fluents set, budgets used. One whose result does not survive JSON is
recorded as lost; what can be taken over ends before it.
"""

from __future__ import annotations

import json
import os
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

from planlang.kernel.schedule import parse_draws
from planlang.records import dataclass
from planlang.runs.codec import SCHEMA, Exact, load, load_failure

LONGEST_LINE = 20_000_000
"""Bytes of one line of a trace that are read at most."""


class DamagedTrace(ValueError):
    """A file is no trace, or a line of it is damaged; ``line`` counts from 1."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A node of the tree: its name and the node around it. Kept so, nodes in nodes take no more room than others."""

    name: str
    around: Place | None

    @property
    def path(self) -> str:
        """Return the names from the root, joined by ``/``."""
        names, place = [self.name], self.around
        while place is not None:
            names.append(place.name)
            place = place.around
        return "/".join(reversed(names))


@dataclass(frozen=True, slots=True)
class Line:
    """One record: its line in the file, counted from 1, and the node it is about, if it is about one."""

    number: int
    record: Mapping[str, Any]
    place: Place | None

    @property
    def path(self) -> str | None:
        """Return the path of the node."""
        return None if self.place is None else self.place.path

    @property
    def step(self) -> int:
        """Plan time in world steps."""
        return int(self.record["step"])

    @property
    def event(self) -> str:
        """Return the name of the event."""
        return str(self.record["event"])


@dataclass(slots=True)
class RecordedRun:
    """The records of a run, the header first. ``torn``: the last line was cut off and is left out."""

    lines: list[Line]
    torn: bool = False
    name: str = "the trace"
    header: Mapping[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        self.header = self.lines[0].record

    @property
    def last(self) -> int:
        """The step of the last record."""
        return self.lines[-1].step

    @property
    def outcome(self) -> str | None:
        """Return the outcome of the plan: "succeeded", "failed" or "evaporated"; None if the record ends before."""
        root = next((line.path for line in self.lines if line.event == "started"), None)
        for line in reversed(self.lines):
            if line.event == "ended" and line.path == root:
                return str(line.record.get("status"))
        return None

    @staticmethod
    def read(path: str | os.PathLike[str]) -> RecordedRun:
        """Read a trace from a file; raises OSError, DamagedTrace."""
        records, torn = read_records(path)
        return RecordedRun(_lines(records), torn, str(path))

    @staticmethod
    def of(events: Sequence[Mapping[str, Any]]) -> RecordedRun:
        """Make a run of the records that a trace has kept; raises DamagedTrace."""
        return RecordedRun(_lines(events))


def read_records(path: str | os.PathLike[str]) -> tuple[list[Any], bool]:
    """Return the records in a file, unchecked, and whether the last was cut off; raises OSError, DamagedTrace."""
    texts: list[bytes] = []
    with Path(path).open("rb") as file:
        while text := file.readline(LONGEST_LINE + 1):
            if len(text) > LONGEST_LINE:
                raise DamagedTrace(f"a line of more than {LONGEST_LINE // 1_000_000} MB", len(texts) + 1)
            texts.append(text)
    torn = bool(texts) and not texts[-1].endswith(b"\n")
    records: list[Any] = []
    for number, text in enumerate(texts, 1):
        try:
            records.append(json.loads(text))
        except (ValueError, RecursionError) as problem:
            if torn and number == len(texts) and number > 1:
                return records, True
            raise DamagedTrace(f"this is no JSON: {_reason(problem)}", number) from None
    return records, False


def _reason(problem: Exception) -> str:
    return getattr(problem, "msg", None) or ("too deeply nested" if isinstance(problem, RecursionError) else "no UTF-8")


def checked_records(records: Iterable[object]) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """Yield the records, counted from 1, each with its step and event, the header first; raises DamagedTrace."""
    number = step = 0
    for number, record in enumerate(records, 1):
        match record:
            case {"step": int(now), "event": str()} if not isinstance(now, bool) and now >= 0:
                pass
            case _:
                raise DamagedTrace("this is no record of a trace: it has no step and event", number)
        assert isinstance(record, Mapping)
        if number == 1:
            _check_header(record)
        if now < step:
            raise DamagedTrace(f"step {now} comes after step {step}", number)
        step = now
        yield number, record
    if not number:
        raise DamagedTrace("the trace is empty", 1)


def _lines(records: Iterable[object]) -> list[Line]:
    places: dict[int, Place] = {}
    return [Line(number, record, _place(record, places, number)) for number, record in checked_records(records)]


def _check_header(record: Mapping[str, Any]) -> None:
    if record["event"] != "header":
        raise DamagedTrace("a trace begins with its header", 1)
    if record.get("schema") != SCHEMA:
        versions = record.get("versions")
        by = versions.get("planlang") if isinstance(versions, dict) else None
        writer = "the version of planlang that wrote it" if by is None else f"planlang {by}, which wrote it"
        raise DamagedTrace(
            f"it is written in schema {record.get('schema')!r}, and this version reads schema {SCHEMA}: read it with "
            f"{writer}, or run the plan again",
            1,
        )


def _place(record: Mapping[str, Any], places: dict[int, Place], number: int) -> Place | None:
    if "node" not in record:
        return None
    node = record["node"]
    if not isinstance(node, int):
        raise DamagedTrace("a node is given by its number", number)
    if node not in places:
        match record:
            case {"node": int(), "parent": None, "name": str(name)}:
                places[node] = Place(name, None)
            case {"node": int(), "parent": int(parent), "name": str(name)} if parent in places:
                places[node] = Place(name, places[parent])
            case _:
                raise DamagedTrace("the record is about a node that has not started", number)
    return places[node]


BOOKKEEPING = frozenset({"completed", "resumed", "world", "answer", "performed", "outside"})
"""Events that no node of a plan writes when it runs again."""
SPANS = frozenset({"started", "ended"})
_FRAME = frozenset({"step", "event", "node", "parent", "kind", "name"})


def details(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a record tells besides when, what and where."""
    return {key: value for key, value in record.items() if key not in _FRAME}


@dataclass(frozen=True, slots=True)
class Done:
    """A step that completed: when, with which result or failure, and what it left behind."""

    path: str
    step: int
    line: int
    value: Any = None
    failure: BaseException | None = None
    draws: Any = None
    """Position of the task's random stream."""
    fluents: Mapping[str, Any] = field(default_factory=dict)
    spent: Mapping[str, int] = field(default_factory=dict)
    used: Mapping[str, int] = field(default_factory=dict)


class Past:
    """The part of a recorded run that a resumed run takes over.

    ``done``: completed steps by path. ``kept``: the records that the resumed run's trace begins with, the header
    first. ``again``: paths of steps that had begun and not completed, which run again. ``until``: plan time at which
    the plan goes on [world steps]. ``left``: state of the world and the robot's belief then, None if it was not
    recorded. ``lost``: why the past ends before a step that completed, if it does.
    """

    def __init__(self, recorded: RecordedRun) -> None:
        self.recorded = recorded
        self.done: dict[str, Done] = {}
        self.again: tuple[str, ...] = ()
        self.left: Any = None
        self.choices: Any = None
        self.lost: str | None = None
        self.last: Done | None = None
        """The completed step after which the plan goes on; None if that is the beginning."""
        cut = 0
        for place, line in enumerate(recorded.lines):
            if line.event != "completed" or line.place is None:
                continue
            if "lost" in line.record:
                self.lost = f"{line.path}: {line.record['lost']}"
                break
            self.last = self.done[line.place.path] = _done(line)
            self.left = line.record.get("left", self.left)
            self.choices = line.record.get("choices")
            self.again = _paths(line)
            cut = place
        before = recorded.lines[: cut + 1]
        self.kept = [line for line in before if not self._dropped(line)]
        self.nodes = max((int(line.record.get("node", 0)) for line in before), default=0)
        """The highest number that a node has been given."""
        self.calls = max((call_of(line) for line in self.kept if line.event == "called"), default=0)
        """The highest number that a call in a thread has been given."""
        self.order = [done for path, done in self.done.items() if not self._inside_done(path)]
        """Steps that are taken over, in the order of their completion, without those inside of other such steps."""
        self._values: dict[tuple[str | None, str], list[Line]] = {}
        self._calls: dict[str | None, list[Any]] = {}
        """Numbers of calls that were not asked for yet, by node."""
        self._asked: dict[str, Line] = {}
        for line in self.kept:
            match line.event:
                case "world":
                    self._values.setdefault((line.path, str(line.record.get("number"))), []).append(line)
                case "called":
                    self._calls.setdefault(line.path, []).append(line.record.get("call"))
                case "answer":
                    self._asked.setdefault(str(line.record.get("asked")), line)

    def expected(self) -> list[Line]:
        """Return the kept records that the plan writes again on its way to where it goes on."""
        found = []
        for line in self.kept:
            path = line.path
            if path is None or line.event in BOOKKEEPING or self._inside_done(path):
                continue
            if path in self.done and line.event not in SPANS:  # its body does not run again
                continue
            found.append(line)
        return found

    def answers(self) -> dict[str, Any]:
        """Return question -> how it was answered last, as :func:`outcome_of` tells it."""
        asked = (line.record for line in self.kept if line.event == "answer")
        return {str(record.get("asked")): outcome_of(record) for record in asked}

    def value_of(self, path: str | None, number: int, now: int) -> Line | None:
        """Return the record of a world fluent's value, by the node in which it was first read and its number."""
        lines = self._values.get((path, str(number)), [])
        place = bisect_right(lines, now, key=lambda line: line.step)
        return lines[place - 1] if place else None

    def call(self, path: str) -> tuple[int, Line]:
        """Return number and outcome of the next call in a thread that was made in a node."""
        numbers = self._calls.get(path, [])
        while numbers:
            number = numbers.pop(0)
            if f"call {number}" in self._asked:
                return int(str(number)), self._asked[f"call {number}"]
        raise DamagedTrace("a call in a thread is not recorded", 1)

    def _inside_done(self, path: str) -> bool:
        return any(around in self.done for around in _around(path))

    def _dropped(self, line: Line) -> bool:
        if line.path is None or not self.again:
            return False
        return (line.path in self.again and line.event != "started") or any(a in self.again for a in _around(line.path))


def _around(path: str) -> Iterator[str]:
    """Return the paths of the nodes around a node, the nearest first."""
    while (end := path.rfind("/")) >= 0:
        path = path[:end]
        yield path


def call_of(line: Line) -> int:
    """Return the number of a call in a thread."""
    number = line.record.get("call")
    if not isinstance(number, int):
        raise DamagedTrace("a call in a thread is given by its number", line.number)
    return number


def _done(line: Line) -> Done:
    record = line.record
    try:
        failure = load_failure(record["failure"]) if "failure" in record else None
        return Done(
            str(line.path),
            line.step,
            line.number,
            load(record.get("value")),
            failure,
            parse_draws(record["draws"]) and record["draws"] if "draws" in record else None,
            load(_mapping(record, "fluents")),
            _counts(record, "spent"),
            _counts(record, "used"),
        )
    except (ValueError, TypeError, RecursionError) as problem:
        raise DamagedTrace(f"a completed step cannot be read: {problem}", line.number) from None


def _mapping(record: Mapping[str, Any], key: str) -> dict[str, Any]:
    found = record.get(key, {})
    if not isinstance(found, dict):
        raise ValueError(f"{key} is no mapping")
    return found


def _counts(record: Mapping[str, Any], key: str) -> dict[str, int]:
    found = _mapping(record, key)
    if not all(type(number) is int and number >= 0 for number in found.values()):
        raise ValueError(f"{key} are whole numbers")
    return found


def _paths(line: Line) -> tuple[str, ...]:
    found = line.record.get("open", [])
    if not isinstance(found, list) or not all(isinstance(path, str) for path in found):
        raise DamagedTrace("open steps are given by their paths", line.number)
    return tuple(found)


def outcome_of(record: Mapping[str, Any]) -> Any:
    """Return how a question was answered, for comparing: its value, failure or that it did not survive, as JSON."""
    return {
        key: value.json if isinstance(value, Exact) else value
        for key, value in record.items()
        if key in ("value", "failure", "lost")
    }


def value_in(line: Line) -> Any:
    """Return the value that a record tells; raises the failure that it tells, or DamagedTrace."""
    record = line.record
    try:
        if "failure" not in record:
            return load(record.get("value"))
        failure = load_failure(record["failure"])
    except (ValueError, TypeError, RecursionError) as problem:
        raise DamagedTrace(f"its value cannot be read: {problem}", line.number) from None
    raise failure


def differences(recorded: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return what is recorded otherwise than it is now: key -> (recorded, now), for the keys of ``now``."""
    return {key: (recorded.get(key), value) for key, value in now.items() if recorded.get(key) != value}


def refuse_other(past: Past, now: Mapping[str, Any]) -> None:
    """Raise ValueError if the past is that of another run than one with ``now`` in its header."""
    if past.recorded.header.get("resumable") is not True:
        raise ValueError("the trace does not tell which steps have completed: it was not written with resumable=True")
    found = differences(past.recorded.header, now)
    if found:
        changes = "; ".join(f"{key} was {before!r} and is {after!r}" for key, (before, after) in found.items())
        raise ValueError(f"the trace is that of another run: {changes}")


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
