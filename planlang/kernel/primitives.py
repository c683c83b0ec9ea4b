"""Primitives of a task: time, random numbers, waiting, nodes of the tree, calls of functions."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any, NoReturn

from planlang.failures import PlanFailure
from planlang.kernel.cancel import checkpoint, deliver
from planlang.kernel.core import here, park, serving
from planlang.kernel.errors import Evaporated
from planlang.kernel.schedule import CountedRandom
from planlang.kernel.tracebacks import locate
from planlang.kernel.tree import EVAPORATED, FAILED, SUCCEEDED, Body, Node, name_of
from planlang.misuse import PlanStructureError, WrongType, contrast


async def sleep(seconds: float) -> None:
    """Wait ``ceil(seconds * rate)`` world steps; 0 is a checkpoint. ValueError if negative, infinite or NaN."""
    scheduler, task = here()
    steps = scheduler.steps(seconds)
    if steps == 0:
        await checkpoint()
        return
    if task.doomed:
        await deliver(task)
    timer = scheduler.alarm(task, steps, lambda: scheduler.wake(task))  # pause() written out, to save a coroutine
    try:
        await park(timer)
    finally:
        timer.drop()


async def pause(steps: int, reason: object = None) -> None:
    """Wait ``steps`` world steps, at least one; listings of tasks show ``reason``, by default the step."""
    scheduler, task = here()
    if task.doomed:
        await deliver(task)
    timer = scheduler.alarm(task, steps, lambda: scheduler.wake(task))
    try:
        await park(reason or timer)
    finally:
        timer.drop()


def now() -> float:
    """Plan time since the start of the run [s]."""
    scheduler = serving()
    return scheduler.now / scheduler.rate


def rng() -> Random:
    """Random stream of the running task, derived from the seed of the run and the path of the task."""
    scheduler, task = here()
    if task.stream is None:
        task.stream = CountedRandom(f"{scheduler.seed} {task.path}")
    return task.stream


def record(event: str, **details: object) -> None:
    """Write an event of the running task into the trace."""
    scheduler, task = here()
    if scheduler.observer is not None:
        scheduler.observer.write(scheduler.now, event, task.node, **details)


def charge(kind: str, part: str, number: int) -> None:
    """Record a charge to the budgets around the running task; see ``Observer.charged``."""
    observer = here()[0].observer
    if observer is not None:
        observer.charged(kind, part, number)


async def node(kind: str, name: str, body: Body, /, **details: object) -> Any:
    """Run ``body`` in the present task under a node of its own in the tree; return its result.

    ``details`` are recorded with its start. In a resumed run a node that was completed before is not run again: the
    recorded result is returned.
    """
    return await in_node(Node(here()[1].node, kind, name), body, **details)


async def in_node(node: Node, body: Body, /, **details: object) -> Any:
    """Run ``body`` in an existing node; see :func:`node`."""
    scheduler, task = here()
    observer, recorded = scheduler.observer, scheduler.recorded
    effective_body = body if recorded is None else recorded.body(node, body)
    outer, task.node = task.node, node
    try:
        if observer is not None:
            observer.started(scheduler.now, node, **details)
        if scheduler.on_start is not None and effective_body is body:  # a result that is repeated is not a start
            scheduler.on_start(node)
        result = await effective_body()
    except GeneratorExit:  # the coroutine is closed from outside, which is not an event of the run
        raise
    except BaseException as error:
        task.node = outer
        if isinstance(error, PlanFailure) and error.where is None:
            locate(error, node, scheduler.revision)
        if observer is not None and isinstance(error, Evaporated):
            observer.ended(scheduler.now, node, EVAPORATED)
        elif observer is not None:
            observer.ended(scheduler.now, node, FAILED, None, error)
        raise
    task.node = outer
    if observer is not None:
        observer.ended(scheduler.now, node, SUCCEEDED, result)
    return result


def called(function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Call an async function and return its coroutine; WrongType if it is not async or the arguments do not fit."""
    try:
        result = function(*arguments, **named)
    except TypeError as error:
        refuse_arguments(function, error)
        raise
    if not hasattr(result, "__await__"):
        refuse_result(name_of(function), result)
    return result


def refuse_arguments(function: Callable[..., Any], error: TypeError) -> None:
    """Raise WrongType if the TypeError arose in the call itself, not inside the function."""
    traceback = error.__traceback__
    if traceback is not None and traceback.tb_next is None and not isinstance(error, PlanStructureError):
        name = name_of(function)
        raise WrongType(
            contrast(f"{name} cannot be called with these arguments: {error}", name, f"partial({name}, ...)")
        ) from None


def refuse_result(name: str, result: object) -> NoReturn:
    """Raise WrongType for a function whose result cannot be awaited."""
    element = name.rpartition("/")[2]
    shown = element if element.isidentifier() else "reach"
    raise WrongType(
        contrast(
            f"branch {name} returned {type(result).__name__}, which cannot be awaited; write a branch with async def",
            f"def {shown}(): ...",
            f"async def {shown}(): ...",
        )
    )
