"""The steps of a run, read from its trace: what began and ended when, and how."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from planlang.designators import local_name


@dataclass(eq=False)
class Step:
    """One node of the task tree: a construct, branch, tag, plan or performed action, each run of it on its own.

    ``begin`` and ``end`` are plan time [s], None for what never began; ``first`` and ``last`` are places in the trace.
    ``failure`` is the trace's record of a failure: type, message, cause, members.
    """

    name: str
    """The path element."""
    kind: str
    parent: Step | None
    details: Mapping[str, Any] = field(default_factory=dict)
    begin: float | None = None
    end: float | None = None
    first: int = -1
    last: int = sys.maxsize
    status: str = "running"
    result: Any = None
    failure: Mapping[str, Any] | None = None
    repeats: list[float] = field(default_factory=list)
    """Times at which a with_failure_handling ran its body [s]."""
    children: list[Step] = field(default_factory=list)

    @property
    def path(self) -> str:
        """Names from the root, joined by ``/``."""
        return "/".join(reversed([step.name for step in self._outward()]))

    def _outward(self) -> Iterator[Step]:
        """Yield this step, the one around it, and so on."""
        step: Step | None = self
        while step is not None:
            yield step
            step = step.parent

    @property
    def action(self) -> str | None:
        """The class of the performed action, by its local name."""
        text = self.details.get("action")
        return local_name(text.split("(", 1)[0]) if isinstance(text, str) else None

    def called(self, query: str) -> bool:
        """Return True if a name, ``parent/name``, or class of action means this step; ``#2``: the second."""
        if self.action is not None and self.action == query:
            return True
        names = (part for step in self._outward() for part in reversed(step.name.split("/")))
        return all(
            (name := next(names, None)) is not None and want in (name, name.split("#", 1)[0])
            for want in reversed(query.split("/"))
        )

    def within(self, other: Step) -> bool:
        """Return True if this step is inside the other one."""
        return self is not other and any(step is other for step in self._outward())

    def summary(self, longest: int | None = None) -> str:
        """Return when and how it ran, in a line; the message of a failure is cut to ``longest`` characters."""
        if self.begin is None:
            return f"{self.status} before it began"
        span = f"{self.begin:g} s" if self.begin == self.end else f"{self.begin:g} to {self.end or 0:g} s"
        if self.end is None:
            span = f"{self.begin:g} s on"
        if self.failure is None:
            return f"{span}, {self.status}"
        message = self.failure["message"]
        if longest is not None and len(message) > longest:
            message = f"{message[: longest - 3]}..."
        return f"{span}, {self.status} with {self.failure['type']}: {message}"

    def __repr__(self) -> str:
        return f"<{self.path}: {self.summary()}>"


def read_steps(events: Iterable[Mapping[str, Any]], rate: int) -> list[Step]:
    """Return the steps that a trace reports, in the order in which they began."""
    known: dict[int, Step] = {}
    steps: list[Step] = []
    for place, event in enumerate(events):
        what, number = event["event"], event.get("node")
        if number is None:
            continue
        time = event["step"] / rate
        step = known.get(number)
        if step is None:
            parent = known.get(event["parent"])
            step = known[number] = Step(event["name"], event["kind"], parent, _details(event))
            steps.append(step)
            if parent is not None:
                parent.children.append(step)
        if what == "started":
            step.begin, step.first = time, place
        elif what == "ended":
            step.status, step.end, step.last = event["status"], time, place
            step.result, step.failure = event.get("result"), event.get("failure")
            if step.begin is None:
                step.first = place
        elif what == "attempt":
            step.repeats.append(time)
    return steps


def _details(event: Mapping[str, Any]) -> dict[str, Any]:
    known = ("step", "event", "node", "parent", "kind", "name", "status")
    return {key: value for key, value in event.items() if key not in known}


def tree_of(steps: Sequence[Step]) -> str:
    """Return the task tree as indented text, with time, status and, where it arose, the failure."""
    lines: list[str] = []
    stack = [(step, 0) for step in reversed(steps) if step.parent is None]
    while stack:
        step, depth = stack.pop()
        children = step.children
        if step.kind == "perform" and len(children) == 1 and children[0].kind == "branch":
            children = children[0].children  # the module's own node adds nothing
        inner = step.failure is not None and any(_same(child.failure, step.failure) for child in children)
        text = step.summary() if not inner else step.summary().split(" with ", 1)[0]
        lines.append(f"{'  ' * depth}{_title(step)}: {text}")
        stack.extend((child, depth + 1) for child in reversed(children))
    return "\n".join(lines)


def _title(step: Step) -> str:
    text = step.details.get("action")
    if not isinstance(text, str):
        return step.name
    named_by_class = step.name.split("#", 1)[0] == step.action
    return step.name + text[text.index("(") :] if named_by_class else f"{step.name}, {text}"


def _same(one: Mapping[str, Any] | None, other: Mapping[str, Any]) -> bool:
    return one is not None and (one["type"], one["message"]) == (other["type"], other["message"])
