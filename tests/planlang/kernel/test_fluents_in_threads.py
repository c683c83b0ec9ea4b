"""Fluents that other threads set: refused in simulation, handed over in real time."""

from __future__ import annotations

import threading
from functools import partial

import pytest

from planlang import *


def test_in_simulation_a_fluent_that_a_thread_sets_is_refused_with_the_right_code_there_and_in_the_run() -> None:
    door: Fluent[bool] = Fluent(False, "door")
    raised: list[BaseException] = []

    def callback() -> None:
        try:
            door.set(True)
        except PlanStructureError as error:
            raised.append(error)

    async def body() -> None:
        await wait_for(door)

    async def world() -> None:
        thread = threading.Thread(target=callback, name="driver")
        await sleep(1)
        thread.start()
        thread.join()
        await sleep(1)

    with pytest.raises(PlanStructureError, match="door is set from thread driver during a simulated run") as caught:
        run(partial(par, body, world), host=VirtualHost())
    assert raised == [caught.value]
    assert "right: door.set(await in_thread(" in str(caught.value)


def set_in_a_thread(fluent: Fluent[bool], raised: list[BaseException]) -> None:
    """Set a fluent from another thread, as a driver does."""

    def drive() -> None:
        try:
            fluent.set(True)
        except PlanStructureError as error:
            raised.append(error)

    thread = threading.Thread(target=drive, name="driver")
    thread.start()
    thread.join()


def test_in_simulation_a_thread_may_not_set_a_fluent_that_the_run_has_not_come_to_yet() -> None:
    door: Fluent[bool] = Fluent(False, "door")
    raised: list[BaseException] = []

    async def body() -> None:
        set_in_a_thread(door, raised)
        await sleep(1)

    with pytest.raises(PlanStructureError, match="door is set from thread driver during a simulated run") as caught:
        run(body, host=VirtualHost())
    assert raised == [caught.value]
    assert door.value is False


def test_in_real_time_what_a_thread_sets_before_the_plan_comes_to_it_is_handed_over() -> None:
    door: Fluent[bool] = Fluent(False, "door")
    raised: list[BaseException] = []

    async def body() -> tuple[bool, bool]:
        set_in_a_thread(door, raised)
        before = door.value
        await sleep(0.01)
        return before, door.value

    assert run(body, host=RealTimeHost()) == (False, True)
    assert raised == []


def test_before_and_after_runs_any_thread_may_set_a_fluent() -> None:
    door: Fluent[bool] = Fluent(False, "door")
    raised: list[BaseException] = []
    set_in_a_thread(door, raised)
    assert run(partial(wait_for, door), host=VirtualHost()) is True
    door.set(False)
    set_in_a_thread(door, raised)
    assert door.value is True
    assert raised == []


def test_in_simulation_what_a_call_in_a_thread_sets_is_set_before_its_caller_goes_on() -> None:
    door: Fluent[bool] = Fluent(False, "door")

    async def opens() -> bool:
        await in_thread(partial(door.set, True))
        return door.value

    async def waits() -> str:
        await wait_for(door)
        return "open"

    assert run(partial(par, waits, opens), host=VirtualHost()) == ("open", True)
