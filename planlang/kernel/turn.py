"""One turn of a task: from where it waits to its next wait, or to its end."""

from __future__ import annotations

import ctypes
from collections.abc import Awaitable
from contextvars import copy_context
from types import CoroutineType
from typing import TYPE_CHECKING, Any

from planlang.failures import PlanFailure
from planlang.kernel.calling import refuse_arguments, refuse_result
from planlang.kernel.closing import close_first, unfinished
from planlang.kernel.errors import Evaporated, PlanStructureError, StuckTask
from planlang.kernel.listing import explain_recursion, locate, place_of
from planlang.kernel.park import MAX_DELIVERIES, PARKED, STUCK
from planlang.kernel.task import EVAPORATED, FAILED, SUCCEEDED, Status, Task
from planlang.kernel.watchdog import Overdue
from planlang.misuse import contrast

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler


def _call(task: Task) -> object:
    """Call the branch, in its task, and run to the first wait."""
    try:
        coroutine = task.branch()
    except TypeError as error:
        refuse_arguments(task.branch, error)
        raise
    if coroutine.__class__ is not CoroutineType and not hasattr(coroutine, "send"):
        if not hasattr(coroutine, "__await__"):
            refuse_result(task.path, coroutine)
        coroutine = _awaiting(coroutine)
    task.coroutine = coroutine
    return coroutine.send(None)


async def _awaiting(awaitable: Awaitable[Any]) -> Any:
    return await awaitable


def take(scheduler: Scheduler, task: Task) -> None:
    """Run the task from where it waits to its next wait, or to its end."""
    task.woken = False
    scheduler.current = task
    try:
        coroutine = task.coroutine
        if coroutine is None:
            task.begun = True
            if task.watched is not None:
                task.watched.set(Status.RUNNING)
            if scheduler.trace is not None:
                scheduler.trace.started(scheduler.timers.now, task)
            if scheduler.on_start is not None:
                scheduler.on_start(task)
            group = task.group
            context = task.context = copy_context() if group is None else group.owner.context.copy()
            signal = context.run(_call, task)
        elif task.error is None:
            value, task.value = task.value, None
            signal = task.context.run(coroutine.send, value)
        else:
            error, task.error = task.error, None
            if error.__class__ is Evaporated:
                task.thrown = True
                task.deliveries += 1
            signal = task.context.run(coroutine.throw, error)
    except StopIteration as stop:
        if task.thrown or task.generators or stop.value.__class__ is CoroutineType:
            _returned(scheduler, task, stop.value)
        else:
            task.result = stop.value
            del task.context
            scheduler.finish(task, SUCCEEDED)
    except BaseException as raised:
        _raised(scheduler, task, raised)
    else:
        if signal is not PARKED:
            _unexpected(scheduler, task, signal)
    finally:
        scheduler.current = None


def _returned(scheduler: Scheduler, task: Task, value: Any) -> None:
    if task.generators and (left := unfinished(task.generators)):
        close_first(scheduler, task, left, value, None)
    elif task.thrown:
        scheduler.finish(task, EVAPORATED)
    elif value.__class__ is CoroutineType:
        _raised(scheduler, task, _returned_coroutine(task, value))
    else:
        task.result = value
        scheduler.finish(task, SUCCEEDED)


def _returned_coroutine(task: Task, coroutine: CoroutineType[Any, Any, Any]) -> PlanStructureError:
    """The error of a branch that returned a coroutine instead of its result."""
    name = coroutine.__name__
    coroutine.close()
    message = f"branch {task.path} returned a call of {name}() that was not awaited, so nothing was done"
    return PlanStructureError(contrast(message, f"return {name}(...)", f"return await {name}(...)"))


def _raised(scheduler: Scheduler, task: Task, error: BaseException) -> None:
    if task.generators and (left := unfinished(task.generators)):
        close_first(scheduler, task, left, None, error)
        return
    if isinstance(error, Evaporated) and task.thrown:
        pass
    elif isinstance(error, PlanFailure):
        if error.where is None:
            locate(error, task.node, scheduler.revision)
        if task.thrown:
            task.cleanup_failure = error
        else:
            task.failure = error
    elif isinstance(error, Overdue):
        scheduler.fatal = error
        scheduler.overdue = task
    elif isinstance(error, Evaporated):
        task.crash = PlanStructureError(f"{task.path} raised Evaporated itself; evaporate its handle instead")
    else:
        task.crash = error
        if isinstance(error, RecursionError):
            explain_recursion(error, task.path)
        if not isinstance(error, Exception):
            scheduler.fatal = error
        if isinstance(error, RuntimeError) and str(error) == "no running event loop":
            error.add_note(contrast("asyncio does not work in a plan", "await asyncio.sleep(1)", "await sleep(1)"))
    scheduler.finish(task, EVAPORATED if task.thrown else FAILED)


def _unexpected(scheduler: Scheduler, task: Task, signal: object) -> None:
    if signal is STUCK:
        _never_close(task.coroutine)
        task.crash = StuckTask(
            contrast(
                f"{task.path} does not end although it was evaporated {MAX_DELIVERIES} times{place_of(task)}; "
                "evaporation is a BaseException, which a plan has to let through",
                "except BaseException:    or a bare except:",
                "except PlanFailure:      or except Exception:",
            )
        )
        task.generators = None
        scheduler.fatal = scheduler.fatal or task.crash
        scheduler.finish(task, EVAPORATED)
        return
    scheduler.throw(
        task,
        TypeError(
            contrast(
                f"{task.path} awaits {type(signal).__module__}.{type(signal).__qualname__}{place_of(task)}, which "
                "belongs to another event loop; plans await planlang's own sleep, wait_for and constructs",
                "await asyncio.sleep(1)",
                "await sleep(1)    after: from planlang import sleep",
            )
        ),
    )


def _never_close(coroutine: object) -> None:
    """Keep a coroutine that refuses to end from being closed, which it would refuse too, even by the interpreter."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(coroutine))
