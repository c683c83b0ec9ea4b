"""A trace read back: its records with their nodes, and the past that a resumed run starts from.

The past ends with the last completed step of the top-level plan. A completed step is recorded with its result and its
effects: draws from random streams, changed fluents, used budgets. A step whose result cannot be stored in JSON is
recorded as lost; the past ends before it.
"""

from __future__ import annotations

import json
import os
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

from planlang.files import encoding_of, open_regular
from planlang.kernel.schedule import parse_draws
from planlang.records import dataclass
from planlang.runs.codec import OLDEST, SCHEMA, Exact, load, load_failure
from planlang.runs.schema import DEEPEST, LATEST, is_deep, mistake

LONGEST_LINE = 20_000_000
"""Maximum length of a line of a trace [bytes]."""


class DamagedTrace(ValueError):
    """A file is not a trace, or a line of it is damaged; ``line`` counts from 1."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


class OlderTrace(DamagedTrace):
    """An older planlang wrote a trace: it can be read, but the run can be neither resumed nor replayed."""

    def __init__(self, schema: int) -> None:
        super().__init__(f"its schema is {schema}: only a trace of schema {SCHEMA} can be resumed or replayed", 1)
        self.schema = schema


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A node of the tree: its name and its parent. Full paths would take quadratic memory in deep trees."""

    name: str
    parent: Place | None

    @property
    def path(self) -> str:
        """Names from the root, joined by ``/``."""
        names, place = [self.name], self.parent
        while place is not None:
            names.append(place.name)
            place = place.parent
        return "/".join(reversed(names))


@dataclass(frozen=True, slots=True)
class Line:
    """A record with its line in the file, counted from 1, and its node, if it has one."""

    number: int
    record: Mapping[str, Any]
    place: Place | None

    @property
    def path(self) -> str | None:
        """Path of the node."""
        return None if self.place is None else self.place.path

    @property
    def step(self) -> int:
        """Plan time in world steps."""
        return int(self.record["step"])

    @property
    def event(self) -> str:
        """Name of the event."""
        return str(self.record["event"])


@dataclass(slots=True)
class RecordedRun:
    """The records of a run, the header first. ``torn`` is true if the last line was cut off and is left out."""

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
        """Outcome of the plan: "succeeded", "failed" or "evaporated"; None if the trace ends before the plan."""
        root = next((line.path for line in self.lines if line.event == "started"), None)
        for line in reversed(self.lines):
            if line.event == "ended" and line.path == root:
                return str(line.record.get("status"))
        return None

    def check_repeatable(self) -> None:
        """Raise OlderTrace if the records are of an older schema, which readers know and a repetition does not."""
        if (schema := int(self.header["schema"])) != SCHEMA:
            raise OlderTrace(schema)

    @staticmethod
    def read(path: str | os.PathLike[str]) -> RecordedRun:
        """Read a trace from a file; raises OSError, DamagedTrace."""
        records, torn = read_records(path)
        return RecordedRun(_lines(records), torn, str(path))

    @staticmethod
    def of(events: Sequence[Mapping[str, Any]]) -> RecordedRun:
        """Make a recorded run from records in memory; raises DamagedTrace."""
        return RecordedRun(_lines(events))


def read_records(path: str | os.PathLike[str]) -> tuple[list[Any], bool]:
    """Read the records of a file, unchecked, and whether the last line was cut off; raises OSError, DamagedTrace."""
    texts: list[bytes] = []
    with open_regular(Path(path)) as file:
        while text := file.readline(LONGEST_LINE + 1):
            if len(text) > LONGEST_LINE:
                raise DamagedTrace(f"a line of more than {LONGEST_LINE // 1_000_000} MB", len(texts) + 1)
            texts.append(text)
    if texts and encoding_of(texts[0]) == "utf-16":
        raise DamagedTrace("in UTF-16; save it as UTF-8", 1)
    torn = bool(texts) and not texts[-1].endswith(b"\n")
    records: list[Any] = []
    for number, text in enumerate(texts, 1):
        try:
            record = json.loads(text)
            # most lines are too short for this
            if text.count(b"[") + text.count(b"{") > DEEPEST and is_deep(record):
                raise RecursionError
            records.append(record)
        except (ValueError, RecursionError) as problem:
            if torn and number == len(texts) and number > 1:
                return records, True
            raise DamagedTrace(f"not JSON: {_reason(problem)}", number) from None
    return records, False


def _reason(problem: Exception) -> str:
    if isinstance(problem, json.JSONDecodeError):
        return f"{problem.msg.removesuffix(' at')} at character {problem.pos + 1}"
    return "too deeply nested" if isinstance(problem, RecursionError) else "not UTF-8"


def checked_records(records: Iterable[object]) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """Check and yield the records with their line numbers from 1, the header first; raises DamagedTrace."""
    number = step = 0
    for number, record in enumerate(records, 1):
        match record:
            case {"step": int(now), "event": str()} if not isinstance(now, bool) and now >= 0:
                pass
            case _:
                raise DamagedTrace("not a record of a trace: it has no step and event", number)
        assert isinstance(record, Mapping)
        if number == 1:
            _check_header(record)
        if (wrong := mistake(record)) is not None:
            raise DamagedTrace(wrong, number)
        if now > LATEST:
            raise DamagedTrace(f"step {now} is too late", number)
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
    schema, versions = record.get("schema"), record.get("versions")
    if type(schema) is not int:
        raise DamagedTrace(f"schema has to be a number: that of this version of planlang is {SCHEMA}", 1)
    if OLDEST <= schema <= SCHEMA:
        return
    version = versions.get("planlang") if isinstance(versions, dict) else None
    age = "an older" if schema < SCHEMA else "a newer"
    written = "" if version is None else f"; its header names planlang {version}"
    raise DamagedTrace(
        f"the trace has schema {schema}, that of {age} planlang, and this one reads only schemas {OLDEST} to {SCHEMA}"
        f"{written}: run the plan again, or read the trace where it was written",
        1,
    )


def _place(record: Mapping[str, Any], places: dict[int, Place], number: int) -> Place | None:
    if "node" not in record:
        return None
    node = record["node"]
    if node not in places:
        match record:
            case {"node": int(), "parent": None, "name": str(name), "kind": str()}:
                places[node] = Place(name, None)
            case {"node": int(), "parent": int(parent), "name": str(name), "kind": str()} if parent in places:
                places[node] = Place(name, places[parent])
            case _:
                raise DamagedTrace("the node of this record has not started", number)
    return places[node]


BOOKKEEPING = frozenset({"completed", "resumed", "world", "answer", "performed", "outside"})
"""Events that a plan does not write when its completed steps are skipped or replayed."""
SPANS = frozenset({"started", "ended"})
_FRAME = frozenset({"step", "event", "node", "parent", "kind", "name"})


def details(record: Mapping[str, Any]) -> dict[str, Any]:
    """Content of a record without step, event and node."""
    return {key: value for key, value in record.items() if key not in _FRAME}


@dataclass(frozen=True, slots=True)
class Done:
    """A completed step: its time, result or failure, and effects."""

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
    """The part of a recorded run that a resumed run does not execute again.

    ``done``: completed steps by path. ``kept``: the records at the start of the resumed run's trace, the header first.
    ``again``: paths of steps that had begun but not completed, which run again. ``left``: state of the world and of the
    robot's belief at the end of the past, None if it was not recorded. ``lost``: path and reason of a completed step
    before which the past ends because its result could not be stored, None if there is none.
    """

    def __init__(self, recorded: RecordedRun) -> None:
        """Raises OlderTrace, and DamagedTrace if a completed step cannot be read."""
        recorded.check_repeatable()
        self.recorded = recorded
        self.done: dict[str, Done] = {}
        self.again: tuple[str, ...] = ()
        self.left: Any = None
        self.choices: Any = None
        self.lost: str | None = None
        self.last: Done | None = None
        """The completed step after which the plan continues; None for the beginning."""
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
        """The highest number of a node."""
        self.calls = max((call_of(line) for line in self.kept if line.event == "called"), default=0)
        """The highest number of a call in a thread."""
        self.order = [done for path, done in self.done.items() if not self._inside_done(path)]
        """Completed steps in the order of their ends, without those inside other completed steps."""
        self._values: dict[tuple[str | None, str], list[Line]] = {}
        self._calls: dict[str | None, list[Any]] = {}
        """Numbers of the calls in each node that were not repeated yet."""
        self._answers: dict[str, Line] = {}
        for line in self.kept:
            match line.event:
                case "world":
                    self._values.setdefault((line.path, str(line.record.get("number"))), []).append(line)
                case "called":
                    self._calls.setdefault(line.path, []).append(line.record.get("call"))
                case "answer":
                    self._answers.setdefault(str(line.record.get("asked")), line)

    def expected(self) -> list[Line]:
        """List the kept records that the plan writes again while it repeats its past."""
        lines = []
        for line in self.kept:
            path = line.path
            if path is None or line.event in BOOKKEEPING or self._inside_done(path):
                continue
            if path in self.done and line.event not in SPANS:  # its body does not run again
                continue
            lines.append(line)
        return lines

    def answers(self) -> dict[str, Any]:
        """Map each question to its last answer, in the form of :func:`outcome_of`."""
        records = (line.record for line in self.kept if line.event == "answer")
        return {str(record.get("asked")): outcome_of(record) for record in records}

    def value_of(self, path: str | None, number: int, now: int) -> Line | None:
        """Find the value of a world fluent at step ``now``, by the node in which it was first read and its number."""
        lines = self._values.get((path, str(number)), [])
        place = bisect_right(lines, now, key=lambda line: line.step)
        return lines[place - 1] if place else None

    def call(self, path: str) -> tuple[int, Line]:
        """Take number and outcome of the next recorded call in a thread from a node."""
        numbers = self._calls.get(path, [])
        while numbers:
            number = numbers.pop(0)
            if f"call {number}" in self._answers:
                return int(str(number)), self._answers[f"call {number}"]
        raise DamagedTrace("a call in a thread is not recorded", 1)

    def _inside_done(self, path: str) -> bool:
        return any(ancestor in self.done for ancestor in _ancestors(path))

    def _dropped(self, line: Line) -> bool:
        if line.path is None or not self.again:
            return False
        if line.path in self.again and line.event != "started":
            return True
        return any(ancestor in self.again for ancestor in _ancestors(line.path))


def _ancestors(path: str) -> Iterator[str]:
    """Yield the paths of the ancestors of a node, nearest first."""
    while (end := path.rfind("/")) >= 0:
        path = path[:end]
        yield path


def call_of(line: Line) -> int:
    """Number of a call in a thread; raises DamagedTrace."""
    number = line.record.get("call")
    if not isinstance(number, int):
        raise DamagedTrace("call has to be a number", line.number)
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
    mapping = record.get(key, {})
    if not isinstance(mapping, dict):
        raise ValueError(f"{key} has to be a mapping")
    return mapping


def _counts(record: Mapping[str, Any], key: str) -> dict[str, int]:
    counts = _mapping(record, key)
    if not all(type(number) is int and number >= 0 for number in counts.values()):
        raise ValueError(f"{key} has to contain whole numbers")
    return counts


def _paths(line: Line) -> tuple[str, ...]:
    paths = line.record.get("open", [])
    if not isinstance(paths, list) or not all(isinstance(path, str) for path in paths):
        raise DamagedTrace("open has to be a list of paths", line.number)
    return tuple(paths)


def outcome_of(record: Mapping[str, Any]) -> Any:
    """Answer of a record as JSON, for comparison: its value, its failure, or why it could not be stored."""
    return {
        key: value.json if isinstance(value, Exact) else value
        for key, value in record.items()
        if key in ("value", "failure", "lost")
    }


def value_in(line: Line) -> Any:
    """Restore the value of a record, or raise its failure; DamagedTrace if it cannot be read."""
    record = line.record
    try:
        if "failure" not in record:
            return load(record.get("value"))
        failure = load_failure(record["failure"])
    except (ValueError, TypeError, RecursionError) as problem:
        raise DamagedTrace(f"its value cannot be read: {problem}", line.number) from None
    raise failure


def differences(recorded: Mapping[str, Any], now: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Map each key of ``now`` whose recorded value differs to (recorded value, present value)."""
    return {key: (recorded.get(key), value) for key, value in now.items() if recorded.get(key) != value}


def refuse_other(past: Past, now: Mapping[str, Any]) -> None:
    """Raise ValueError if a run with the header ``now`` cannot resume the past."""
    if past.recorded.header.get("resumable") is not True:
        raise ValueError("the trace does not contain completed steps: it was not written with resumable=True")
    changed = differences(past.recorded.header, now)
    if changed:
        changes = "; ".join(f"{key} was {before!r} and is {after!r}" for key, (before, after) in changed.items())
        raise ValueError(f"the trace belongs to a different run: {changes}")


def restore(executive: object, past: Past) -> bool:
    """Restore the state of world and belief at the end of the past; False if the past or the executive lacks it.

    Raises ValueError if the recorded state does not fit the world.
    """
    restore_state = getattr(executive, "restore", None)
    if past.last is None:
        return True
    if restore_state is None or past.left is None:
        return False
    restore_state(past.left)
    return True
