"""Forgotten ``await``: a coroutine that plan code makes and drops becomes an error at the task's next checkpoint."""

from __future__ import annotations

import gc
import linecache
import os
import warnings
from collections.abc import Callable
from types import CoroutineType, FrameType
from typing import TYPE_CHECKING, Any

from planlang.kernel.errors import PlanStructureError
from planlang.kernel.listing import user_frame
from planlang.kernel.park import running
from planlang.misuse import contrast

if TYPE_CHECKING:
    from planlang.kernel.task import Task

_ATTRIBUTE = "_warn_unawaited_coroutine"  # what the interpreter calls when it frees a coroutine that never ran


class _Watch:
    """What the interpreter's own warning was, once we stand before it; whether the collector is at work."""

    warn: Callable[[Any], None] | None = None
    collecting = False


def watch() -> None:
    """Stand before the interpreter's warning about coroutines that were never awaited; once per process."""
    if _Watch.warn is None:
        _Watch.warn = getattr(warnings, _ATTRIBUTE, None)
        if _Watch.warn is not None:
            setattr(warnings, _ATTRIBUTE, _dropped)
            gc.callbacks.append(_collector)


def _collector(phase: str, details: dict[str, int]) -> None:
    _Watch.collecting = phase == "start"


def _dropped(coroutine: CoroutineType[Any, Any, Any]) -> None:
    """A coroutine was freed that never ran. It is the running task's mistake if its line is the one that made it."""
    scheduler = running.scheduler
    task = None if scheduler is None else scheduler.current
    if task is not None and task.overrun is None and not task.thrown and not _Watch.collecting:
        frame = user_frame()
        if _made_in(frame, coroutine.__name__):
            _blame(task, frame, coroutine.__name__)
            return
    if _Watch.warn is not None:
        _Watch.warn(coroutine)


def _made_in(frame: FrameType, name: str) -> bool:
    line = linecache.getline(frame.f_code.co_filename, frame.f_lineno, frame.f_globals)
    return f"{name}(" in line if line else name in frame.f_code.co_names


def _blame(task: Task, frame: FrameType, name: str) -> None:
    line = linecache.getline(frame.f_code.co_filename, frame.f_lineno, frame.f_globals).strip() or f"{name}(...)"
    where = f"{os.path.basename(frame.f_code.co_filename)}:{frame.f_lineno}"
    start = line.rfind(f"{name}(")
    while start > 0 and (line[start - 1].isalnum() or line[start - 1] in "_."):  # planlang.sleep(1) as a whole
        start -= 1
    task.overrun = PlanStructureError(
        contrast(
            f"{where} calls {name}() without await, so nothing was done",
            line,
            f"{line[:start]}await {line[start:]}",
        )
    )
    task.doomed = True
    task.generators = [*(task.generators or []), _Forgotten(task, task.overrun)]


def returned(task: Task, coroutine: CoroutineType[Any, Any, Any]) -> PlanStructureError:
    """The error of a branch that returned a coroutine instead of its result."""
    name = coroutine.__name__
    coroutine.close()
    return PlanStructureError(
        contrast(
            f"branch {task.path} returned a call of {name}() that was not awaited, so nothing was done",
            f"return {name}(...)",
            f"return await {name}(...)",
        )
    )


def explain(error: BaseException) -> None:
    """Add what to write instead to errors of other event loops."""
    if isinstance(error, RuntimeError) and str(error) == "no running event loop":
        error.add_note(contrast("asyncio does not work in a plan", "await asyncio.sleep(1)", "await sleep(1)"))


class _Forgotten:
    """Closed with the generators that a task left open, if it ends without another checkpoint."""

    def __init__(self, task: Task, error: BaseException) -> None:
        self.task = task
        self.error = error

    @property
    def ag_frame(self) -> object:
        """None once the error was raised."""
        return self if self.task.overrun is self.error else None

    async def aclose(self) -> None:
        """Raise the error."""
        self.task.overrun = None
        raise self.error
