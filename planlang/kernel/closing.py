"""Closing what a task left open: async generators that it iterated and did not exhaust."""

from __future__ import annotations

from collections.abc import AsyncGenerator
from typing import TYPE_CHECKING, Any

from planlang.failures import PlanFailure
from planlang.kernel.errors import Evaporated

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.task import Task


async def _close(
    task: Task, generators: list[AsyncGenerator[Any, Any]], value: Any, error: BaseException | None
) -> Any:
    """Close them in order of first iteration, then end as the task would have ended."""
    try:
        for generator in generators:
            try:
                await generator.aclose()
            except (Evaporated, PlanFailure) as raised:
                error = error or raised
            except Exception as raised:
                if error is None or isinstance(error, (Evaporated, PlanFailure)):
                    error = raised
    finally:
        task.shields -= 1
    if error is not None:
        raise error
    return value


def unfinished(generators: list[AsyncGenerator[Any, Any]]) -> list[AsyncGenerator[Any, Any]]:
    """Those that still have something to run."""
    return [generator for generator in generators if getattr(generator, "ag_frame", None) is not None]


def keep(generator: AsyncGenerator[Any, Any]) -> None:
    """Generators are closed by the task that iterated them; nothing is left to the collector."""


def adopt(scheduler: Scheduler, generator: AsyncGenerator[Any, Any]) -> None:
    """The running task iterates a generator for the first time."""
    task = scheduler.current
    if task is not None:
        task.generators = [*unfinished(task.generators or []), generator]


def close_first(
    scheduler: Scheduler,
    task: Task,
    generators: list[AsyncGenerator[Any, Any]],
    value: Any,
    error: BaseException | None,
) -> None:
    """Close the async generators that the task left open, shielded, before it counts as dead."""
    task.generators = None
    task.node = task
    task.coroutine = _close(task, generators, value, error)
    task.shields += 1
    if not scheduler.draining:
        task.doomed = False
    scheduler.wake(task)
