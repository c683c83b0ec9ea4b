"""The tree of a run: constructs, branches, tags, plans and performed actions, each identified by its path.

Two interfaces record it: an :class:`Observer` gets events, a :class:`Recorded` supplies a run's inputs. The kernel
imports nothing that implements them: traces, journals and replays are in :mod:`planlang.runs`.
"""

from __future__ import annotations

import functools
from collections.abc import Awaitable, Callable
from enum import Enum
from types import FunctionType
from typing import Any, Protocol

from planlang.kernel.signals import BaseFluent


class Status(Enum):
    """States of a task; the last three are final. ``EVAPORATING`` is shown by handles only."""

    CREATED = "created"
    RUNNING = "running"
    SUSPENDED = "suspended"
    EVAPORATING = "evaporating"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    EVAPORATED = "evaporated"

    @property
    def final(self) -> bool:
        """True for a task that is dead."""
        return self in _FINAL


# Members as module globals, as access through the Enum costs as much as starting a coroutine.
SUCCEEDED, FAILED, EVAPORATED = Status.SUCCEEDED, Status.FAILED, Status.EVAPORATED
_FINAL = frozenset({SUCCEEDED, FAILED, EVAPORATED})


class Node:
    """A node of the tree of a run. Names are unique under a parent: repeated ones are numbered ``#2``, ``#3``."""

    __slots__ = ("_before", "_counts", "_path", "base_name", "kind", "number", "ordinal", "parent", "written")

    def __init__(self, parent: Node, kind: str, name: str) -> None:
        self.parent: Node | None = parent
        self.kind = kind
        self.base_name = name
        """The path element without its number."""
        self._counts: dict[str, int] | None = None
        self._before: dict[str, int] | None = None
        """Names under this node before the present attempt, and how often each occurred."""
        self._path: str | None = None
        self.number = 0
        """Number in the trace; 0 until it is assigned there."""
        self.written = ""
        """JSON text after ``"node": `` in the records of its start and end, kept for the second record."""
        counts = parent._counts
        if counts is None:
            parent._counts = {name: 1}
            self.ordinal = 1
        else:
            self.ordinal = counts[name] = counts.get(name, 0) + 1

    @property
    def name(self) -> str:
        """The path element."""
        return self.base_name if self.ordinal == 1 else f"{self.base_name}#{self.ordinal}"

    @property
    def path(self) -> str:
        """Names from the root, joined by ``/``."""
        if self._path is not None:
            return self._path
        parent = self.parent
        if parent is not None and parent._path is not None:
            name = self.base_name if self.ordinal == 1 else f"{self.base_name}#{self.ordinal}"
            path = self._path = f"{parent._path}/{name}"
            return path
        names: list[str] = []
        node: Node | None = self
        while node is not None and node._path is None:
            names.append(node.name)
            node = node.parent
        head = "" if node is None or node._path is None else f"{node._path}/"
        path = head + "/".join(reversed(names))
        self._path = path
        return path

    def begin_attempt(self) -> None:
        """Begin the body of this node again, as a recovery does: :attr:`occasion` numbers the nodes below it anew."""
        self._before = None if self._counts is None else dict(self._counts)

    @property
    def occasion(self) -> str:
        """The path, but with numbers that begin anew with each attempt: what an attempt repeats has it in common."""
        if self.parent is None:
            return self.base_name
        return self.parent._occasion_of(self.base_name, self.ordinal)

    def path_of_next(self, name: str) -> str:
        """Path that the next node of this name will have under this one."""
        ordinal = 1 if self._counts is None else self._counts.get(name, 0) + 1
        return f"{self.path}/{name}" if ordinal == 1 else f"{self.path}/{name}#{ordinal}"

    def occasion_of_next(self, name: str) -> str:
        """Occasion that the next node of this name will have under this one."""
        return self._occasion_of(name, 1 if self._counts is None else self._counts.get(name, 0) + 1)

    def _occasion_of(self, name: str, ordinal: int) -> str:
        number = ordinal - (0 if self._before is None else self._before.get(name, 0))
        return f"{self.occasion}/{name}" if number == 1 else f"{self.occasion}/{name}#{number}"

    @property
    def unused(self) -> bool:
        """True until a node is started under this one."""
        return self._counts is None


def unbound(branch: Callable[..., Any]) -> Callable[..., Any]:
    """Function that a branch calls: what ``partial`` binds arguments to, or the branch itself."""
    while isinstance(branch, functools.partial):
        branch = branch.func
    return branch


def name_of(branch: Callable[..., Any]) -> str:
    """Path element of a branch: the name of its function, ``lambda``, or the name of its class.

    Line numbers are not part of it, as random streams are derived from paths and must not change with inserted lines.
    """
    if branch.__class__ is not FunctionType:
        branch = unbound(branch)
    name: object = branch.__name__ if branch.__class__ is FunctionType else getattr(branch, "__name__", None)
    if name == "<lambda>":
        return "lambda"
    return name if isinstance(name, str) else type(branch).__name__


Body = Callable[[], Awaitable[Any]]


class Observer(Protocol):
    """Receiver of the events of a run, in order. ``step`` is plan time in world steps."""

    def begin(self, root: Node, fail: Callable[[BaseException], object]) -> None:
        """The run begins with its top-level task; call ``fail(error)`` to end it if it cannot be observed."""

    def started(self, step: int, node: Node, /, **details: object) -> None:
        """A node of the tree begins; called in its task, and an exception becomes the failure of the node."""

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """A node of the tree has ended."""

    def write(self, step: int, event: str, node: Node | None = None, /, **details: object) -> None:
        """Any other event, of a node of the tree or of the run as a whole."""

    def changed(self, fluent: BaseFluent[Any]) -> None:
        """A fluent was set."""

    def charged(self, kind: str, part: str, number: int) -> None:
        """Charge to the budgets around the running task: world steps "spent", or attempts "used"."""

    def end(self) -> None:
        """The run is over."""


class Recorded(Protocol):
    """Source of all inputs of a run besides plan, seed and schedule.

    An implementation records them, and supplies the recorded ones when a run is resumed or replayed.
    """

    def body(self, node: Node, body: Body) -> Body:
        """Choose what to await for a node that is about to begin: its body, or a function with the recorded result."""

    def answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Answer a question whose answer holds until a different one is recorded."""

    def next_answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Answer a question whose answer may differ each time; a failure is an answer too."""

    def sample(self, fluent: BaseFluent[Any], read: Callable[[], Any]) -> Any:
        """Sample a world fluent in this step."""

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """Number a call in a thread, and choose the function that is called."""

    def step_ends(self, step: int) -> bool:
        """Check at the end of a step whether the run still repeats recorded steps, for which the host does not advance.

        Raises if the run deviates from the recorded one.
        """
