"""A trace that others listen to, and the lines of progress that people read while a plan runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from planlang import Trace
from planlang.kernel.tree import Node
from planlang.runs import Past

Record = Mapping[str, Any]


class ToldTrace(Trace):
    """A trace that tells each record to listeners as well; written to a file when there is a path."""

    listeners: tuple[Callable[[Record], None], ...] = ()

    @classmethod
    def to(
        cls,
        path: Path | None,
        header: Mapping[str, object],
        listeners: tuple[Callable[[Record], None], ...],
        past: Past | None = None,
    ) -> ToldTrace:
        """A trace into a file, or kept in memory without ``path``; ``past`` is what a resumed run takes over."""
        trace = cls(None, header) if path is None else cls.at(path, header, past=past)
        trace.listeners = listeners
        return trace

    def write(self, step: int, event: str, node: Node | None = None, /, **details: object) -> None:
        """Write one record and tell it, ``node`` and values as they are."""
        super().write(step, event, node, **details)
        record = {"step": step, "event": event, **({} if node is None else {"node": node}), **details}
        for listener in self.listeners:
            try:
                listener(record)
            except BaseException as problem:  # it is told no more; the run ends with this
                self.listeners = tuple(other for other in self.listeners if other is not listener)
                self._fail(problem)


def progress_lines(rate: int, say: Callable[[str], None]) -> Callable[[Record], None]:
    """A listener that says, one line each, which actions begin, what fails and what is done about it."""

    def tell(record: Record) -> None:
        line = line_of(record)
        if line is not None:
            say(f"{record['step'] / rate:7.2f} s  {line}")

    return tell


def line_of(record: Record) -> str | None:
    """What a record of the trace says to people; None for what they need not see."""
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
