"""The trace of a resumed run: first the plan repeats what the records say, then new records are written behind them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from planlang.kernel.errors import RunError
from planlang.kernel.tree import SUCCEEDED, Node, Status
from planlang.runs.codec import Exact
from planlang.runs.encoding import encode
from planlang.runs.recorded_run import BOOKKEEPING, Line, Past
from planlang.runs.recorded_run import details as details_of
from planlang.runs.trace import Trace

FROM_OUTSIDE = frozenset({"interrupted", "drained"})
"""Events that need not be the same when a run is repeated."""


class Different(RunError):
    """A run that repeats a recorded one does something else; ``line`` is that of the record, None at its end."""

    def __init__(self, message: str, line: int | None, recorded: object = None, found: object = None) -> None:
        super().__init__(message)
        self.line, self.recorded, self.found = line, recorded, found


class ResumedTrace(Trace):
    """A trace that compares with what is recorded until :meth:`go_on`, and hands on to ``inner`` from then.

    What the plan writes on its way is compared with the records of the same step: tasks that run side by side may
    come to it in another order. The first difference is kept in :attr:`problem` for the scheduler to raise.
    """

    def __init__(self, inner: Trace, past: Past) -> None:
        super().__init__(inner.events)
        self._inner = inner
        self._ahead: dict[int, list[Line]] = {}
        for line in past.expected():
            self._ahead.setdefault(line.step, []).append(line)
        self._going_on = False
        self.problem: Different | None = None
        if not inner.continues:
            inner.take_over((line.record for line in past.kept), past.nodes)

    def go_on(self, step: int, past: Past) -> None:
        """The records end here."""
        self._going_on = True
        again = {"again": Exact(list(past.again))} if past.again else {}
        self._inner.write(step, "resumed", **again)

    def check(self, now: int) -> None:
        """Called when a step is over: what was recorded of it has to have happened. Raises Different."""
        if self.problem is None and self._ahead:
            step = min(self._ahead)
            if step <= now:
                line = self._ahead[step][0]
                self.problem = Different(
                    f"the plan does not repeat what is recorded in line {line.number}: {shown(line.record)}",
                    line.number,
                    line.record,
                )
        if self.problem is not None:
            raise self.problem

    def write(self, step: int, event: str, node: Node | None = None, /, **details: object) -> None:
        """Compare or write a record."""
        if self._is_recorded(step, event, node, details) or (event in BOOKKEEPING and not self._going_on):
            return
        if self._going_on or event in FROM_OUTSIDE:
            self._inner.write(step, event, node, **details)
        elif self.problem is None:
            found = {"step": step, "event": event, "path": None if node is None else node.path, **encode(details)}
            ahead = self._ahead.get(min(self._ahead, default=step), [])
            line = ahead[0].number if ahead else None
            where = f" where line {line} says {shown(ahead[0].record)}" if ahead else ""
            message = f"the plan does not repeat what is recorded: it does {shown(found)}{where}"
            self.problem = Different(message, line, ahead[0].record if ahead else None, found)

    def started(self, step: int, node: Node, /, **details: object) -> None:
        """A node of the tree begins."""
        if self._going_on and not self._ahead:
            self._inner.started(step, node, **details)
        else:
            self.write(step, "started", node, **details)

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """A node of the tree ends."""
        if self._going_on and not self._ahead:
            self._inner.ended(step, node, outcome, result, failure)
        elif failure is not None:
            self.write(step, "ended", node, status=outcome.value, failure=failure)
        elif result is not None and outcome is SUCCEEDED:
            self.write(step, "ended", node, status=outcome.value, result=result)
        else:
            self.write(step, "ended", node, status=outcome.value)

    def _is_recorded(self, step: int, event: str, node: Node | None, details: Mapping[str, object]) -> bool:
        lines = self._ahead.get(step)
        if not lines or node is None:
            return False
        inside = {key: encode(value) for key, value in details.items()}
        for place, line in enumerate(lines):
            if line.event == event and line.path == node.path and details_of(line.record) == inside:
                node.number = int(line.record["node"])
                del lines[place]
                if not lines:
                    del self._ahead[step]
                return True
        return False

    def begin(self, root: Node, fail: Callable[[BaseException], object]) -> None:
        """Hand what goes wrong with the file to ``fail``."""
        self._inner.begin(root, fail)

    def end(self) -> None:
        """Write through."""
        self._inner.end()

    def sync(self) -> None:
        """Have what was written so far survive a crash of the machine."""
        self._inner.sync()


def shown(record: Mapping[str, Any]) -> str:
    """Return a record in one line: step, place in the tree, event, details."""
    where = record.get("path") or record.get("name")
    details = {key: value for key, value in details_of(record).items() if key != "path"}
    more = ", ".join(f"{key} {value}" for key, value in details.items())
    return " ".join(str(part) for part in (f"step {record['step']}:", where, record["event"], more) if part)
