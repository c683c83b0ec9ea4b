"""How a task talks to the scheduler: who runs, parking, delivery of evaporation."""

from __future__ import annotations

import threading
import types
from collections.abc import Generator
from typing import TYPE_CHECKING, Any

from planlang.kernel.errors import Evaporated, PlanStructureError
from planlang.misuse import contrast

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.task import Task

PARKED = object()
"""Yielded by a task that waits. Anything else that reaches the scheduler is a foreign awaitable's."""
STUCK = object()
"""Yielded by a task that swallowed its evaporation too often; it is never resumed."""
MAX_DELIVERIES = 100


class _Running(threading.local):
    scheduler: Scheduler | None = None


running = _Running()


def here() -> tuple[Scheduler, Task]:
    """The scheduler of this thread and the task that runs."""
    scheduler = running.scheduler
    if scheduler is None or scheduler.current is None:
        raise PlanStructureError(
            contrast(
                "no plan is running here; what plans are made of works inside of planlang.run() only, in its thread",
                "asyncio.run(serve())    or a thread of your own",
                "run(serve, host=VirtualHost())",
            )
        )
    return scheduler, scheduler.current


def serving() -> Scheduler:
    """The scheduler of this thread, also where no task runs: in what a thread handed into the inbox."""
    return running.scheduler or here()[0]


@types.coroutine
def park(wait: object) -> Generator[object, Any, Any]:
    """Wait until the scheduler resumes this task; returns or raises what it was woken with."""
    task = here()[1]
    task.wait = wait
    value = yield PARKED
    task.wait = None
    return value


@types.coroutine
def deliver(task: Task) -> Generator[object, Any, None]:
    """Raise what is due at a checkpoint of a doomed task."""
    scheduler = here()[0]
    if task.overrun is not None:
        raise scheduler.delivery(task)
    task.deliveries += 1
    if task.deliveries > MAX_DELIVERIES:
        yield STUCK
    scheduler.note_delivery(task)
    raise Evaporated


async def checkpoint() -> None:
    """Let the other tasks of this step run; a delivery point for evaporation and suspension."""
    scheduler, task = here()
    if task.doomed:
        await deliver(task)
    scheduler.wake(task)
    await park("its turn")
    if task.doomed:
        await deliver(task)
