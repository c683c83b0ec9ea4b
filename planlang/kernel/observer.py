"""Two interfaces record a run: an :class:`Observer` hears what happened, a :class:`Recorded` is asked before it does.

The kernel imports nothing that implements them: traces, journals and replays are in :mod:`planlang.runs`.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, Protocol

from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import Node, Status

Body = Callable[[], Awaitable[Any]]


class Observer(Protocol):
    """Told what happens in a run, in order. ``step`` is plan time in world steps."""

    def begin(self, root: Node, fail: Callable[[BaseException], object]) -> None:
        """Hear that the run begins, with its top-level task; ``fail(error)`` ends it if it cannot be observed."""

    def started(self, step: int, node: Node, /, **details: object) -> None:
        """Hear that a node of the tree begins, in its task; what this raises, the node fails with."""

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """Hear that a node of the tree has ended."""

    def write(self, step: int, event: str, node: Node | None = None, /, **details: object) -> None:
        """Hear of anything else, in a node of the tree or about the run as a whole."""

    def changed(self, fluent: BaseFluent[Any]) -> None:
        """Hear that a fluent was set."""

    def charged(self, kind: str, part: str, number: int) -> None:
        """Hear what is charged to the budgets around the running task: world steps "spent", or attempts "used"."""

    def end(self) -> None:
        """Hear that the run is over."""


class Recorded(Protocol):
    """Asked for what a run depends on besides plan, seed and schedule, before it happens.

    So it can be recorded, and given again when a run is resumed or replayed.
    """

    def body(self, node: Node, body: Body) -> Body:
        """Return what to await for a node that is about to begin: its body, or what gives its result."""

    def answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Return the answer to a question; the same one counts until another is given."""

    def next_answer(self, question: str, find: Callable[[], Any]) -> Any:
        """Return the next answer to a question to which each answer may be another one; a failure is an answer too."""

    def sample(self, fluent: BaseFluent[Any], read: Callable[[], Any]) -> Any:
        """Return the value of a world fluent in this step."""

    def call(self, node: Node, number: int, function: Callable[[], Any]) -> tuple[int, Callable[[], Any]]:
        """Return the number of a call in a thread, and what is called in place of the function."""

    def step_ends(self, step: int) -> bool:
        """Return True if the host is not asked to let time pass, since the run is still in what it takes over.

        Asked when nothing more can happen in a step. Raises if the run does not repeat the recorded one.
        """
