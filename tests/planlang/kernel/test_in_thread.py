"""in_thread: the world stands still in simulation, abandoned calls in real time, errors and misuse."""

from __future__ import annotations

import asyncio
import os
import signal
import threading
from contextvars import ContextVar
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import GraspMissed, Timeout
from planlang.kernel.threads import AsyncioCall
from planlang.testing import replay, run_plan


class World:
    """Counts its steps, and what was going on in each."""

    rate = 240

    def __init__(self) -> None:
        self.steps = 0
        self.log: list[str] = []

    def step(self) -> None:
        self.steps += 1
        self.log.append("step")


def test_a_call_gives_its_value_with_its_arguments() -> None:
    async def plan() -> Any:
        return await in_thread(divmod, 17, 5), await in_thread(sorted, [1, 3, 2], reverse=True)

    assert go(plan) == ((3, 2), [3, 2, 1])


def test_a_call_runs_on_another_thread_that_does_not_keep_the_process_alive() -> None:
    async def plan() -> threading.Thread:
        return await in_thread(threading.current_thread)

    thread = go(plan)
    assert thread is not threading.current_thread()
    assert thread.daemon


def test_a_failure_in_the_thread_reaches_the_caller_as_itself() -> None:
    failure = GraspMissed("closed on nothing")

    def grasp() -> None:
        raise failure

    async def plan() -> Any:
        try:
            await in_thread(grasp)
        except GraspMissed as caught:
            return caught

    assert go(plan) is failure


def test_a_programming_error_in_the_thread_is_raised_at_the_await() -> None:
    with pytest.raises(ZeroDivisionError):
        go(partial(in_thread, divmod, 1, 0))


def test_in_simulation_the_world_stands_still_until_all_calls_have_returned() -> None:
    world = World()
    second_called = threading.Event()

    def first() -> None:
        second_called.wait(10)
        world.log.append("first returned")

    def second() -> None:
        world.log.append("second runs")
        second_called.set()

    async def plan() -> None:
        await par(partial(in_thread, first), partial(in_thread, second), partial(sleep, 1 / 240))

    run(plan, host=SimulationHost(world))
    assert world.log == ["second runs", "first returned", "step"]


def test_in_simulation_a_call_takes_no_plan_time() -> None:
    async def plan() -> float:
        await sleep(1)
        await in_thread(int)
        return now()

    assert go(plan) == 1.0


@pytest.mark.parametrize("host", [VirtualHost(), SimulationHost(World())], ids=["virtual", "simulation"])
def test_in_simulation_results_come_in_order_of_submission_however_the_threads_end(host: Any) -> None:
    order: list[int] = []
    returned = [threading.Event() for _ in range(6)]
    returned[5].set()

    def call(number: int) -> int:
        returned[number + 1].wait(10)  # the last one returns first
        returned[number].set()
        return number

    async def branch(number: int) -> None:
        order.append(await in_thread(call, number))

    run(partial(par, *[partial(branch, number) for number in range(5)]), host=host)
    assert order == [0, 1, 2, 3, 4]


def test_in_simulation_an_evaporated_caller_is_released_after_its_call_has_returned() -> None:
    log: list[str] = []
    evaporated = threading.Event()

    def call() -> None:
        evaporated.wait(10)
        log.append("call returned")

    async def caller() -> None:
        try:
            await in_thread(call)
            log.append("never")
        finally:
            log.append("caller released")

    async def wins() -> None:
        evaporated.set()

    trace = Trace()
    go(partial(pursue, caller, wins), trace=trace)
    assert log == ["call returned", "caller released"]
    (late,) = (event for event in trace.events if event["event"] == "returned")
    assert late["late"] is True


def test_a_shielded_caller_gets_its_value_although_it_is_being_evaporated() -> None:
    log: list[Any] = []

    async def caller() -> None:
        with shield():
            log.append(await in_thread(int, "7"))
        await checkpoint()
        log.append("never")

    async def wins() -> None:
        pass

    go(partial(pursue, caller, wins))
    assert log == [7]


def test_a_body_whose_call_returns_in_the_step_of_its_deadline_is_in_time() -> None:
    assert go(partial(timeout, 0, partial(in_thread, int, "3"))) == 3


def test_a_suspended_caller_gets_its_value_after_it_was_woken_up() -> None:
    log: list[Any] = []

    async def caller() -> None:
        log.append(await in_thread(int, "3"))
        log.append(now())

    async def suspends() -> None:
        await checkpoint()
        suspend(task("call"))
        await sleep(2)
        log.append("still held")
        wake_up(task("call"))

    go(partial(par, partial(tag, "call", caller), suspends))
    assert log == ["still held", 3, 2.0]


def test_more_calls_than_threads_are_all_made() -> None:
    async def plan() -> Any:
        return await par(*[partial(in_thread, abs, -number) for number in range(600)])

    assert go(plan) == tuple(range(600))


def test_the_trace_of_calls_is_the_same_in_every_run() -> None:
    def text() -> str:
        trace = Trace()
        go(partial(par, *[partial(in_thread, abs, -number) for number in range(20)]), trace=trace)
        return trace.text()

    assert text() == text()
    assert '"event": "called", "node": 4, "name": "in_thread#2", "call": 2, "function": "abs"' in text()


def test_context_variables_are_seen_by_the_thread_and_not_changed_for_the_plan() -> None:
    who: ContextVar[str] = ContextVar("who_thread", default="nobody")

    def tell() -> str:
        heard = who.get()
        who.set("thread")
        return heard

    async def plan() -> Any:
        who.set("plan")
        return await in_thread(tell), who.get()

    assert go(plan) == ("plan", "plan")


def test_a_primitive_called_in_the_thread_says_that_no_plan_runs_there() -> None:
    with pytest.raises(PlanStructureError, match="no plan is running in this thread"):
        go(partial(in_thread, task, "x"))


def test_misuse_is_refused_with_the_right_code() -> None:
    async def drives() -> None:
        pass

    async def called() -> None:
        await in_thread(drives())  # type: ignore[arg-type]

    with pytest.raises(
        TypeError, match=r"wrong: await in_thread\(drives\(\)\)\n  right: await in_thread\(drives, \.\.\.\)"
    ):
        go(called)
    right = r"right: await in_thread\(drives\)    or, for a plan, await drives\(\)"
    with pytest.raises(TypeError, match=rf"drives\(\) is a coroutine(.|\n)*lambda: drives\(\)\)\n  {right}"):
        go(partial(in_thread, lambda: drives()))
    with pytest.raises(TypeError, match=rf"drives\(\) is a coroutine(.|\n)*{right}"):
        go(partial(in_thread, plan(drives)))
    with pytest.raises(TypeError, match="has to be a function that blocks, or an async function of asyncio, not 7"):
        go(partial(in_thread, 7))
    with pytest.raises(ValueError, match="takes of in_thread has to be a duration"):
        go(partial(in_thread, abs, -1, takes=-1))


def test_an_async_function_that_awaits_the_plan_language_says_that_no_plan_runs_in_its_thread() -> None:
    with pytest.raises(
        PlanStructureError, match=r"wrong: (.|\n)*in_thread\(serve\)(.|\n)*right: (.|\n)* await serve\(\)"
    ):
        go(partial(in_thread, partial(sleep, 1)))


# -- asyncio


async def fetched(what: str, *, seconds: float = 0.0) -> str:
    await asyncio.sleep(seconds)
    return f"{what} from {threading.current_thread().name}"


class Client:
    async def __call__(self, what: str) -> str:
        return await fetched(what)


def test_an_async_function_of_asyncio_runs_in_an_event_loop_of_a_thread() -> None:
    async def plan() -> Any:
        return await par(partial(in_thread, fetched, "map", seconds=0.001), partial(in_thread, Client(), "robot"))

    assert [*go(plan)] == ["map from planlang fetched", "robot from planlang Client"]


def test_what_an_async_function_of_asyncio_raises_reaches_the_caller() -> None:
    failure = GraspMissed("closed on nothing")

    async def fails() -> None:
        await asyncio.sleep(0)
        raise failure

    with pytest.raises(GraspMissed) as caught:
        go(partial(in_thread, fails))
    assert caught.value is failure


def test_an_async_function_that_was_cancelled_before_it_began_does_not_begin() -> None:
    begun: list[str] = []

    async def waits() -> None:
        begun.append("it")

    call = AsyncioCall(waits)
    call.cancel()
    with pytest.raises(asyncio.CancelledError):
        call()
    assert begun == []
    call.cancel()


# -- plan time that calls take


def test_a_call_takes_the_plan_time_that_the_plan_states() -> None:
    async def plan() -> Any:
        value = await in_thread(abs, -1, takes=2)
        try:
            await in_thread(divmod, 1, 0, takes=0.5)
        except ZeroDivisionError:
            return value, now()

    assert go(plan) == (1, 2.5)
    assert run(plan, host=SimulationHost(World())) == (1, 2.5)


def test_a_timeout_around_a_call_fires_when_the_call_takes_longer() -> None:
    made: list[int] = []

    async def plan() -> float:
        assert await timeout(2, partial(in_thread, made.append, 1, takes=2)) is None
        with pytest.raises(Timeout):
            await timeout(1, partial(in_thread, made.append, 2, takes=1.5))
        return now()

    assert go(plan) == 3.0
    assert made == [1, 2]  # the call was made; only its result is not waited for


def test_a_suspended_call_takes_its_time_after_waking_up() -> None:
    async def suspends() -> None:
        await sleep(1)
        async with task_suspended(task("call")):
            await sleep(10)

    async def plan() -> float:
        await par(partial(tag, "call", partial(in_thread, abs, -1, takes=2)), suspends)
        return now()

    assert go(plan) == 12.0


def test_in_real_time_a_call_takes_as_long_as_it_takes() -> None:
    async def plan() -> float:
        await in_thread(abs, -1, takes=3600)
        return now()

    assert run(plan, host=RealTimeHost()) < 60


def test_calls_that_take_time_are_replayed_without_being_made() -> None:
    made: list[str] = []

    async def plan() -> str:
        made.append(await in_thread(fetched, "map", takes=3))
        return made[-1]

    recorded = run_plan(plan, resumable=True)
    assert replay(plan, recorded).equal
    assert made == ["map from planlang fetched"] * 2


def test_when_the_system_gives_no_more_threads_the_caller_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    async def plan() -> str:
        monkeypatch.setattr(threading.Thread, "start", refuse)
        with pytest.raises(RuntimeError, match="new thread"):
            await in_thread(int)
        monkeypatch.undo()
        return "went on"

    assert go(plan) == "went on"


def test_a_call_in_flight_is_no_deadlock_and_when_it_is_gone_it_is() -> None:
    door = Fluent(False, "door")

    async def plan() -> None:
        await in_thread(int)
        await wait_for(door)

    for host in (VirtualHost(), RealTimeHost(clock=lambda: 0.0)):
        with pytest.raises(DeadlockError, match="waits for door"):
            run(plan, host=host)


# -- real time


def test_ctrl_c_during_a_call_in_simulation_evaporates_the_others_and_releases_the_caller_later() -> None:
    log: list[str] = []
    evaporated = threading.Event()

    def call() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        evaporated.wait(10)
        log.append("call returned")

    async def caller() -> None:
        try:
            await in_thread(call)
        finally:
            log.append("caller released")

    async def other() -> None:
        try:
            await sleep(10)
        finally:
            log.append("other evaporated")
            evaporated.set()

    with pytest.raises(KeyboardInterrupt):
        go(partial(par, other, caller))
    assert log == ["other evaporated", "call returned", "caller released"]


def test_ctrl_c_while_tasks_run_is_heeded_before_the_next_one_begins() -> None:
    log: list[str] = []

    async def presses() -> None:
        os.kill(os.getpid(), signal.SIGINT)

    async def never_begins() -> None:
        log.append("begun")

    with pytest.raises(KeyboardInterrupt):
        go(partial(par, presses, never_begins))
    assert log == []
