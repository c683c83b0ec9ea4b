"""The part of a recorded run that need not be run again: up to the last step of the top-level plan that completed.

A step that completed is recorded with its result and with what it left behind: numbers drawn, fluents set, budgets
used. One whose result does not survive JSON is recorded as lost; the past ends before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from planlang.kernel.exact import Exact, load, load_failure
from planlang.kernel.numbers import unpacked
from planlang.kernel.recorded import DamagedTrace, Line, RecordedRun

BOOKKEEPING = frozenset({"completed", "resumed", "world", "answer", "performed"})
"""Events that no node of a plan writes when it runs again."""
SPANS = frozenset({"started", "ended"})
_FRAME = frozenset({"step", "event", "node", "parent", "kind", "name"})


def details(record: Mapping[str, Any]) -> dict[str, Any]:
    """What a record tells besides when, what and where."""
    return {key: value for key, value in record.items() if key not in _FRAME}


@dataclass(frozen=True, slots=True)
class Done:
    """A step that completed: when, with which result or failure, and what it left behind."""

    path: str
    step: int
    line: int
    value: Any = None
    failure: BaseException | None = None
    numbers: tuple[Any, ...] | None = None
    """State of the task's stream of random numbers."""
    fluents: Mapping[str, Any] = field(default_factory=dict)
    spent: Mapping[str, int] = field(default_factory=dict)
    used: Mapping[str, int] = field(default_factory=dict)


class Past:
    """What a resumed run takes over.

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
            if line.event != "completed" or line.path is None:
                continue
            if "lost" in line.record:
                self.lost = f"{line.path}: {line.record['lost']}"
                break
            self.last = self.done[line.path] = _done(line)
            self.left = line.record.get("left", self.left)
            self.choices = line.record.get("choices")
            self.again = _paths(line)
            cut = place
        self._called: set[Any] = set()
        before = recorded.lines[: cut + 1]
        self.kept = [line for line in before if not self._dropped(line)]
        self.nodes = max((int(line.record.get("node", 0)) for line in before), default=0)
        """The highest number that a node has been given."""
        self.calls = max((_call(line) for line in self.kept if line.event == "called"), default=0)
        """The highest number that a call in a thread has been given."""
        self._begun = {str(one.path): details(one.record) for one in self.kept if one.event == "started"}
        self.order = [done for path, done in self.done.items() if not self._inside_done(path)]
        """What is taken over, in the order in which it completed, without what is inside of other such steps."""

    def expected(self) -> list[Line]:
        """The kept records that the plan writes again on its way to where it goes on."""
        found = []
        for line in self.kept:
            path = line.path
            if path is None or line.event in BOOKKEEPING or self._inside_done(path):
                continue
            if path in self.done and line.event not in SPANS:
                continue
            found.append(line)
        return found

    def answers(self) -> dict[str, Any]:
        """Question -> how it was answered last, as :func:`outcome_of` tells it."""
        asked = (line.record for line in self.kept if line.event == "answer")
        return {str(record.get("asked")): outcome_of(record) for record in asked}

    def value_of(self, path: str | None, number: int, now: int) -> Line | None:
        """The record of the value that a world fluent had, by the node in which it was first read and its number."""
        found = None
        for line in self.kept:
            if line.event == "world" and line.path == path and line.record.get("number") == number and line.step <= now:
                found = line
        return found

    def call(self, path: str) -> tuple[int, Line]:
        """Number and outcome of the next call in a thread that was made in a node."""
        for line in self.kept:
            number = line.record.get("call")
            if line.event == "called" and line.path == path and number not in self._called:
                self._called.add(number)
                for answer in self.kept:
                    if answer.event == "answer" and answer.record.get("asked") == f"call {number}":
                        return int(str(number)), answer
        raise DamagedTrace("a call in a thread is not recorded", 1)

    def beginning(self, path: str) -> Mapping[str, Any]:
        """What was told when a completed step began."""
        return self._begun[path]

    def _inside_done(self, path: str) -> bool:
        return any(around in self.done for around in _around(path))

    def _dropped(self, line: Line) -> bool:
        if line.path is None or not self.again:
            return False
        return (line.path in self.again and line.event != "started") or any(a in self.again for a in _around(line.path))


def _around(path: str) -> Iterator[str]:
    """The paths of the nodes around a node, the nearest first."""
    while (end := path.rfind("/")) >= 0:
        path = path[:end]
        yield path


def _call(line: Line) -> int:
    """The number of a call in a thread."""
    number = line.record.get("call")
    if not isinstance(number, int):
        raise DamagedTrace("a call in a thread is told by its number", line.number)
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
            None if "numbers" not in record else unpacked(record["numbers"]),
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
        raise DamagedTrace("open steps are told by their paths", line.number)
    return tuple(found)


def outcome_of(record: Mapping[str, Any]) -> Any:
    """How a question was answered, for comparing: its value, failure or that it did not survive, as JSON."""
    return {
        key: value.json if isinstance(value, Exact) else value
        for key, value in record.items()
        if key in ("value", "failure", "lost")
    }


def told_in(line: Line) -> Any:
    """The value that a record tells; raises the failure that it tells, or DamagedTrace."""
    record = line.record
    try:
        if "failure" not in record:
            return load(record.get("value"))
        failure = load_failure(record["failure"])
    except (ValueError, TypeError, RecursionError) as problem:
        raise DamagedTrace(f"what was told cannot be read: {problem}", line.number) from None
    raise failure
