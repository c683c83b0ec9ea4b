"""A trace that others listen to, and the lines that people read of it while a plan runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from planlang import Trace
from planlang.kernel.tree import Node
from planlang.runs import Past

Record = Mapping[str, Any]


class ListenedTrace(Trace):
    """A trace that gives each record to listeners as well; written to a file when there is a path."""

    listeners: tuple[Callable[[Record], None], ...] = ()

    @classmethod
    def to(
        cls,
        path: Path | None,
        header: Mapping[str, object],
        listeners: tuple[Callable[[Record], None], ...],
        past: Past | None = None,
    ) -> ListenedTrace:
        """Return a trace into a file, or kept in memory without ``path``; ``past`` is what a resumed run takes over."""
        trace = cls(None, header) if path is None else cls.at(path, header, past=past)
        trace.listeners = listeners
        return trace

    def write(self, step: int, event: str, node: Node | None = None, /, **details: object) -> None:
        """Write one record and give it to the listeners, ``node`` and values as they are."""
        super().write(step, event, node, **details)
        record = {"step": step, "event": event, **({} if node is None else {"node": node}), **details}
        for listener in self.listeners:
            try:
                listener(record)
            except BaseException as problem:  # this listener gets no more; the run ends with its problem
                self.listeners = tuple(other for other in self.listeners if other is not listener)
                self._fail(problem)


def lines_of(say: Callable[[int, str], None]) -> Callable[[Record], None]:
    """Return a listener that calls ``say`` with the world step and a line, for the records that people should see."""

    def tell(record: Record) -> None:
        line = line_of(record)
        if line is not None:
            say(record["step"], line)

    return tell


def line_of(record: Record) -> str | None:
    """Return the line about a record of the trace; None for what people need not see."""
    match record:
        case {"event": "started", "node": Node(kind="perform"), "action": action}:
            return str(action)
        case {"event": "ended", "node": Node(kind="perform"), "failure": failure}:
            return f"failed: {type(failure).__name__}: {failure}"
        case {"event": "started", "node": Node(kind="plan") as node}:
            return node.name
        case {"event": "recovery", "decision": decision} if decision != "none":
            return f"recovery: {decision}"
        case {"event": "completed", "lost": lost}:
            return f"cannot be resumed behind this step: {lost}"
        case {"event": "resumed"}:
            return "resumed"
        case {"event": "belief", "change": change, "name": name}:
            return f"  belief: {name} {change}"
    return None
