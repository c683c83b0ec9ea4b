"""Endings of a run: values, failures, deadlock, step limit, no progress, stuck tasks, Ctrl-C. Nothing is left open."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *


class World:
    """A world whose step does what the test says."""

    rate = 240

    def __init__(self, does: Any) -> None:
        self.does = does
        self.steps = 0

    def step(self) -> None:
        self.steps += 1
        self.does(self.steps)


def test_a_deadlock_names_each_blocked_task_what_it_waits_for_and_the_line() -> None:
    door = Fluent(False, "door open")

    async def waits() -> None:
        await wait_for(door)

    with pytest.raises(DeadlockError) as caught:
        go(partial(par, waits, second=waits))
    lines = str(caught.value).splitlines()
    assert len(lines) == 4
    assert "par/waits waits for door open at test_shutdown.py:" in lines[1]
    assert "par/second" in lines[2]
    assert "if another thread sets it, use a RealTimeHost" in lines[3]


def test_a_deadlocked_plan_is_drained_shields_or_not() -> None:
    log: list[str] = []

    async def plan() -> None:
        try:
            await wait_for(Fluent(False))
        finally:
            with shield():
                try:
                    await sleep(1)
                finally:
                    log.append("cleaned")

    with pytest.raises(DeadlockError):
        go(plan)
    assert log == ["cleaned"]


def test_the_step_limit_lists_the_tasks() -> None:
    async def plan() -> None:
        await sleep(100)

    with pytest.raises(StepLimit, match="plan waits for step 24000"):
        go(plan, max_steps=50)


def test_a_plan_that_ends_at_the_step_limit_is_in_time() -> None:
    go(partial(sleep, 1), max_steps=240)


def test_endless_checkpoints_within_one_step_are_no_progress() -> None:
    async def spin() -> None:
        while True:
            await checkpoint()

    with pytest.raises(NoProgress, match="spin"):
        go(partial(par, spin, partial(sleep, 1)))


def test_a_task_that_never_ends_on_evaporation_is_reported_with_its_line() -> None:
    async def undying() -> None:
        while True:
            with suppress(BaseException):
                await sleep(1)

    with pytest.warns(Warning, match="cut short"), pytest.raises(StuckTask, match=r"test_shutdown.py:\d+"):
        go(partial(pursue, undying, partial(sleep, 1)))


def test_a_world_error_drains_the_plan_and_is_raised() -> None:
    def breaks(step: int) -> None:
        if step == 3:
            raise OSError("the world broke")

    log: list[str] = []

    async def plan() -> None:
        try:
            await sleep(1)
        finally:
            log.append("ended")

    with pytest.raises(OSError, match="the world broke"):
        run(plan, host=SimulationHost(World(breaks)))
    assert log == ["ended"]


def test_a_programming_error_reaches_the_caller_as_itself() -> None:
    async def wrong() -> None:
        raise KeyError("typo")

    with pytest.raises(KeyError, match="typo"):
        go(partial(par, partial(par, wrong, partial(sleep, 1)), partial(sleep, 1)))


def test_awaiting_something_of_another_event_loop_is_an_error_at_that_line() -> None:
    import asyncio

    class Foreign:
        def __await__(self) -> Any:
            yield 17

    async def plan() -> None:
        await asyncio.sleep(0)

    async def other() -> None:
        await Foreign()

    with pytest.raises(TypeError, match="another event loop"):
        go(plan)
    with pytest.raises(TypeError, match=r"builtins\.int"):
        go(other)


def test_a_branch_that_is_no_async_function_is_an_error_that_names_it() -> None:
    def plain() -> int:
        return 3

    with pytest.raises(TypeError, match=r"plain returned int.*async def"):
        go(partial(par, plain))


def test_a_run_inside_a_run_is_refused() -> None:
    async def plan() -> None:
        go(partial(sleep, 1))

    with pytest.raises(PlanStructureError, match="await the inner plan"):
        go(plan)


def test_primitives_outside_a_run_say_so() -> None:
    coroutine = sleep(1)
    with pytest.raises(PlanStructureError, match="no plan is running"):
        coroutine.send(None)


def test_more_than_ten_thousand_nested_constructs_are_refused_by_name() -> None:
    async def endless() -> None:
        await par(endless)

    with pytest.raises(PlanStructureError, match=r"more than 10000 .*: endless at test_shutdown\.py:\d+"):
        go(endless)


def test_the_first_ctrl_c_runs_bounded_cleanups_and_ends_with_keyboard_interrupt() -> None:
    log: list[str] = []

    async def cleanup() -> None:
        await sleep(0.5)
        log.append("gripper opened")

    def press(step: int) -> None:
        if step == 10:
            os.kill(os.getpid(), signal.SIGINT)

    world = World(press)
    trace = Trace()
    with pytest.raises(KeyboardInterrupt):
        run(partial(unwind_protect, partial(sleep, 60), cleanup), host=SimulationHost(world), trace=trace)
    assert log == ["gripper opened"]
    assert world.steps == 10 + 120
    assert [e["event"] for e in trace.events if e["event"] == "interrupted"] == ["interrupted"]
    assert trace.events[-1]["status"] == "evaporated"


def test_a_second_ctrl_c_drains_at_once() -> None:
    def press(step: int) -> None:
        if step in (10, 20):
            os.kill(os.getpid(), signal.SIGINT)

    world = World(press)
    with pytest.raises(KeyboardInterrupt):
        run(partial(unwind_protect, partial(sleep, 60), partial(sleep, 9)), host=SimulationHost(world))
    assert world.steps == 20
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_any_ending_signal_whose_handler_raises_keyboard_interrupt_ends_a_run_in_order() -> None:
    def press(step: int) -> None:
        if step == 10:
            os.kill(os.getpid(), signal.SIGINT)  # ignored, as in what a script puts into the background
            os.kill(os.getpid(), signal.SIGTERM)

    world, trace = World(press), Trace()
    handlers = {signal.SIGINT: signal.SIG_IGN, signal.SIGTERM: signal.default_int_handler}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        with pytest.raises(KeyboardInterrupt):
            run(
                partial(unwind_protect, partial(sleep, 60), partial(sleep, 0.5)),
                host=SimulationHost(world),
                trace=trace,
            )
        assert {number: signal.getsignal(number) for number in handlers} == handlers, "they are as before the run"
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert world.steps == 10 + 120
    assert [e["event"] for e in trace.events if e["event"] in ("interrupted", "drained")] == ["interrupted"]


def test_keyboard_interrupt_raised_in_plan_code_drains() -> None:
    log: list[str] = []

    async def other() -> None:
        try:
            await sleep(10)
        finally:
            log.append("drained")

    async def interrupts() -> None:
        await sleep(1)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        go(partial(par, other, interrupts))
    assert log == ["drained"]


@pytest.mark.parametrize("kind", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_what_ends_the_run_from_inside_a_branch_has_no_cause_of_our_making(kind: type[BaseException]) -> None:
    raised = kind("by the plan")

    async def ends() -> None:
        await sleep(1)
        raise raised

    with pytest.raises(kind) as caught:
        go(partial(par, partial(par, ends, partial(sleep, 9)), partial(sleep, 9)))
    assert caught.value is raised
    assert (raised.__cause__, raised.__context__) == (None, None)


def test_an_async_generator_is_closed_by_the_task_that_iterated_it_before_that_is_dead() -> None:
    log: list[str] = []

    async def numbers() -> Any:
        try:
            for number in range(10):
                yield number
        finally:
            await sleep(1)
            log.append("generator closed")

    async def takes_one() -> None:
        async for _ in numbers():
            break
        log.append("left the loop")

    async def plan() -> None:
        await par(takes_one)
        log.append("joined")

    go(plan)
    assert log == ["left the loop", "generator closed", "joined"]


def test_an_evaporated_task_closes_its_generators_shielded() -> None:
    log: list[str] = []

    async def ticks() -> Any:
        try:
            while True:
                await sleep(1)
                yield 1
        finally:
            await sleep(1)
            log.append("closed")

    async def loop() -> None:
        async for _ in ticks():
            await sleep(100)

    go(partial(pursue, loop, partial(sleep, 5)))
    assert log == ["closed"]


def test_context_variables_belong_to_their_task_and_are_inherited() -> None:
    from contextvars import ContextVar

    who: ContextVar[str] = ContextVar("who", default="nobody")
    seen: list[str] = []

    async def child(name: str) -> None:
        seen.append(who.get())
        who.set(name)
        await checkpoint()
        seen.append(who.get())

    async def plan() -> None:
        who.set("parent")
        await par(partial(child, "a"), partial(child, "b"))
        seen.append(who.get())

    go(plan)
    assert seen == ["parent", "parent", "a", "b", "parent"]
    assert who.get() == "nobody"


def test_a_late_step_of_a_partial_order_inherits_the_context_of_its_construct() -> None:
    from contextvars import ContextVar

    from planlang import partial_order

    who: ContextVar[str] = ContextVar("who_late", default="nobody")

    async def tell() -> str:
        return who.get()

    async def plan() -> Any:
        who.set("parent")
        return await partial_order({"a": tell, "b": tell}, [("a", "b")])

    assert go(plan) == {"a": "parent", "b": "parent"}


def test_the_top_level_failure_is_raised_with_its_place() -> None:
    async def fails() -> None:
        raise PlanFailure("no")

    with pytest.raises(PlanFailure) as caught:
        go(partial(par, first=fails))
    where = caught.value.where
    assert where is not None
    assert where.path == "par/par/first"
    assert where.file == "test_shutdown.py"


def test_a_line_of_a_package_that_comes_with_the_language_is_no_place_of_a_failure() -> None:
    made: dict[str, Any] = {"__name__": "executive.modules.made", "PlanFailure": PlanFailure}
    exec("async def fails():\n    raise PlanFailure('no')", made)
    with pytest.raises(PlanFailure) as caught:
        go(partial(par, first=made["fails"]))
    assert str(caught.value.where) == "par/par/first"


def test_evaporated_is_no_exception_that_a_plan_catches_by_accident() -> None:
    assert not issubclass(Evaporated, Exception)
