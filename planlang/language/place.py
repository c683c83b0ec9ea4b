"""The place that the nearest enclosing ``at_location`` keeps the base at."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextvars import ContextVar


class Place:
    """``displaced`` iff a nested scope has moved the base and left it elsewhere; :meth:`establish` goes back."""

    __slots__ = ("_go", "displaced")

    def __init__(self, go: Callable[[], Awaitable[None]]) -> None:
        self._go = go
        self.displaced = False

    async def establish(self) -> None:
        """Go back to this place."""
        await self._go()
        self.displaced = False


place: ContextVar[Place | None] = ContextVar("place", default=None)
