"""Primitives for a task: time, random numbers, waiting, a node of its own in the tree, calls of functions."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any, NoReturn

from planlang.failures import PlanFailure
from planlang.kernel.cancel import checkpoint, deliver
from planlang.kernel.core import here, park, serving
from planlang.kernel.errors import Evaporated
from planlang.kernel.listing import locate
from planlang.kernel.observer import Body
from planlang.kernel.schedule import CountedRandom
from planlang.kernel.tree import EVAPORATED, FAILED, SUCCEEDED, Node, name_of
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
    timer = scheduler.alarm(task, steps, lambda: scheduler.wake(task))  # as pause(), without another coroutine
    try:
        await park(timer)
    finally:
        timer.drop()


async def pause(steps: int, reason: object = None) -> None:
    """Wait ``steps`` world steps, at least one; listings show the reason, or else the step."""
    scheduler, task = here()
    if task.doomed:
        await deliver(task)
    timer = scheduler.alarm(task, steps, lambda: scheduler.wake(task))
    try:
        await park(reason or timer)
    finally:
        timer.drop()


def now() -> float:
    """Return the plan time since the start of the run [s]."""
    scheduler = serving()
    return scheduler.now / scheduler.rate


def rng() -> Random:
    """Return the task's own stream of random numbers, derived from the run's seed and the task's path."""
    scheduler, task = here()
    if task.stream is None:
        task.stream = CountedRandom(f"{scheduler.seed} {task.path}")
    return task.stream


def record(event: str, **details: object) -> None:
    """Tell who observes the run of an event of the running task: as a rule, write it into the trace."""
    scheduler, task = here()
    if scheduler.observer is not None:
        scheduler.observer.write(scheduler.now, event, task.node, **details)


def charge(kind: str, part: str, number: int) -> None:
    """Tell who observes the run what is charged to the budgets around the running task; see ``Observer.charged``."""
    observer = here()[0].observer
    if observer is not None:
        observer.charged(kind, part, number)


async def node(kind: str, name: str, body: Body, /, **details: object) -> Any:
    """Run ``body`` as a node of the tree that is no task of its own; returns its result.

    ``details`` are recorded with its beginning. In a resumed run the body of a node that has completed before is not
    run: the node gives what it gave then.
    """
    return await in_node(Node(here()[1].node, kind, name), body, **details)


async def in_node(node: Node, body: Body, /, **details: object) -> Any:
    """Run ``body`` in a node that exists already; see :func:`node`."""
    scheduler, task = here()
    observer, recorded = scheduler.observer, scheduler.recorded
    given = body if recorded is None else recorded.body(node, body)
    outer, task.node = task.node, node
    try:
        if observer is not None:
            observer.started(scheduler.now, node, **details)
        if scheduler.on_start is not None and given is body:  # what a resumed run takes over does not begin again
            scheduler.on_start(node)
        result = await given()
    except GeneratorExit:  # the coroutine is closed: nothing has happened in the run
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
    """Call an async function, to be awaited at once; WrongType if it is not async or takes other arguments."""
    try:
        result = function(*arguments, **named)
    except TypeError as error:
        refuse_arguments(function, error)
        raise
    if not hasattr(result, "__await__"):
        refuse_result(name_of(function), result)
    return result


def refuse_arguments(function: Callable[..., Any], error: TypeError) -> None:
    """Raise the error of a function that cannot be called like this; nothing if the error arose inside of it."""
    traceback = error.__traceback__
    if traceback is not None and traceback.tb_next is None and not isinstance(error, PlanStructureError):
        name = name_of(function)
        raise WrongType(
            contrast(f"{name} cannot be called as it was given: {error}", name, f"partial({name}, ...)")
        ) from None


def refuse_result(name: str, result: object) -> NoReturn:
    """Raise the error of a function whose result cannot be awaited."""
    element = name.rpartition("/")[2]
    shown = element if element.isidentifier() else "reach"
    raise WrongType(
        contrast(
            f"branch {name} returned {type(result).__name__}, which cannot be awaited; a branch is a function written "
            "with async def",
            f"def {shown}(): ...",
            f"async def {shown}(): ...",
        )
    )
