"""Moments that are rare: in a drain, while held, when two things come at once."""

from __future__ import annotations

import gc
from collections.abc import AsyncIterator, Awaitable, Callable, Generator
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import (
    Fluent,
    PlanStructureError,
    Recovery,
    Status,
    Trace,
    budget,
    checkpoint,
    now,
    on_suspension,
    par,
    par_each,
    seq,
    shield,
    sleep,
    suspend,
    tag,
    task,
    task_suspended,
    unwind_protect,
    wait_for,
    wake_up,
    with_failure_handling,
)
from planlang import evaporate as evaporate_task
from planlang.failures import BranchEvaporated, BudgetExceeded, GraspMissed, PlanFailure
from planlang.kernel import DeadlockError
from planlang.kernel.core import here
from planlang.kernel.runner import interrupter
from planlang.kernel.schedule import ListedSchedule
from planlang.testing import Fault, run_plan

Branch = Callable[[], Awaitable[Any]]


# the process


def test_a_collector_threshold_that_is_higher_already_is_left_as_it_is() -> None:
    before = gc.get_threshold()

    async def top() -> int:
        return gc.get_threshold()[0]

    try:
        gc.set_threshold(900_000)
        assert go(top) == 900_000
    finally:
        gc.set_threshold(*before)


def test_plan_time_outside_of_a_plan_is_refused() -> None:
    with pytest.raises(PlanStructureError, match="no plan is running in this thread"):
        now()


def test_a_state_of_a_schedule_that_is_no_number_of_choices_is_refused() -> None:
    with pytest.raises(ValueError, match="number of choices"):
        ListedSchedule([0]).restore("two")


def test_a_branch_may_return_any_awaitable() -> None:
    class Ready:
        def __await__(self) -> Generator[Any, Any, int]:
            yield from sleep(1).__await__()
            return 7

    assert go(Ready) == 7


def test_a_construct_that_a_plan_has_driven_by_hand_can_be_closed_after_the_run() -> None:
    kept: list[Any] = []

    async def top() -> str:
        kept.append(with_failure_handling(partial(sleep, 1)))
        kept[0].send(None)
        return "done"

    trace = Trace()
    assert go(top, trace=trace) == "done"
    told = len(trace.events)
    kept[0].close()
    assert len(trace.events) == told


# deadlock


def test_a_deadlock_lists_twenty_tasks_and_says_how_many_more_there_are() -> None:
    never = Fluent(False, "never")

    async def top() -> None:
        await par_each(range(25), lambda number: wait_for(never))

    with pytest.raises(DeadlockError) as caught:
        go(top)
    assert str(caught.value).count("waits for never") == 20
    assert "and 5 more" in str(caught.value)


def test_a_task_that_lost_its_turn_gets_it_in_the_drain() -> None:
    ended: list[str] = []

    async def loser() -> None:
        try:
            await checkpoint()
        finally:
            ended.append("loser")

    async def thief() -> None:
        queue = here()[0].queue
        lost = queue.popleft()  # as when the watchdog interrupts a round between two tasks
        lost.in_queue = False
        await wait_for(Fluent(False))

    with pytest.raises(DeadlockError):
        go(partial(par, loser, thief))
    assert ended == ["loser"]


def test_an_async_generator_left_open_is_closed_in_the_drain() -> None:
    closed: list[str] = []

    async def numbers() -> AsyncIterator[int]:
        try:
            yield 1
        finally:
            closed.append("closed")

    async def top() -> None:
        opened = numbers()
        async for _ in opened:
            await wait_for(Fluent(False))

    with pytest.raises(DeadlockError):
        go(top)
    assert closed == ["closed"]


# async generators


async def failing_at_its_end(error: Exception) -> AsyncIterator[int]:
    try:
        yield 1
    finally:
        raise error


async def left_open(*errors: Exception) -> None:
    for error in errors:
        await anext(failing_at_its_end(error))


def test_a_plan_failure_of_an_async_generator_that_is_closed_is_that_of_the_task() -> None:
    with pytest.raises(GraspMissed):
        go(partial(left_open, GraspMissed(what="cup")))


def test_of_two_programming_errors_in_async_generators_that_are_closed_the_first_counts() -> None:
    with pytest.raises(KeyError):
        go(partial(left_open, KeyError("first"), ValueError("second")))


def test_an_async_generator_that_no_task_iterates_is_nobodys() -> None:
    async def numbers() -> AsyncIterator[int]:
        yield 1

    kept = []

    def read() -> bool:
        kept.append(numbers())
        with pytest.raises(StopIteration):
            kept[-1].__anext__().send(None)
        return len(kept) > 2

    async def top() -> None:
        await wait_for(Fluent(read=read))

    go(top)
    assert len(kept) == 3


# held tasks


async def beside(subject: Branch, act: Callable[[Any], object], seconds: float = 0.0) -> None:
    """Run a tagged subject, and act on its handle after it has begun."""

    async def actor() -> None:
        await sleep(seconds)
        act(task("subject"))

    await par(partial(tag, "subject", subject), actor)


def test_suspending_and_waking_a_task_that_is_in_the_queue_changes_nothing() -> None:
    log: list[float] = []

    async def subject() -> None:
        for _ in range(3):
            await checkpoint()
        log.append(now())

    go(partial(beside, subject, lambda handle: (suspend(handle), wake_up(handle))))
    assert log == [0.0]


def test_a_task_that_is_suspended_when_its_time_has_come_goes_on_when_woken_up() -> None:
    log: list[float] = []

    async def subject() -> None:
        await sleep(1)
        log.append(now())

    async def actor() -> None:
        handle = task("subject")
        await sleep(1)
        assert suspend(handle)
        assert wake_up(handle)

    go(partial(par, actor, partial(tag, "subject", subject)), schedule=[0])
    assert log == [1.0]


def test_a_task_that_is_suspended_and_evaporated_in_its_turn_never_has_it() -> None:
    log: list[str] = []

    async def subject() -> None:
        for _ in range(3):
            await checkpoint()
        log.append("on")

    with pytest.raises(BranchEvaporated):
        go(partial(beside, subject, lambda handle: (suspend(handle), evaporate_task(handle))))
    assert log == []


def test_an_error_on_its_way_into_a_task_is_seen_although_the_task_is_suspended_and_evaporated() -> None:
    number = Fluent(1)

    async def subject() -> None:
        await wait_for(1 / number == 2)

    def act(handle: Any) -> None:
        number.set(0)
        suspend(handle)
        evaporate_task(handle)

    with pytest.raises(ZeroDivisionError):
        go(partial(beside, subject, act, 0.5))


def test_what_a_suspended_task_does_in_a_shield_goes_on_when_it_is_evaporated() -> None:
    log: list[float] = []

    async def cleaning() -> None:
        await sleep(1)
        log.append(now())

    async def subject() -> None:
        with shield():
            await par(cleaning, cleaning)

    async def top() -> None:
        async def actor() -> None:
            handle = task("subject")
            await sleep(0.5)
            suspend(handle)
            await sleep(1)
            evaporate_task(handle)

        await par(partial(tag, "subject", subject), actor)

    go(top)  # and it ends before evaporation is delivered, as it waits for nothing any more
    assert log == [2.0, 2.0]


def test_branches_of_an_evaporating_task_are_shown_as_evaporating() -> None:
    async def branch() -> None:
        await unwind_protect(partial(sleep, 10), partial(sleep, 1))

    async def subject() -> None:
        await par(branch, branch)

    shown: list[Status] = []

    async def actor() -> None:
        handle = task("subject")
        await sleep(0.5)
        evaporate_task(handle)
        await sleep(0.5)
        shown.extend(child.status.value for child in handle.children)

    with pytest.raises(BranchEvaporated):
        go(partial(par, partial(tag, "subject", partial(unwind_protect, subject, partial(sleep, 2))), shielded(actor)))
    assert shown == [Status.EVAPORATING, Status.EVAPORATING]


def shielded(body: Branch) -> Branch:
    async def beside_it() -> None:
        with shield():
            await body()

    return beside_it


def test_a_shield_can_be_used_inside_of_itself_and_its_bound_ends_with_it() -> None:
    async def top() -> float:
        guard = shield(within=1)
        with guard, guard:
            await sleep(0.5)
        await sleep(5)
        return now()

    assert go(top) == 5.5


# two things at once


def test_a_fault_that_comes_as_its_task_is_woken_is_raised_at_the_next_checkpoint() -> None:
    log: list[str] = []

    async def step() -> None:
        await wait_for(Fluent(read=lambda: now() >= 1))
        log.append("woken")
        await checkpoint()
        log.append("not reached")

    async def top() -> None:
        await par(step)

    run_of_it = run_plan(top, faults=[Fault("step", raises=GraspMissed, after=1)])
    assert isinstance(run_of_it.failure, GraspMissed)
    assert log == ["woken"]


def test_two_tasks_that_use_up_a_budget_at_once_are_decided_about_once() -> None:
    async def hopeless() -> None:
        raise GraspMissed(what="cup")

    async def trying() -> None:
        await with_failure_handling(hopeless, Recovery(PlanFailure, retries=3))

    with pytest.raises(BudgetExceeded) as caught:
        go(partial(budget, partial(par, trying, trying), attempts=0))
    assert caught.value.used == {}


def test_branches_started_in_the_decision_that_fails_never_begin() -> None:
    log: list[int] = []

    def values() -> Any:
        yield from (1, 2, 3)
        raise KeyError("no fourth")

    async def body(value: int) -> None:
        log.append(value)

    with pytest.raises(KeyError):
        go(partial(par_each, values(), body, limit=2))
    assert log == [1, 2]


def test_failures_at_the_same_time_are_told_by_the_trace() -> None:
    async def missing(what: str) -> None:
        raise GraspMissed(what=what)

    trace = Trace()
    with pytest.raises(GraspMissed):
        go(partial(par, first=partial(missing, "cup"), second=partial(missing, "plate")), trace=trace)
    told = [event["failure"]["siblings"] for event in trace.events if "siblings" in event.get("failure", {})]
    assert told
    assert all(list(siblings) == ["second"] for siblings in told)


# handles


def test_waking_up_a_task_that_is_not_there_yet_takes_back_its_suspension() -> None:
    async def top() -> tuple[bool, bool, bool]:
        handle = task("later")
        answers = suspend(handle), wake_up(handle), wake_up(handle)
        await tag("later", partial(sleep, 1))
        return answers

    assert go(top) == (True, True, False)


def test_holding_a_task_that_has_ended_does_nothing() -> None:
    async def top() -> Status:
        handle = task("over")
        await tag("over", partial(sleep, 0))
        async with task_suspended(handle):
            pass
        return handle.status.value

    assert go(top) is Status.SUCCEEDED


def test_hooks_of_suspension_may_lie_inside_of_each_other() -> None:
    log: list[str] = []

    async def subject() -> None:
        async with on_suspension(lambda: log.append("outer")), on_suspension(lambda: log.append("inner")):
            await sleep(1)

    go(partial(beside, subject, lambda handle: (suspend(handle), wake_up(handle)), 0.5))
    assert log == ["inner", "outer"]


def test_steps_one_after_another_in_a_resumable_run_need_no_trace_of_the_caller() -> None:
    async def top() -> list[Any]:
        return await seq(partial(sleep, 1), partial(sleep, 0))

    assert go(top, resumable=True) == (None, None)


def test_without_a_run_there_is_nothing_to_interrupt() -> None:
    assert interrupter() is None
