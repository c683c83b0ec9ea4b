"""What a task can ask for: time, random numbers, and to wait."""

from __future__ import annotations

from random import Random
from types import TracebackType
from typing import Any

from planlang.failures import PlanFailure
from planlang.kernel.errors import Evaporated
from planlang.kernel.listing import locate
from planlang.kernel.park import checkpoint, deliver, here, park, serving
from planlang.kernel.task import Status
from planlang.kernel.tree import Node


async def sleep(seconds: float) -> None:
    """Wait ``ceil(seconds * rate)`` world steps; 0 is a checkpoint. ValueError if negative, infinite or NaN."""
    scheduler, task = here()
    steps = scheduler.steps(seconds)
    if steps == 0:
        await checkpoint()
        return
    if task.doomed:
        await deliver(task)
    timer = scheduler.alarm(task, steps, lambda: scheduler.wake(task))
    try:
        await park(timer)
    finally:
        timer.drop()


def now() -> float:
    """Plan time since the start of the run [s]."""
    scheduler = serving()
    return scheduler.now / scheduler.rate


def rng() -> Random:
    """The task's own stream of random numbers, derived from the run's seed and the task's path."""
    scheduler, task = here()
    if task.stream is None:
        task.stream = Random(f"{scheduler.seed} {task.path}")
    return task.stream


def record(event: str, **details: object) -> None:
    """Write an event of the running task into the trace."""
    scheduler, task = here()
    if scheduler.trace is not None:
        scheduler.trace.write(scheduler.now, event, task.node, **details)


class inside:  # noqa: N801 - used like a function: with inside("plan", name)
    """``with inside(kind, name, **details) as node``: a node of the tree that is no task of its own."""

    __slots__ = ("_details", "_kind", "_name", "_node", "_outer", "result")

    def __init__(self, kind: str, name: str, **details: object) -> None:
        self._kind = kind
        self._name = name
        self._details = details
        self.result: Any = None

    @property
    def name(self) -> str:
        """The path element."""
        return self._node.name

    def __enter__(self) -> inside:
        scheduler, task = here()
        self._outer = task.node
        self._node = task.node = Node(task.node, self._kind, self._name)
        if scheduler.trace is not None:
            scheduler.trace.started(scheduler.now, self._node, **self._details)
        if scheduler.on_start is not None:
            try:
                scheduler.on_start(self._node)
            except BaseException as error:
                self.__exit__(type(error), error, None)
                raise
        if scheduler.journal is not None:
            scheduler.journal.enter(self._node)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        if isinstance(error, GeneratorExit):
            return
        scheduler, task = here()
        task.node = self._outer
        if isinstance(error, PlanFailure) and error.where is None:
            locate(error, self._node, scheduler.revision)
        if scheduler.journal is not None:
            scheduler.journal.leave(self._node, self.result, error)
        if scheduler.trace is not None:
            if error is None:
                scheduler.trace.ended(scheduler.now, self._node, Status.SUCCEEDED, self.result)
            elif isinstance(error, Evaporated):
                scheduler.trace.ended(scheduler.now, self._node, Status.EVAPORATED)
            else:
                scheduler.trace.ended(scheduler.now, self._node, Status.FAILED, None, error)
