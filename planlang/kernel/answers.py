"""What a plan is told from outside: noted in the trace as it is told, so that a replay can tell it again.

The executive's answers, the values of world fluents and what calls in threads gave are all that a run depends on
besides plan, seed and schedule. An answer to a question is noted when it is another one than before.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from planlang.kernel.exact import Exact, Lost, dump, dump_failure

if TYPE_CHECKING:
    from planlang.kernel.fluent import WorldFluent
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.tree import Node

T = TypeVar("T")
_NEVER = object()


class Answers(Protocol):
    """Where answers come from."""

    def ask(self, question: str, find: Callable[[], Any]) -> Any:
        """The answer to a question; the same one counts until another is given."""

    def each(self, question: str, find: Callable[[], Any]) -> Any:
        """The next answer to a question to which each answer may be another one; a failure is an answer too."""

    def sample(self, fluent: WorldFluent[Any], read: Callable[[], Any]) -> Any:
        """The value of a world fluent."""

    def called(self, number: int, function: Callable[[], Any]) -> Callable[[], Any]:
        """What is called in a thread in place of a function."""

    def returned(self, node: Node, number: int, value: object, error: BaseException | None) -> None:
        """What a call in a thread gave."""


class Noted:
    """Answers from outside, noted in the trace."""

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._last: dict[str, Any] = {}
        self._keys = FluentKeys(scheduler)
        self._samples: dict[WorldFluent[Any], Any] = {}

    def ask(self, question: str, find: Callable[[], Any]) -> Any:
        """Ask, and note the answer if it is another one than before."""
        value = find()
        noted = _noted(value)
        if self._last.get(question, _NEVER) != noted:
            self._last[question] = noted
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
        value, error = None, None
        try:
            value = read()
        except Exception as raised:
            error = raised
        key = self._keys.of(fluent)
        if key is not None:
            noted = _noted(value, error)
            if self._samples.get(fluent, _NEVER) != noted:
                self._samples[fluent] = noted
                self._write("world", key[0], fluent=str(fluent), number=key[1], **noted)
        if error is not None:
            raise error
        return value

    def called(self, number: int, function: Callable[[], Any]) -> Callable[[], Any]:
        """The function."""
        return function

    def returned(self, node: Node, number: int, value: object, error: BaseException | None) -> None:
        """Note what a call in a thread gave."""
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
            return {"failure": _Same(dump_failure(error))}
        return {} if value is None else {"value": _Same(dump(value))}
    except Lost as lost:
        return {"lost": str(lost)}


class _Same(Exact):
    """JSON that is compared by its content."""

    __slots__ = ()
    __hash__ = None  # type: ignore[assignment]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Exact) and self.json == other.json
