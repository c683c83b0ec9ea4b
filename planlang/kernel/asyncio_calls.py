"""asyncio in plans: its async functions run in an event loop of a thread of their own, and nowhere else."""

from __future__ import annotations

import threading
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any

from planlang.kernel.errors import PlanStructureError
from planlang.misuse import contrast

ADVICE = (
    "await asyncio.sleep(1)    or await fetch()",
    "await sleep(1)    or, for an async function of asyncio, await in_thread(fetch)",
)
"""The wrong and the right code."""


class AsyncioCall:
    """An async function of asyncio as a plain one, which runs it in an event loop of the thread that calls it."""

    def __init__(self, function: Callable[[], Coroutine[Any, Any, Any]]) -> None:
        self._function = function
        self._lock = threading.Lock()
        self._is_cancelled = False
        self._cancel: Callable[[], object] | None = None
        """Cancels the function, while it runs."""

    def __call__(self) -> Any:
        """Run the function to its end; returns its result."""
        import asyncio  # few plans need it, and it takes as long to import as the plan language

        async def main() -> Any:
            task = asyncio.current_task()
            assert task is not None
            with self._lock:
                if self._is_cancelled:
                    raise asyncio.CancelledError
                self._cancel = partial(asyncio.get_running_loop().call_soon_threadsafe, task.cancel)
            try:
                return await self._function()
            finally:
                with self._lock:
                    self._cancel = None

        return asyncio.run(main())

    def cancel(self) -> None:
        """Cancel the function, from another thread; nothing once it has ended."""
        with self._lock:
            self._is_cancelled = True
            if self._cancel is not None:
                self._cancel()


def explained(error: Exception) -> PlanStructureError | None:
    """Return the error of asyncio code that found no event loop, as it stands in a plan; None for any other error."""
    modules = []
    link = error.__traceback__
    while link is not None:
        modules.append(str(link.tb_frame.f_globals.get("__name__")))
        link = link.tb_next
    inside = modules[-1].partition(".")[0] == "asyncio" and "asyncio.runners" not in modules
    if str(error) != "no running event loop" and not (inside and isinstance(error, (RuntimeError, AttributeError))):
        return None
    message = f"asyncio code needs an event loop of asyncio, which a plan has not ({type(error).__name__}: {error})"
    return PlanStructureError(contrast(message, *ADVICE)).with_traceback(error.__traceback__)
