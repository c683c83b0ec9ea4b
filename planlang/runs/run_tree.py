"""The tree of a run, as its trace tells it: the one reader of records, from which all that ask about a run read."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import Any

from planlang.designators import local_name
from planlang.records import dataclass
from planlang.runs.recorded_run import BOOKKEEPING, details


@dataclass(frozen=True, slots=True)
class Happened:
    """A record of something in a node, or about the run as a whole, that is neither a start nor an end."""

    step: int
    """Plan time in world steps."""
    event: str
    details: dict[str, Any]
    place: int = -1
    """Place of the record in the trace."""


@dataclass(eq=False)
class TaskNode:
    """A construct, branch, tag, plan function, perform or state of a run; each run of it is a node of its own.

    ``status`` is succeeded, failed or evaporated; running if the trace ends before it. ``start`` and ``end`` are plan
    time [s], None if it never began or has not ended. ``parameters`` is what the trace tells about the start, and
    ``failure`` its record of a failure: type, message, cause, members.
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
    """Its number in the trace, from 1 on."""
    begun: int | None = None
    ended: int | None = None
    """Plan time of start and end in world steps."""
    first: int = -1
    """Place of the record in the trace that tells of the start, or of the end of what never began."""
    last: int = sys.maxsize
    """Place of the record that tells of the end."""
    repeats: list[float] = field(default_factory=list)
    """Times at which a with_failure_handling ran its body [s]."""
    happened: list[Happened] = field(default_factory=list)
    """What happened in it: the solutions of a location, recoveries, resources that were taken, ..."""
    is_request: bool = False
    """True for the node of a process module that performs an action."""

    @property
    def path(self) -> str:
        """Names from the root, joined by ``/``."""
        names: list[str] = []
        node: TaskNode | None = self
        while node is not None:
            names.append(node.name)
            node = node.parent
        return "/".join(reversed(names))

    def _outward(self) -> Iterator[TaskNode]:
        """Yield this step, the one around it, and so on."""
        step: TaskNode | None = self
        while step is not None:
            yield step
            step = step.parent

    @property
    def inner(self) -> bool:
        """True for what a process module does inside of the action that the plan has asked it for."""
        outward = self._outward()
        next(outward)
        return any(step.is_request for step in outward)

    def called(self, query: str) -> bool:
        """Return True if a name, ``parent/name``, or class of action means this step; ``#2``: the second."""
        if self.action is not None and query in (self.action, *map(local_name, self.parameters.get("classes", ()))):
            return True
        names = (part for step in self._outward() for part in reversed(step.name.split("/")))
        return all(
            (name := next(names, None)) is not None and want in (name, name.split("#", 1)[0])
            for want in reversed(query.split("/"))
        )

    def within(self, other: TaskNode) -> bool:
        """Return True if this step is inside the other one."""
        return self is not other and any(step is other for step in self._outward())

    @property
    def reason(self) -> str:
        """Return why it ended as it did: ``TYPE: MESSAGE`` of its failure; empty if it has none."""
        return "" if self.failure is None else f"{self.failure['type']}: {self.failure['message']}"

    @property
    def action(self) -> str | None:
        """The class of the performed action, by its local name."""
        text = self.parameters.get("action")
        return local_name(text.split("(", 1)[0]) if isinstance(text, str) else None

    def summary(self, longest: int | None = None) -> str:
        """Return when and how it ran, in a line; the message of a failure is cut to ``longest`` characters."""
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
        """Return a JSON object, keys in a fixed order; result and failure where there is one."""
        found: dict[str, Any] = {
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
                found[key] = value
        return found


class RunTree:
    """The nodes of a run by their numbers, which are those of the trace, in order of beginning."""

    def __init__(self, records: Iterable[Mapping[str, Any]] = ()) -> None:
        self.numbered: dict[int, TaskNode] = {}
        self.roots: list[TaskNode] = []
        self.belief: list[Happened] = []
        """How the belief changed, and where things are believed to be since."""
        self.rate = 1.0
        """World steps per second of plan time."""
        self._read = 0
        for record in records:
            self.add(record)

    def go_on(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Read on in a trace that has become longer."""
        while self._read < len(records):
            self.add(records[self._read])

    def add(self, record: Mapping[str, Any]) -> TaskNode | None:
        """Read the next record; return the node that it is about, None if it is about none."""
        place, self._read = self._read, self._read + 1
        event, number = record["event"], record.get("node")
        if event == "header":
            self.rate = float(record["rate"])
        if number is None:
            if event == "belief":
                told = {key: value for key, value in record.items() if key not in ("step", "event")}
                self.belief.append(Happened(record["step"], event, told, place))
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

    def _new(self, number: int, record: Mapping[str, Any]) -> TaskNode:
        parent = self.numbered.get(record["parent"])
        node = self.numbered[number] = TaskNode(record["name"], record["kind"], parent, number=number)
        (self.roots if parent is None else parent.children).append(node)
        return node
