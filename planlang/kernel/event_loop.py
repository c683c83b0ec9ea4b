"""The event loop: runs tasks, then the decisions of constructs, and advances time when nothing is left to run."""

from __future__ import annotations

import ctypes
import heapq
from collections import deque
from collections.abc import AsyncGenerator, Awaitable
from contextvars import copy_context
from inspect import CO_COROUTINE
from sys import set_coroutine_origin_tracking_depth as set_origins
from types import CoroutineType, FunctionType
from typing import Any

from planlang.failures import PlanFailure
from planlang.kernel.cancel import MAX_DELIVERIES, STUCK, heed_interrupts
from planlang.kernel.core import PARKED, BaseScope, Scheduler, Task
from planlang.kernel.errors import (
    DeadlockError,
    Evaporated,
    NoProgress,
    Overdue,
    PlanStructureError,
    StepLimit,
    StuckTask,
)
from planlang.kernel.fluent import FluentWait
from planlang.kernel.primitives import refuse_arguments, refuse_result
from planlang.kernel.threads import ADVICE, Calls, missing_loop_error
from planlang.kernel.tracebacks import blocked, explain_recursion, listing, locate, place_of
from planlang.kernel.tree import EVAPORATED, FAILED, SUCCEEDED, Status
from planlang.misuse import WrongType, contrast

MAX_RESUMPTIONS = 100_000
"""Resumptions and decisions in one world step that count as an endless loop: more than 10,000 tasks need that end in
one step, and reached in less than a second."""
ORIGINS = 2
"""Stack frames that a coroutine keeps of its creation: a call of a ``@plan`` function adds one of planlang's own."""
THREADS_HINT = 'if another thread sets it, use a RealTimeHost, and in the thread: with host.source("door"): ...'


def loop(scheduler: Scheduler, root: Task) -> None:
    """Drive the run until its top-level task is dead."""
    while True:
        rest(scheduler, root)
        if scheduler.spoilt is not None:
            raise scheduler.spoilt
        if root.dead:
            return
        if scheduler.interrupts != scheduler.heeded:
            heed_interrupts(scheduler, root)
        else:
            _advance(scheduler, root)


def rest(scheduler: Scheduler, root: Task) -> None:
    """Run rounds, decisions and deadlines until nothing more can happen in this step."""
    queue, dirty = scheduler.queue, scheduler.dirty
    # Tasks first, then decisions: a construct sees the ends of all its branches that died in the round, not the first
    # of them. If race decided at once, its winner would be whoever stood first in the queue, and an order of tasks that
    # no plan states would decide about the plan.
    #
    #     round: a ends, b ends -> decisions, innermost first -> round of those woken -> ... -> deadlines -> next step
    while True:
        if queue:
            _round(scheduler, root)
        if dirty:
            _decide(dirty)
        # This order is part of the language: a deadline fires only after tasks, decisions and calls in threads, so that
        # a body that ends in the same step as its deadline is in time. Deadlines do not fire during a drain.
        elif scheduler.awaits_threads and scheduler.service(Calls).collect(scheduler):
            heed_interrupts(scheduler, root)
        elif scheduler.draining or not scheduler.timers.expire():
            return


def _round(scheduler: Scheduler, root: Task) -> None:
    """Run tasks until none can run; tasks woken meanwhile belong to the same round."""
    queue, choice = scheduler.queue, scheduler.choice
    while queue:
        if scheduler.interrupts != scheduler.heeded:
            heed_interrupts(scheduler, root)
        if scheduler.resumptions > MAX_RESUMPTIONS and not scheduler.draining:
            title = (
                f"no progress: tasks were resumed more than {MAX_RESUMPTIONS} times in world step {scheduler.now}; put "
                "a wait into the loop, such as sleep(0.1) or wait_for a fluent that is still false; still running"
            )
            raise NoProgress(listing(title, queue))
        if isinstance(queue, deque):
            task = queue.popleft()
        else:
            task = queue.pop(choice.choose(queue) if choice is not None and len(queue) > 1 else 0)
        task.in_queue = False
        if task.holds or task.dead:  # suspended, or evaporated before it began, after it was queued
            continue
        scheduler.resumptions += task.begun  # starts are not counted, as a wide construct is not a loop
        step_task(scheduler, task)
        if scheduler.fatal is not None:
            fatal, scheduler.fatal = scheduler.fatal, None
            raise fatal


def _decide(dirty: list[tuple[int, int, BaseScope]]) -> None:
    """Let the most deeply nested scopes with newly dead branches decide, in order of creation.

    Only one depth at a time: the tasks that a decision wakes run first, and may end a branch of a less deeply nested
    scope in the same step. That scope then sees both ends at once.
    """
    depth = dirty[0][0]
    while dirty and dirty[0][0] == depth:
        scope = heapq.heappop(dirty)[2]
        scope.dirty = False
        scope.scheduler.resumptions += 1
        scope.settle()


def _advance(scheduler: Scheduler, root: Task) -> None:
    """Advance the world by one step, or jump to the next step in which a timer is due."""
    timers = scheduler.timers
    repeats = scheduler.recorded is not None and scheduler.recorded.step_ends(timers.now)
    if not repeats and scheduler.live is not None and _attend(scheduler):
        return  # the calls may have woken a task in this step
    target = _target(scheduler, root, repeats)
    if not repeats:
        scheduler.idle = True
        try:
            passed = scheduler.host.advance(target - timers.now)
        except Exception as error:
            error.add_note(f"raised by {type(scheduler.host).__name__} after {timers.now} world steps")
            raise
        scheduler.idle = False
        if passed == 0:  # a live host came back early: an item has arrived in this step
            return
        if passed is not None:
            target = timers.now + passed
    timers.now = target
    scheduler.resumptions = 0
    if scheduler.world_waits:
        fluents = tuple(scheduler.world_waits)
        changed = [fluent for fluent in fluents if fluent.sample(target)]  # all are sampled before any wait is checked
        for fluent in changed:
            fluent.notify()
    timers.ring()


def _target(scheduler: Scheduler, root: Task, repeats: bool) -> int:
    """Choose the step to advance to; DeadlockError if nothing can ever happen, StepLimit beyond the limit."""
    timers, live = scheduler.timers, scheduler.live
    due = timers.next_due()
    may_be_woken_from_outside = live is not None and (live.sources or scheduler.awaits_threads)
    if due is None and not scheduler.vital_waits and not may_be_woken_from_outside:
        raise DeadlockError(_deadlock(root))
    following = timers.now + 1
    if repeats and due is not None:
        target = max(due, following)  # nothing is sampled while a resumed run repeats the recorded one
    elif live is not None:
        # World fluents are sampled in each step. Without any, the host comes back when an item arrives, and once a
        # second to check whether all sources are closed.
        target = timers.now + (1 if scheduler.world_waits else scheduler.rate)
        if due is not None:
            target = max(min(due, target), following)
        if scheduler.max_steps is not None and target > scheduler.max_steps > timers.now:
            target = scheduler.max_steps
    elif due is None or not scheduler.host.jumps or scheduler.vital_waits:
        target = following
    elif scheduler.world_waits and scheduler.resumptions:
        target = following  # without a world only tasks change what is read: one sample after they ran is enough
    else:
        target = max(due, following)
    if scheduler.max_steps is not None and target > scheduler.max_steps:
        plan_time = f"{scheduler.max_steps / scheduler.rate:g} s of plan time"
        title = f"the plan ran for more than {scheduler.max_steps} world steps ({plan_time}); still waiting"
        raise StepLimit(listing(title, blocked(root)))
    return target


def _deadlock(root: Task) -> str:
    message = listing("deadlock: no task can run", blocked(root))
    if any(isinstance(task.wait, FluentWait) for task in blocked(root)):
        message += f"\n{THREADS_HINT}"
    return message


def _attend(scheduler: Scheduler) -> bool:
    """Make the calls in the inbox; False if there were none."""
    items = scheduler.inbox.take()
    for item in items:
        item()
    return bool(items)


# -- one step of a task, from its wait to the next wait or to its end


def _call(task: Task) -> object:
    """Call the branch in its task and run it to its first wait."""
    branch = task.branch
    try:
        # A coroutine created here is awaited below, so its origin need not be recorded, which saves 0.4 us for each of
        # 10,000 branches. Other callables may create further coroutines and forget them.
        if branch.__class__ is FunctionType and branch.__code__.co_flags & CO_COROUTINE:
            set_origins(0)
            try:
                coroutine = branch()
            finally:
                set_origins(ORIGINS)
        else:
            coroutine = branch()
    except TypeError as error:
        refuse_arguments(branch, error)
        raise
    if coroutine.__class__ is not CoroutineType and not hasattr(coroutine, "send"):
        if not hasattr(coroutine, "__await__"):
            refuse_result(task.path, coroutine)
        coroutine = _awaiting(coroutine)
    task.coroutine = coroutine
    return coroutine.send(None)


async def _awaiting(awaitable: Awaitable[Any]) -> Any:
    return await awaitable


def step_task(scheduler: Scheduler, task: Task) -> None:
    """Run the task from its wait to the next wait, or to its end."""
    task.woken = False
    scheduler.current = task
    try:
        coroutine = task.coroutine
        if coroutine is None:
            task.begun = True
            if task.watched is not None:
                task.show(Status.RUNNING)
            if scheduler.observer is not None:
                scheduler.observer.started(scheduler.timers.now, task)
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
            if error.__class__ is Evaporated:  # raised in a wait; at a checkpoint deliver() raises and counts it
                task.thrown = True
                task.deliveries += 1
            signal = task.context.run(coroutine.throw, error)
    except StopIteration as stop:
        # The usual end of a branch is written out, which saves a call of _returned() for each of 10,000 branches.
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
    if task.generators and (left := _unfinished(task.generators)):
        _close_first(scheduler, task, left, value, None)
    elif task.thrown:
        scheduler.finish(task, EVAPORATED)
    elif value.__class__ is CoroutineType:
        _raised(scheduler, task, _returned_coroutine(task, value))
    else:
        task.result = value
        scheduler.finish(task, SUCCEEDED)


def _returned_coroutine(task: Task, coroutine: CoroutineType[Any, Any, Any]) -> PlanStructureError:
    """Error for a branch that returned a coroutine instead of its result."""
    name = coroutine.__name__
    coroutine.close()
    message = f"branch {task.path} returned {name}() without await, so nothing was done"
    return PlanStructureError(contrast(message, f"return {name}(...)", f"return await {name}(...)"))


def _raised(scheduler: Scheduler, task: Task, error: BaseException) -> None:
    if task.generators and (left := _unfinished(task.generators)):
        _close_first(scheduler, task, left, None, error)
        return
    if isinstance(error, Evaporated) and task.thrown:
        pass  # evaporation as intended: the branch has not failed
    elif isinstance(error, PlanFailure):
        if error.where is None:
            locate(error, task.node, scheduler.revision)
        if task.thrown:  # a failed cleanup, which must not get lost
            task.cleanup_failures = [*(task.cleanup_failures or ()), error]
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
        elif not isinstance(error, Exception):  # such as SystemExit: no construct may delay it
            scheduler.fatal = error
        elif isinstance(error, (RuntimeError, AttributeError)):
            task.crash = missing_loop_error(error) or error
    scheduler.finish(task, EVAPORATED if task.thrown else FAILED)


def _unexpected(scheduler: Scheduler, task: Task, signal: object) -> None:
    if signal is STUCK:
        # Leaked, as closing a coroutine that does not end would not end either, not even at the interpreter's exit.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(task.coroutine))
        task.crash = StuckTask(
            contrast(
                f"{task.path} does not end although Evaporated was raised in it {MAX_DELIVERIES} times{place_of(task)}"
                "; Evaporated is a BaseException that a plan must not catch",
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
        WrongType(
            contrast(
                f"{task.path} awaits {type(signal).__module__}.{type(signal).__qualname__}{place_of(task)}, which "
                "belongs to another event loop; a plan can await only planlang's own sleep, wait_for and constructs",
                *ADVICE,
            )
        ),
    )


# -- closing async generators that a task iterated and did not exhaust


async def _close(
    task: Task, generators: list[AsyncGenerator[Any, Any]], value: Any, error: BaseException | None
) -> Any:
    """Close generators in order of first iteration, then return or raise what the task would have."""
    try:
        for generator in generators:
            try:
                await generator.aclose()
            except (Evaporated, PlanFailure) as raised:
                error = error or raised
            except Exception as raised:
                if error is None or isinstance(error, (Evaporated, PlanFailure)):  # programming errors take precedence
                    error = raised
    finally:
        task.shields -= 1
    if error is not None:
        raise error
    return value


def _unfinished(generators: list[AsyncGenerator[Any, Any]]) -> list[AsyncGenerator[Any, Any]]:
    """Select the generators that have not finished."""
    return [generator for generator in generators if getattr(generator, "ag_frame", None) is not None]


def keep(generator: AsyncGenerator[Any, Any]) -> None:
    """Do nothing when a generator is garbage-collected, as the task that iterates it closes it."""


def adopt(scheduler: Scheduler, generator: AsyncGenerator[Any, Any]) -> None:
    """Register a generator with the running task at its first iteration."""
    task = scheduler.current
    if task is not None:
        task.generators = [*_unfinished(task.generators or []), generator]


def _close_first(
    scheduler: Scheduler,
    task: Task,
    generators: list[AsyncGenerator[Any, Any]],
    value: Any,
    error: BaseException | None,
) -> None:
    """Close the async generators that the task left open, in a shield, before it counts as dead."""
    task.generators = None
    task.node = task  # leave any inner node, as the generators belong to the task
    task.coroutine = _close(task, generators, value, error)
    task.shields += 1
    if not scheduler.draining:
        task.doomed = False
    scheduler.wake(task)
