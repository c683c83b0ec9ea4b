"""The place that the nearest enclosing ``at_location`` keeps the base at."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextvars import ContextVar
from typing import TYPE_CHECKING

from planlang.failures import ObjectUndeliverable, PlanFailure

if TYPE_CHECKING:
    from planlang.designators import Action
    from planlang.language.executive import Executive


class Place:
    """``displaced`` iff a nested scope has moved the base and left it elsewhere; :meth:`establish` goes back.

    ``failure`` is the one for which the body runs again, None on the first run.
    """

    __slots__ = ("_go", "_now", "_released", "displaced", "failure")

    def __init__(self, go: Callable[[], Awaitable[None]]) -> None:
        self._go = go
        self._released: set[Action] = set()
        self._now: set[Action] = set()
        self.displaced = False
        self.failure: PlanFailure | None = None

    def again(self, failure: PlanFailure) -> None:
        """The body runs again because of a failure."""
        self._released |= self._now
        self._now.clear()
        self.failure = failure

    def refusal(self, action: Action, executive: Executive) -> ObjectUndeliverable | None:
        """The failure of an action that would let go, a second time, of what is still to be delivered."""
        held = tuple(executive.held()) if action in self._released else ()
        if not held:
            return None
        what = ", ".join(held)
        refused = ObjectUndeliverable(f"{what} is still held, and {action} would let it go again", what=what)
        refused.__cause__ = self.failure
        return refused

    def released(self, action: Action) -> None:
        """An action that lets go has been performed."""
        self._now.add(action)

    async def establish(self) -> None:
        """Go back to this place."""
        await self._go()
        self.displaced = False


place: ContextVar[Place | None] = ContextVar("place", default=None)
