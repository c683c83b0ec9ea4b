"""Recorded inputs: what a plan is given from outside, noted in the trace and given again when a run is repeated.

The executive's answers, the values of world fluents and the results of calls in threads are all that a run depends on
besides plan, seed and schedule. An answer to a question is noted when it is another one than before.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from planlang.kernel.core import Scheduler
from planlang.kernel.errors import PlanStructureError
from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import Node
from planlang.runs.codec import Exact, Lost, dump, dump_failure
from planlang.runs.recorded_run import Past, outcome_of, value_in
from planlang.runs.trace import ResumedTrace, Trace


class RecordedInputs:
    """Half of :class:`planlang.kernel.observer.Recorded`: inputs of a run, noted in its trace.

    ``past``: what a resumed run takes over. As long as it lasts the plan is given what it was given then.
    """

    def __init__(self, scheduler: Scheduler, trace: Trace, past: Past | None) -> None:
        self._scheduler = scheduler
        self._trace = trace
        self._past = past
        self._ahead = trace if isinstance(trace, ResumedTrace) else None
        """The trace, as long as the run repeats what it takes over."""
        self._last: dict[str, Any] = {} if past is None else past.answers()
        self._keys = FluentKeys(scheduler)
        self._samples: dict[BaseFluent[Any], Any] = {}

    def answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Ask, and note the answer if it is another one than before."""
        value = find()
        if self._ahead is not None:
            return value
        noted = _noted(value)
        if self._last.get(question) != (outcome := outcome_of(noted)):
            self._last[question] = outcome
            self._note("answer", self._node(), asked=question, **noted)
        return value

    def next_answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Ask, and note the answer."""
        try:
            value = find()
        except Exception as error:
            self._note("answer", self._node(), asked=question, **_noted(None, error))
            raise
        self._note("answer", self._node(), asked=question, **_noted(value))
        return value

    def sample(self, fluent: BaseFluent[Any], read: Callable[[], Any]) -> Any:
        """Read, and note the value if it has changed; what process modules wait for is their own and not noted."""
        if self._ahead is not None:
            return self._sample_past(fluent)
        value, error = None, None
        try:
            value = read()
        except Exception as raised:
            error = raised
        key = self._keys.of(fluent)
        if key is not None:
            noted = _noted(value, error)
            if self._samples.get(fluent) != (outcome := outcome_of(noted)):
                self._samples[fluent] = outcome
                self._note("world", key[0] or self._node(), fluent=str(fluent), number=key[1], **noted)
        if error is not None:
            raise error
        return value

    def _sample_past(self, fluent: BaseFluent[Any]) -> Any:
        assert self._past is not None
        node, number = self._keys.of(fluent) or (None, 0)
        line = self._past.value_of(None if node is None else node.path, number, self._scheduler.now)
        if line is None:
            raise PlanStructureError(f"{fluent} was not read before, and cannot be read before the run goes on")
        self._samples[fluent] = outcome_of(line.record)
        return value_in(line)

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """Return the call itself; in the part of a run that is taken over, what it gave then."""
        if self._past is None:
            return number, function
        if self._ahead is None:
            return max(number, self._past.calls + 1), function
        found, line = self._past.call(node.path)
        return found, partial(value_in, line)

    def note_call(self, node: Node, number: int, outcome: dict[str, Any]) -> None:
        """Note the result or the failure of a call in a thread."""
        if self._ahead is None:
            self._note("answer", node, asked=f"call {number}", **_noted(outcome.get("result"), outcome.get("failure")))

    def _node(self) -> Node | None:
        task = self._scheduler.current
        return None if task is None else task.node

    def _note(self, event: str, node: Node | None, **details: object) -> None:
        if not self._scheduler.draining:
            self._trace.write(self._scheduler.now, event, node, **details)


class FluentKeys:
    """World fluents by the node in which they were first looked at, and their number there."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._keys: dict[BaseFluent[Any], tuple[Node | None, int] | None] = {}
        self._numbers: dict[Node | None, int] = {}

    def of(self, fluent: BaseFluent[Any]) -> tuple[Node | None, int] | None:
        """Return node and number; None for a fluent of a process module at work."""
        if fluent not in self._keys:
            task = self._scheduler.current
            node = None if task is None else task.node
            around = node
            while around is not None and around.kind != "perform":
                around = around.parent
            if around is not None:
                self._keys[fluent] = None
            else:
                number = self._numbers[node] = self._numbers.get(node, 0) + 1
                self._keys[fluent] = (node, number)
        return self._keys[fluent]


def _noted(value: object, error: BaseException | None = None) -> dict[str, Any]:
    try:
        if error is not None:
            return {"failure": Exact(dump_failure(error))}
        return {} if value is None else {"value": Exact(dump(value))}
    except Lost as lost:
        return {"lost": str(lost)}
