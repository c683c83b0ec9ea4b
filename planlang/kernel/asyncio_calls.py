"""asyncio in plans: asyncio code runs only through ``in_thread``, in an asyncio event loop of a separate thread."""

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
"""The wrong and the right code, for error messages."""


class AsyncioCall:
    """Blocking call of an asyncio function: runs it in a new event loop of the calling thread."""

    def __init__(self, function: Callable[[], Coroutine[Any, Any, Any]]) -> None:
        self._function = function
        self._lock = threading.Lock()
        self._is_cancelled = False
        self._cancel: Callable[[], object] | None = None
        """Cancels the running function; None when it is not running."""

    def __call__(self) -> Any:
        """Run the function and return its result."""
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
        """Cancel the function from another thread; no effect after it has ended."""
        with self._lock:
            self._is_cancelled = True
            if self._cancel is not None:
                self._cancel()


def missing_loop_error(error: Exception) -> PlanStructureError | None:
    """Explain the error that asyncio code raised because a plan has no asyncio event loop; None for other errors."""
    modules = []
    link = error.__traceback__
    while link is not None:
        modules.append(str(link.tb_frame.f_globals.get("__name__")))
        link = link.tb_next
    # Queues and locks of asyncio that are awaited in a plan fail in many ways, but always in a frame of asyncio.
    raised_in_asyncio = modules[-1].partition(".")[0] == "asyncio" and "asyncio.runners" not in modules
    if str(error) != "no running event loop" and not (
        raised_in_asyncio and isinstance(error, (RuntimeError, AttributeError))
    ):
        return None
    message = f"asyncio code needs an asyncio event loop; plans do not run in one ({type(error).__name__}: {error})"
    return PlanStructureError(contrast(message, *ADVICE)).with_traceback(error.__traceback__)
