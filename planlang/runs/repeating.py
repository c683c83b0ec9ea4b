"""Repetition of an interrupted run: the plan is run again up to its last record, and continues from there.

The first record that differs ends the run, before anything is written. Calls to the outside that had returned are not
made again; their recorded results are used.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from planlang.kernel.errors import RunError
from planlang.kernel.tree import Node, Status
from planlang.runs.codec import encode
from planlang.runs.recorded_run import DamagedTrace, Line, RecordedRun, call_of, details, value_in
from planlang.runs.trace import FROM_OUTSIDE, Different, Earlier, Trace, shown

SAME = 1e-9
"""Tolerance for numbers: the same run differs by 1e-14 between processors, different decisions by 1e-6 or more
(docs/reference/trace.md)."""
_DECIMAL = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")


def agree(recorded: Any, found: Any) -> bool:
    """Check whether two values of records are equal, with a tolerance of 1e-9 for numbers, also for those in texts."""
    match recorded, found:
        case float(), float():
            return math.isclose(recorded, found, rel_tol=SAME, abs_tol=SAME) or repr(recorded) == repr(found)
        case str(), str() if recorded != found:
            numbers = (map(float, _DECIMAL.findall(text)) for text in (recorded, found))
            return _DECIMAL.sub("#", recorded) == _DECIMAL.sub("#", found) and agree(*map(list, numbers))
        case dict(), dict():
            return recorded.keys() == found.keys() and all(agree(recorded[key], found[key]) for key in recorded)
        case list(), list():
            return len(recorded) == len(found) and all(map(agree, recorded, found))
    return bool(recorded == found)


class Repetition:
    """The records of an interrupted run that are repeated: all before an interrupt from outside, if there was one.

    Raises OlderTrace, and DamagedTrace if the result of a call to the outside cannot be read.
    """

    def __init__(self, recorded: RecordedRun) -> None:
        recorded.check_repeatable()
        interrupts = (index for index, line in enumerate(recorded.lines) if line.event in FROM_OUTSIDE)
        self.recorded = recorded
        self.kept: Sequence[Line] = recorded.lines[: next(interrupts, len(recorded.lines))]
        self.nodes = max((int(line.record.get("node", 0)) for line in self.kept), default=0)
        self.expected = [line for line in self.kept if line.event not in ("header", "resumed")]
        answers = (line for line in self.kept if line.event == "answer")
        self.answers = {
            (line.path, asked): _checked(line)
            for line in answers
            if (asked := str(line.record.get("asked"))).startswith(OUTSIDE)
        }
        """Results of calls to the outside, by path and question."""
        self.calls = max((call_of(line) for line in self.kept if line.event == "called"), default=0)
        """The highest number of a call."""

    @property
    def skipped(self) -> Line | None:
        """The record of an earlier resumption that skipped completed steps, if there is one."""
        return next((line for line in self.kept if line.event == "resumed" and "repeated" not in line.record), None)

    @property
    def in_flight(self) -> list[Line]:
        """The records of calls to the outside that had not ended when the run was cut off; they are made again."""
        ended = {str(line.record.get("call")) for line in self.kept if line.event == "returned"}
        calls = [line for line in self.kept if line.event == "called" and str(line.record.get("call")) not in ended]
        modules = [line for line in self.kept if line.event == "outside" and (line.path, ONCE) not in self.answers]
        return calls + modules

    @property
    def lost(self) -> Line | None:
        """The record of the first call to the outside whose result could not be stored, if there is one."""
        return next((line for line in self.answers.values() if "lost" in line.record), None)


ONCE = "once"
"""Question under which the result of a process module with ``once`` is recorded."""
OUTSIDE = (ONCE, "call ")
"""Prefixes of questions that are answered by calls to the outside."""


class RepeatedTrace(Trace):
    """Trace that compares a run with its records, and after the last one writes to the trace that ``go_on`` returns.

    The first difference ends the run, before anything is written. Listeners receive all records.
    """

    is_compared = True

    def __init__(self, repetition: Repetition, go_on: Callable[[Earlier], Trace]) -> None:
        super().__init__(None)
        self.repetition = repetition
        self._go_on = go_on
        self._root: Node
        self._is_over = False
        """True after a difference or an interrupt: nothing is compared or written any more."""
        self._expected = repetition.expected
        self._place = 0
        self._inner: Trace | None = None

    def write_header(self, **known: object) -> None:
        """Write nothing, as the caller has compared the header with the recorded one."""
        self._pass(0)

    def begin(self, root: Node, fail: Callable[[BaseException], object]) -> None:
        """Start the trace; differences and errors of writing are passed to ``fail``."""
        super().begin(root, fail)
        self._root = root
        if self._inner is not None:
            self._inner.begin(root, fail)

    def started(self, step: int, node: Node, /, **details: object) -> None:
        """Compare or write the start of a node."""
        if self._inner is None:
            super().started(step, node, **details)
        else:
            self._inner.started(step, node, **details)

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """Compare or write the end of a node."""
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
        """Flush the trace; raises Different if the run has ended before its records."""
        super().end()
        if self._inner is not None:
            self._inner.end()
        elif not self._is_over:
            self._differ("nothing: the plan has ended")

    def sync(self) -> None:
        """Write the trace to disk, so that it survives a crash of the machine."""
        if self._inner is not None:
            self._inner.sync()

    def close(self) -> None:
        """Close the trace that is written, if there is one."""
        if self._inner is not None:
            self._inner.close()

    # -- the outside

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """Number of a call as recorded, and a function that returns its recorded result, or makes it if it had none."""
        if self._inner is not None:
            return max(number, self.repetition.calls + 1), function
        recorded_number = self._expected[self._place].record.get("call", number)
        line = self.repetition.answers.get((node.path, f"call {recorded_number}"))

        def call_again() -> Any:
            self._check_outside()
            return function()

        return recorded_number, call_again if line is None else partial(value_in, line)

    def _check_outside(self) -> None:
        if self._is_over:
            raise RunError("calls to the outside are not made: the run deviates from its records, or was stopped")

    def once(self, node: Node) -> Line | None:
        """Recorded result of a process module with ``once``; records from inside its execution are not repeated.

        None if it had not ended; RunError if the run has deviated from its records.
        """
        self._check_outside()
        line = None if self._inner is not None else self.repetition.answers.get((node.path, ONCE))
        if line is None:
            return None
        ahead = self._expected[self._place :]
        inside = {each.number for each in ahead if each.number < line.number and _is_in(each.path, node.path)}
        self._expected = [each for each in ahead if each.number not in inside]
        self._place = 0
        return line

    # -- comparing

    def _compare(self, step: int, event: str, node: Node | None, more: Mapping[str, object]) -> None:
        line = self._expected[self._place]
        inside = json.loads(json.dumps({key: encode(value) for key, value in more.items()}))
        path = None if node is None else node.path
        if (line.step, line.event, line.path) != (step, event, path) or not agree(_content(line.record), inside):
            self._differ(shown({"step": step, "event": event, "path": path, **inside}))
            return
        if node is not None:
            node.number = int(line.record["node"])
        self._tell(line.record, node)
        self._place += 1
        self._pass(step)

    def _pass(self, step: int) -> None:
        """Continue the run after the last record."""
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
    """Check that the answer in a record can be restored; raises DamagedTrace."""
    try:
        value_in(line)
    except DamagedTrace:
        raise
    except Exception:  # the recorded failure
        pass
    return line


def _content(record: Mapping[str, Any]) -> dict[str, Any]:
    """Content of a record, to compare two runs: without its number and event and, in a task, without the task."""
    if "node" in record:
        return details(record)
    return {key: value for key, value in record.items() if key not in ("step", "event")}


def _is_in(path: str | None, ancestor: str) -> bool:
    return path is not None and (path == ancestor or path.startswith(f"{ancestor}/"))
