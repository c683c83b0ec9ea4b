"""Closing what a task left open: async generators that it iterated and did not exhaust."""

from __future__ import annotations

from collections.abc import AsyncGenerator
from typing import TYPE_CHECKING, Any

from planlang.failures import PlanFailure
from planlang.kernel.errors import Evaporated

if TYPE_CHECKING:
    from planlang.kernel.task import Task


async def close_generators(
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
