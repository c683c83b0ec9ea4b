"""The tree of a run, built from its trace: the only reader of records for queries about runs."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import Any

from planlang.designators import local_name
from planlang.object_changes import state_word
from planlang.records import dataclass
from planlang.runs.recorded_run import BOOKKEEPING, details


@dataclass(frozen=True, slots=True)
class Happened:
    """An event of a node, or of the run as a whole, that is neither a start nor an end."""

    step: int
    """Plan time in world steps."""
    event: str
    details: dict[str, Any]
    place: int = -1
    """Index of the record in the trace."""


@dataclass(eq=False)
class TaskNode:
    """One execution of a construct, branch, tag, plan function, action or state.

    ``status`` is succeeded, failed or evaporated; running if the trace ends before the node. ``start`` and ``end`` are
    plan time [s], None if it never began or has not ended. ``parameters`` are the details of the start record, and
    ``failure`` is the record of a failure: type, message, cause, members.
    """

    name: str
    """The path element."""
    kind: str
    parent: TaskNode | None = None
    parameters: dict[str, Any] = field(default_factory=dict)
    status: str = "running"
    result: Any = None
    failure: dict[str, Any] | None = None
    start: float | None = None
    end: float | None = None
    children: list[TaskNode] = field(default_factory=list)
    number: int = 0
    """Number in the trace, from 1."""
    begun: int | None = None
    ended: int | None = None
    """Plan time of start and end in world steps."""
    first: int = -1
    """Index of the start record in the trace, or of the end record if the node never began."""
    last: int = sys.maxsize
    """Index of the end record."""
    repeats: list[float] = field(default_factory=list)
    """Times [s] at which a with_failure_handling started its body."""
    happened: list[Happened] = field(default_factory=list)
    """Other events of the node: solutions of a location, recoveries, acquired resources, ..."""
    is_request: bool = False
    """True for the execution of an action by a process module."""
    meant: dict[str, str] = field(default_factory=dict)
    """Descriptions by class, such as ``Cup that is on(table1)``, and the names of the things that they mean in it."""

    @property
    def path(self) -> str:
        """Names from the root, joined by ``/``."""
        names: list[str] = []
        node: TaskNode | None = self
        while node is not None:
            names.append(node.name)
            node = node.parent
        return "/".join(reversed(names))

    def named(self, text: str) -> str:
        """Replace descriptions by class in a text by the names of the things that they mean in this node."""
        around = [node.meant for node in self._outward() if node.meant]
        return with_names(text, {what: name for meant in reversed(around) for what, name in meant.items()})

    def _outward(self) -> Iterator[TaskNode]:
        """Yield this node and its ancestors, nearest first."""
        node: TaskNode | None = self
        while node is not None:
            yield node
            node = node.parent

    @property
    def inner(self) -> bool:
        """True inside the execution of an action by a process module."""
        outward = self._outward()
        next(outward)
        return any(node.is_request for node in outward)

    def called(self, query: str) -> bool:
        """Check whether a query refers to this node: a name, ``parent/name`` or class of action; ``#2``: the second."""
        if self.action is not None and query in (self.action, *map(local_name, self.parameters.get("classes", ()))):
            return True
        names = (part for node in self._outward() for part in reversed(node.name.split("/")))
        return all(
            (name := next(names, None)) is not None and part in (name, name.split("#", 1)[0])
            for part in reversed(query.split("/"))
        )

    def within(self, other: TaskNode) -> bool:
        """Check whether this node is inside another one."""
        return self is not other and any(node is other for node in self._outward())

    @property
    def reason(self) -> str:
        """``TYPE: MESSAGE`` of the node's failure; empty if it has none."""
        return "" if self.failure is None else f"{self.failure['type']}: {self.failure['message']}"

    @property
    def action(self) -> str | None:
        """Local name of the class of the performed action."""
        text = self.parameters.get("action")
        return local_name(text.split("(", 1)[0]) if isinstance(text, str) else None

    def summary(self, longest: int | None = None) -> str:
        """Times and status in one line; the message of a failure is cut to ``longest`` characters."""
        if self.start is None:
            return f"{self.status} before it began"
        span = f"{self.start:g} s" if self.start == self.end else f"{self.start:g} to {self.end or 0:g} s"
        if self.end is None:
            span = f"{self.start:g} s on"
        if self.failure is None:
            return f"{span}, {self.status}"
        message = self.failure["message"]
        if longest is not None and len(message) > longest:
            message = f"{message[: longest - 3]}..."
        return f"{span}, {self.status} with {self.failure['type']}: {message}"

    def __repr__(self) -> str:
        return f"<{self.path}: {self.summary()}>"

    def record(self) -> dict[str, Any]:
        """The node as a JSON object, keys in a fixed order, without absent parameters, result and failure."""
        exported: dict[str, Any] = {
            "path": self.path,
            "parent": None if self.parent is None else self.parent.path,
            "kind": self.kind,
            "name": self.name,
            "status": self.status,
            "start": self.start,
            "end": self.end,
        }
        for key, value in (("parameters", self.parameters), ("result", self.result), ("failure", self.failure)):
            if value not in (None, {}):
                exported[key] = value
        return exported


class RunTree:
    """The nodes of a run by their numbers in the trace, in order of their start."""

    def __init__(self, records: Iterable[Mapping[str, Any]] = ()) -> None:
        self.numbered: dict[int, TaskNode] = {}
        self.roots: list[TaskNode] = []
        self.belief: list[Happened] = []
        """Changes of the belief state, such as new poses of objects."""
        self.rate = 1.0
        """World steps per second of plan time."""
        self._read = 0
        self._meant: dict[str, dict[str, str]] = {}
        """Path of a node that has not begun yet -> what descriptions mean in it."""
        for record in records:
            self.add(record)

    def go_on(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Read the new records of a trace that has grown."""
        while self._read < len(records):
            self.add(records[self._read])

    def add(self, record: Mapping[str, Any]) -> TaskNode | None:
        """Read the next record; return its node, None if it has none."""
        place, self._read = self._read, self._read + 1
        event, number = record["event"], record.get("node")
        if event == "header":
            self.rate = float(record["rate"])
        if number is None:
            if event == "belief":
                content = {key: value for key, value in record.items() if key not in ("step", "event")}
                self.belief.append(Happened(record["step"], event, content, place))
            elif event == "means":
                self._mean(record.get("what"), record.get("name"), record.get("within"))
            return None
        node, time = self.numbered.get(number) or self._new(number, record), record["step"] / self.rate
        if event == "started":
            node.start, node.begun, node.first = time, record["step"], place
            node.parameters.update(details(record))
        elif event == "ended":
            node.status, node.end, node.ended, node.last = record["status"], time, record["step"], place
            node.result, node.failure = record.get("result"), record.get("failure")
            node.first = place if node.start is None else node.first
        elif event not in BOOKKEEPING:
            node.happened.append(Happened(record["step"], event, details(record), place))
            if event == "plan":
                node.kind = "plan"
                node.parameters.update(details(record))
            elif event == "attempt":
                node.repeats.append(time)
            elif event == "request":
                node.is_request = True
        return node

    def _mean(self, what: str | None, name: str | None, within: str | None) -> None:
        """Note which thing a description means, in the node of a path or, without one, in the whole run."""
        if what and name:
            nodes = reversed(self.numbered.values()) if within else self.roots
            node = next((one for one in nodes if not within or one.path == within), None)
            (self._meant.setdefault(within or "", {}) if node is None else node.meant)[what] = name

    def _new(self, number: int, record: Mapping[str, Any]) -> TaskNode:
        parent = self.numbered.get(record["parent"])
        node = self.numbered[number] = TaskNode(record["name"], record["kind"], parent, number=number)
        (self.roots if parent is None else parent.children).append(node)
        if self._meant:
            node.meant = self._meant.pop(node.path, {})
        return node


def with_names(text: str, meant: Mapping[str, str]) -> str:
    """Replace descriptions by class in a text by the names of the things that they mean."""
    for what in sorted(meant, key=len, reverse=True):
        if what in text:
            text = meant[what].join(re.split(rf"(?<![\w-]){re.escape(what)}(?![\w-]| that is )", text))
    return text


_NUMBER = re.compile(r"(?<==)-?\d+(?:\.\d+(?:e-?\d+)?|e-?\d+)(?=[,)])")
"""A number in an action that is no integer."""


def rounded(action: str) -> str:
    """Write the numbers in an action to six decimals, micrometres, without a negative zero."""
    return _NUMBER.sub(lambda number: str(round(float(number[0]), 6) + 0.0), action)


DECISIONS = {
    "retry": "the step that failed is tried again",
    "used up": "the step is not tried again: it has failed as often as its recovery allows",
    "failed": "the recovery fails as well",
    "return": "the plan goes on without the step that failed",
    "propagate": "the recovery gives up",
}
"""What follows from the decision of a recovery; of other decisions nothing is told."""


CLOSED = 0.03
"""Joint value [rad, m] below which a door or drawer counts as closed."""
_CHANGES = {
    "leads": "held by its handle",
    "led": "moved by its handle",
    "let go": "released",
    "slipped off": "no longer held: its handle has slipped out of the hand",
    "stuck": "does not follow the hand",
    "not there": "not where it was believed to be",
    "not seen": "not seen from here",
    "noticed": "noticed, which is not in the map",
}
"""Words for changes of the belief, if they differ from those in the trace."""
_NUMBERS = {1: "two", 2: "three", 3: "four"}
"""How many things there are if there are so many others."""


class Changes:
    """Words for the changes of the belief, in their order: what a hand moves is opened or closed, as it was before."""

    def __init__(self) -> None:
        self._values: dict[object, float] = {}
        """Door or drawer -> its last known position [rad, m]."""

    def text(self, details: Mapping[str, Any]) -> str | None:
        """Describe the next change, without punctuation: ``bottle1 seen``; None if it is not known well enough."""
        name = details.get("name", "something")
        match details:
            case {"change": "released", "to": str(person)}:
                return f"{name} handed to {person}"
            case {"change": "alike", "others": [*others], "by": by}:
                which = "and its mark cannot be read from here" if by is None else f"taken by {by}"
                return f"{name} is one of {_NUMBERS.get(len(others), len(others) + 1)} alike, {which}"
            case {"change": "switched", "state": str(state)}:
                return f"{name} {state_word(state)}"
            case {"change": "led" | "moved", "value": int() | float() as value}:
                before, self._values[name] = self._values.get(name), value
                if value < CLOSED:
                    return f"{name} closed"
                return None if before is None else f"{name} being {'closed' if value < before else 'opened'}"
            case {"change": "let go"} if self._values.get(name, 0.0) >= CLOSED:
                return f"{name} released, open"
            case {"value": int() | float() as value}:
                self._values[name] = value
        word = str(details.get("change", "changed")).replace("_", " ")
        return f"{name} {_CHANGES.get(word, word)}"
