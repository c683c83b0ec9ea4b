"""Calls in threads while the clock goes on: callers that are evaporated, and calls that return too late."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import pytest

from planlang import *
from planlang.failures import BranchEvaporated


@pytest.fixture
def gate() -> Iterator[threading.Event]:
    """Opened at the end of a test at the latest, so that no thread stays behind."""
    event = threading.Event()
    yield event
    event.set()


class Steered:
    """A real-time host whose clock moves a step whenever the host sleeps; gates let calls return."""

    def __init__(self) -> None:
        self.now = 0.0
        self.events: list[tuple[float, Callable[[], object]]] = []
        self.host = RealTimeHost(clock=lambda: self.now, sleep=self.sleep)

    def sleep(self, seconds: float) -> None:
        if self.events and self.events[0][0] <= self.now:
            self.events.pop(0)[1]()
        self.now += min(seconds, 1 / 240)


def released(gate: threading.Event, thread: list[threading.Thread], host: RealTimeHost) -> Callable[[], None]:
    """Let a call return and wait until its thread has handed in the result."""

    def release() -> None:
        gate.set()
        thread[0].join(10)

    return release


def blocking(gate: threading.Event, thread: list[threading.Thread], value: object = "late") -> Callable[[], object]:
    def call() -> object:
        thread.append(threading.current_thread())
        gate.wait(10)
        return value

    return call


def test_in_real_time_the_plan_goes_on_while_a_call_is_in_flight(gate: threading.Event) -> None:
    steered, thread = Steered(), []  # type: ignore[var-annotated]
    log: list[Any] = []

    async def caller() -> None:
        log.append(await in_thread(blocking(gate, thread, "value")))
        log.append(now())

    async def other() -> None:
        await sleep(1)
        log.append("other")

    steered.events.append((2.0, released(gate, thread, steered.host)))
    run(partial(par, caller, other), host=steered.host)
    assert log[:2] == ["other", "value"]
    assert log[2] == pytest.approx(2.0, abs=0.02)


def test_in_real_time_an_evaporated_caller_is_released_at_once_and_its_call_abandoned(gate: threading.Event) -> None:
    steered, thread = Steered(), []  # type: ignore[var-annotated]

    async def plan() -> float:
        await pursue(partial(in_thread, blocking(gate, thread)), partial(sleep, 0.5))
        return now()

    assert run(plan, host=steered.host) == 0.5
    assert thread[0].is_alive()
    assert thread[0].daemon


def test_in_real_time_a_late_result_goes_to_the_trace_only_and_wakes_no_later_wait(gate: threading.Event) -> None:
    steered, thread = Steered(), []  # type: ignore[var-annotated]
    told: list[float] = []

    async def caller() -> None:
        try:
            await in_thread(blocking(gate, thread))
        finally:
            with shield():
                before = now()
                await sleep(2)
                told.append(now() - before)

    trace = Trace()
    steered.events.append((1.0, released(gate, thread, steered.host)))
    run(partial(pursue, caller, partial(sleep, 0.5)), host=steered.host, trace=trace)
    assert told == [2.0]
    (late,) = (event for event in trace.events if event["event"] == "returned")
    assert (late["result"], late["late"]) == ("late", True)
    assert 240 <= late["step"] < 250


def test_a_result_that_comes_after_the_run_is_dropped_by_the_next_one(gate: threading.Event) -> None:
    steered, thread = Steered(), []  # type: ignore[var-annotated]
    trace = Trace()
    run(partial(pursue, partial(in_thread, blocking(gate, thread)), partial(sleep, 0.5)), host=steered.host)
    released(gate, thread, steered.host)()
    run(partial(sleep, 1), host=steered.host, trace=trace)
    assert not [event for event in trace.events if event["event"] == "returned"]


def test_in_real_time_the_step_limit_abandons_calls_in_flight(gate: threading.Event) -> None:
    steered, thread = Steered(), []  # type: ignore[var-annotated]
    with pytest.raises(StepLimit, match="waits for the call of call in a thread"):
        run(partial(in_thread, blocking(gate, thread)), host=steered.host, max_steps=100)


def test_abandoned_calls_do_not_keep_later_ones_from_a_thread(
    gate: threading.Event, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planlang.kernel.threads.MOST_THREADS", 1)
    steered, thread = Steered(), []  # type: ignore[var-annotated]

    async def plan() -> Any:
        blocked = partial(in_thread, blocking(gate, thread))
        await pursue(blocked, blocked, partial(sleep, 0.5))
        return await in_thread(int, "5")

    assert run(plan, host=steered.host) == 5
    assert len(thread) == 1


def test_a_plan_failure_in_a_late_call_ends_nothing(gate: threading.Event) -> None:
    steered, thread = Steered(), []  # type: ignore[var-annotated]

    def fails() -> None:
        blocking(gate, thread)()
        raise PlanFailure("too late")

    trace = Trace()
    steered.events.append((1.0, released(gate, thread, steered.host)))

    async def plan() -> None:
        await pursue(partial(in_thread, fails), partial(sleep, 0.5))
        await sleep(1)

    run(plan, host=steered.host, trace=trace)
    (late,) = (event for event in trace.events if event["event"] == "returned")
    assert late["failure"]["message"] == "too late"


def test_a_call_that_returns_together_with_the_evaporation_of_its_caller_is_late(gate: threading.Event) -> None:
    steered, thread = Steered(), []  # type: ignore[var-annotated]
    handles: list[Any] = []

    def both() -> None:
        steered.host.post(evaporate, handles[0])
        released(gate, thread, steered.host)()

    async def plan() -> None:
        handles.append(task("call"))
        with pytest.raises(BranchEvaporated):
            await tag("call", partial(in_thread, blocking(gate, thread)))

    trace = Trace()
    steered.events.append((1.0, both))
    run(plan, host=steered.host, trace=trace)
    (late,) = (event for event in trace.events if event["event"] == "returned")
    assert late["late"] is True


def test_in_real_time_an_async_function_is_cancelled_with_its_caller(gate: threading.Event) -> None:
    begun = threading.Event()
    steered = Steered()

    async def waits() -> None:
        begun.set()
        try:
            await asyncio.sleep(60)
        except asyncio.CancelledError:
            gate.set()
            raise

    async def plan() -> float:
        await pursue(partial(in_thread, waits), partial(sleep, 0.5))
        assert gate.wait(10)
        return now()

    steered.events.append((0.25, lambda: begun.wait(10)))
    assert run(plan, host=steered.host) == 0.5
