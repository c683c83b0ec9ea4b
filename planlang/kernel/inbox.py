"""The inbox of a run: what threads, signal handlers and tests hand over to the thread that runs the plan."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from queue import Empty, SimpleQueue

Item = Callable[[], object]

PATIENCE = 0.1
"""Longest uninterrupted wait [s]; where locks cannot be interrupted by signals, Ctrl-C is noticed this often."""


class Inbox:
    """First in, first out; any thread may :meth:`put`, only the run's own thread waits and takes.

    A ``SimpleQueue``, because its ``put`` may interrupt its ``get`` in the same thread, as a signal handler does.
    """

    def __init__(self) -> None:
        self._queue: SimpleQueue[Item | None] = SimpleQueue()
        self._seen: deque[Item | None] = deque()  # taken out of the queue by waiting for it

    def put(self, item: Item | None) -> None:
        """Hand over what is to be called in the run's thread; None only wakes it."""
        self._queue.put(item)

    @property
    def filled(self) -> bool:
        """True if something is there."""
        return bool(self._seen) or not self._queue.empty()

    def wait(self, seconds: float = PATIENCE) -> None:
        """Wait until something is there, but not longer than ``seconds`` and :data:`PATIENCE`."""
        try:
            self._seen.append(self._queue.get(timeout=min(seconds, PATIENCE)))
        except Empty:
            return

    def take(self) -> list[Item]:
        """What is there now; what comes meanwhile stays for the next time."""
        seen = self._seen
        for _ in range(self._queue.qsize()):
            seen.append(self._queue.get())
        items = [item for item in seen if item is not None]
        seen.clear()
        return items
