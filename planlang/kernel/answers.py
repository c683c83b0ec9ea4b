"""What a plan is told from outside: noted in the trace as it is told, so that a replay can tell it again.

The executive's answers, the values of world fluents and what calls in threads gave are all that a run depends on
besides plan, seed and schedule. An answer to a question is noted when it is another one than before.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from planlang.kernel.errors import PlanStructureError
from planlang.kernel.exact import Exact, Lost, dump, dump_failure
from planlang.kernel.past import outcome_of, told_in

if TYPE_CHECKING:
    from planlang.kernel.fluent import WorldFluent
    from planlang.kernel.past import Past
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.tree import Node

T = TypeVar("T")


class Answers(Protocol):
    """Where answers come from."""

    def ask(self, question: str, find: Callable[[], Any]) -> Any:
        """The answer to a question; the same one counts until another is given."""

    def each(self, question: str, find: Callable[[], Any]) -> Any:
        """The next answer to a question to which each answer may be another one; a failure is an answer too."""

    def sample(self, fluent: WorldFluent[Any], read: Callable[[], Any]) -> Any:
        """The value of a world fluent."""

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """The number of a call in a thread, and what is called in place of the function."""

    def returned(self, node: Node, number: int, value: object, error: BaseException | None) -> None:
        """What a call in a thread gave."""


class Noted:
    """Answers from outside, noted in the trace."""

    def __init__(self, scheduler: Scheduler, past: Past | None = None) -> None:
        """``past``: what a resumed run takes over. As long as it lasts the plan is told what it was told then."""
        self._scheduler = scheduler
        self._past = past
        self._last: dict[str, Any] = {} if past is None else past.answers()
        self._keys = FluentKeys(scheduler)
        self._samples: dict[WorldFluent[Any], Any] = {}

    def ask(self, question: str, find: Callable[[], Any]) -> Any:
        """Ask, and note the answer if it is another one than before."""
        value = find()
        if self._is_past():
            return value
        noted = _noted(value)
        if self._last.get(question) != (outcome := outcome_of(noted)):
            self._last[question] = outcome
            self._write("answer", None, asked=question, **noted)
        return value

    def each(self, question: str, find: Callable[[], Any]) -> Any:
        """Ask, and note the answer."""
        try:
            value = find()
        except Exception as error:
            self._write("answer", None, asked=question, **_noted(None, error))
            raise
        self._write("answer", None, asked=question, **_noted(value))
        return value

    def sample(self, fluent: WorldFluent[Any], read: Callable[[], Any]) -> Any:
        """Read, and note the value if it has changed; what process modules wait for is theirs and not noted."""
        if self._past is not None and self._is_past():
            return self._sample_past(fluent, self._past)
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
                self._write("world", key[0], fluent=str(fluent), number=key[1], **noted)
        if error is not None:
            raise error
        return value

    def _sample_past(self, fluent: WorldFluent[Any], past: Past) -> Any:
        key = self._keys.of(fluent)
        node, number = key or (None, 0)
        line = past.value_of(None if node is None else node.path, number, self._scheduler.now)
        if line is None:
            raise PlanStructureError(f"{fluent} was not read before, and cannot be read before the run goes on")
        self._samples[fluent] = outcome_of(line.record)
        return told_in(line)

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """The call itself; in a run's past what it gave."""
        if self._past is None or not self._is_past():
            return number, function
        found, line = self._past.call(node.path)
        return found, partial(told_in, line)

    def _is_past(self) -> bool:
        journal = self._scheduler.journal
        return journal is not None and journal.resuming

    def returned(self, node: Node, number: int, value: object, error: BaseException | None) -> None:
        """Note what a call in a thread gave."""
        if not self._is_past():
            self._write("answer", node, asked=f"call {number}", **_noted(value, error))

    def _write(self, event: str, node: Node | None, **details: object) -> None:
        scheduler = self._scheduler
        if node is None and scheduler.current is not None:
            node = scheduler.current.node
        if scheduler.trace is not None and not scheduler.draining:
            scheduler.trace.write(scheduler.now, event, node, **details)


class FluentKeys:
    """World fluents by the node in which they were first looked at, and their number there."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._keys: dict[WorldFluent[Any], tuple[Node | None, int] | None] = {}
        self._numbers: dict[Node | None, int] = {}

    def of(self, fluent: WorldFluent[Any]) -> tuple[Node | None, int] | None:
        """Node and number; None for a fluent of a process module at work."""
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
