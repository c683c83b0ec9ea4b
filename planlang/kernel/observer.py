"""The two interfaces for recording: an :class:`Observer` gets events, a :class:`Recorded` supplies a run's inputs.

The kernel imports nothing that implements them: traces, journals and replays are in :mod:`planlang.runs`.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, Protocol

from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import Node, Status

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
