"""Running an interrupted run again up to its last record, and on from there.

Nothing is written before all records are repeated: the first that differs ends the run. Calls to the outside that had
returned are not made again; they are answered from their records.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from planlang.kernel.errors import RunError
from planlang.kernel.tree import Node, Status
from planlang.runs.codec import encode
from planlang.runs.comparing import agree
from planlang.runs.recorded_run import DamagedTrace, Line, RecordedRun, call_of, details, value_in
from planlang.runs.trace import FROM_OUTSIDE, Different, Earlier, Trace, shown


class Repetition:
    """The records of an interrupted run that are repeated: all, up to where it was told to end.

    Raises DamagedTrace if what a call to the outside gave cannot be read.
    """

    def __init__(self, recorded: RecordedRun) -> None:
        told = (place for place, line in enumerate(recorded.lines) if line.event in FROM_OUTSIDE)
        self.recorded = recorded
        self.kept: Sequence[Line] = recorded.lines[: next(told, len(recorded.lines))]
        self.nodes = max((int(line.record.get("node", 0)) for line in self.kept), default=0)
        self.expected = [line for line in self.kept if line.event not in ("header", "resumed")]
        answers = (line for line in self.kept if line.event == "answer")
        self.answers = {
            (line.path, asked): _checked(line)
            for line in answers
            if (asked := str(line.record.get("asked"))).startswith(OUTSIDE)
        }
        """What calls to the outside gave."""
        self.calls = max((call_of(line) for line in self.kept if line.event == "called"), default=0)
        """The highest number that a call has been given."""

    @property
    def skipped(self) -> Line | None:
        """The record with which an earlier resumption took steps over without running them, None if none did."""
        return next((line for line in self.kept if line.event == "resumed" and "repeated" not in line.record), None)

    @property
    def in_flight(self) -> list[Line]:
        """The records of what had begun outside, and not ended, when the run was cut off: it is done again."""
        ended = {str(line.record.get("call")) for line in self.kept if line.event == "returned"}
        calls = [line for line in self.kept if line.event == "called" and str(line.record.get("call")) not in ended]
        modules = [line for line in self.kept if line.event == "outside" and (line.path, ONCE) not in self.answers]
        return calls + modules

    @property
    def lost(self) -> Line | None:
        """The record of the first call to the outside whose result did not survive JSON, None if all did."""
        return next((line for line in self.answers.values() if "lost" in line.record), None)


ONCE = "once"
"""The question that the result of a process module answers that must not be executed again."""
OUTSIDE = (ONCE, "call ")
"""How questions begin that are answered by the outside."""


class RepeatedTrace(Trace):
    """Compares what a run writes with what is recorded of it; behind that it is the trace that ``go_on`` returns.

    The first difference ends the run, before anything is written. Listeners hear of all records.
    """

    is_compared = True

    def __init__(self, repetition: Repetition, go_on: Callable[[Earlier], Trace]) -> None:
        super().__init__(None)
        self.repetition = repetition
        self._go_on = go_on
        self._root: Node
        self._is_over = False
        """True when nothing is compared any more, and nothing written."""
        self._expected = repetition.expected
        self._place = 0
        self._inner: Trace | None = None

    def write_header(self, **known: object) -> None:
        """Write nothing: the header is that of the recorded run, with which the caller has compared its own."""
        self._pass(0)

    def begin(self, root: Node, fail: Callable[[BaseException], object]) -> None:
        """Hand differences, and what goes wrong in writing, to ``fail``."""
        super().begin(root, fail)
        self._root = root
        if self._inner is not None:
            self._inner.begin(root, fail)

    def started(self, step: int, node: Node, /, **details: object) -> None:
        """Compare or write that a node of the tree begins."""
        if self._inner is None:
            super().started(step, node, **details)
        else:
            self._inner.started(step, node, **details)

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """Compare or write that a node of the tree ends."""
        if self._inner is None:
            super().ended(step, node, outcome, result, failure)
        else:
            self._inner.ended(step, node, outcome, result, failure)

    def write(self, step: int, event: str, node: Node | None = None, /, **more: object) -> None:
        """Compare a record with the next recorded one, or write it."""
        if self._inner is not None:
            self._inner.write(step, event, node, **more)
        elif event == "interrupted":
            self._is_over = True
        elif not self._is_over:
            self._compare(step, event, node, more)

    def end(self) -> None:
        """Write through; raises Different if the run has ended before its records have."""
        super().end()
        if self._inner is not None:
            self._inner.end()
        elif not self._is_over:
            self._differ("nothing: the plan has ended")

    def sync(self) -> None:
        """Let what was written so far survive a crash of the machine."""
        if self._inner is not None:
            self._inner.sync()

    def close(self) -> None:
        """Close the trace that goes on, if it does."""
        if self._inner is not None:
            self._inner.close()

    # -- the outside

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """Return the recorded number of a call and what gives its recorded result, if it had returned."""
        if self._inner is not None:
            return max(number, self.repetition.calls + 1), function
        coming = self._expected[self._place].record.get("call", number)
        line = self.repetition.answers.get((node.path, f"call {coming}"))
        return coming, partial(self._asked, function) if line is None else partial(value_in, line)

    def _asked(self, function: Callable[[], Any]) -> Any:
        """Call what had not returned; raises RunError for what the recorded run did not call."""
        self._check_outside()
        return function()

    def _check_outside(self) -> None:
        if self._is_over:
            raise RunError(
                "nothing outside is asked any more: the run does not repeat what is recorded, or was stopped"
            )

    def once(self, node: Node) -> Line | None:
        """Return the record of what a module gave that is not executed again; what it did then is not expected.

        None if it had not ended; raises RunError for what the recorded run did not do.
        """
        self._check_outside()
        line = None if self._inner is not None else self.repetition.answers.get((node.path, ONCE))
        if line is None:
            return None
        ahead = self._expected[self._place :]
        inside = (one for one in ahead if one.number < line.number and _is_in(one.path, node.path))
        passed = {one.number for one in inside}
        self._expected = [one for one in ahead if one.number not in passed]
        self._place = 0
        return line

    # -- comparing

    def _compare(self, step: int, event: str, node: Node | None, more: Mapping[str, object]) -> None:
        line = self._expected[self._place]
        inside = json.loads(json.dumps({key: encode(value) for key, value in more.items()}))
        path = None if node is None else node.path
        if (line.step, line.event, line.path) != (step, event, path) or not agree(_told(line.record), inside):
            self._differ(shown({"step": step, "event": event, "path": path, **inside}))
            return
        if node is not None:
            node.number = int(line.record["node"])
        self._tell(line.record, node)
        self._place += 1
        self._pass(step)

    def _pass(self, step: int) -> None:
        """Go on if the records are at their end."""
        if self._place < len(self._expected):
            return
        self._inner = inner = self._go_on(self.repetition)
        inner.listeners, self.listeners = self.listeners, ()
        if self._on_failure is not None:
            inner.begin(self._root, self._on_failure)
        inner.write(step, "resumed", repeated=self.repetition.kept[-1].number)

    def _differ(self, found: str) -> None:
        line = self._expected[self._place]
        recorded = shown({**line.record, "path": line.path})
        message = f"line {line.number} is not repeated\n  recorded  {recorded}\n  found     {found}"
        self._is_over = True
        self._fail(Different(message, line.number, line.record, found))


def _checked(line: Line) -> Line:
    """Return the record of an answer; raises DamagedTrace if it cannot be given again."""
    try:
        value_in(line)
    except DamagedTrace:
        raise
    except Exception:  # the failure that it tells
        pass
    return line


def _told(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a record tells beside its frame, which is smaller for what happens in no node."""
    if "node" in record:
        return details(record)
    return {key: value for key, value in record.items() if key not in ("step", "event")}


def _is_in(path: str | None, around: str) -> bool:
    return path is not None and (path == around or path.startswith(f"{around}/"))
