"""Real time: plan time follows a clock, and what threads hand in reaches the plan between steps."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest

from planlang import *
from planlang.failures import BranchEvaporated
from planlang.kernel.hosts import Inbox
from planlang.runs import Past, RecordedRun
from planlang.testing import replay


class Clock:
    """A clock that moves only when someone sleeps; ``at`` says what outside happens during a sleep."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.slept: list[float] = []
        self.events: list[tuple[float, Callable[[], object]]] = []

    def at(self, seconds: float, event: Callable[[], object]) -> None:
        self.events.append((1000.0 + seconds, event))
        self.events.sort(key=lambda entry: entry[0])

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        until = self.now + seconds
        if self.events and self.events[0][0] <= until:
            until, event = self.events.pop(0)
            event()
        self.now = max(self.now, until) + 1e-9

    def host(self, **options: Any) -> RealTimeHost:
        return RealTimeHost(clock=lambda: self.now, sleep=self.sleep, **options)


def test_a_step_of_plan_time_lasts_a_step_of_the_clock() -> None:
    clock = Clock()
    run(partial(sleep, 2.5), host=clock.host())
    assert clock.now == pytest.approx(1002.5, abs=1e-3)


def test_the_host_waits_for_what_is_due_and_not_step_by_step() -> None:
    clock = Clock()
    run(partial(sleep, 2.0), host=clock.host())
    assert len(clock.slept) < 60


def test_a_plan_that_is_late_catches_up_without_waiting_and_in_order() -> None:
    clock = Clock()
    log: list[tuple[str, float]] = []

    async def tick(name: str, seconds: float) -> None:
        await sleep(seconds)
        log.append((name, now()))

    async def slow() -> None:
        clock.now += 3.0  # a computation that takes its time

    async def plan() -> None:
        await par(slow, partial(tick, "b", 2.0), partial(tick, "a", 1.0), partial(tick, "c", 3.5))

    run(plan, host=clock.host())
    assert log == [("a", 1.0), ("b", 2.0), ("c", 3.5)]
    assert clock.now == pytest.approx(1003.5, abs=1e-3)


def test_what_a_thread_hands_in_reaches_the_plan_at_once_and_not_at_the_next_due_step() -> None:
    clock = Clock()
    host = clock.host()
    door = Fluent(False)
    seen: list[tuple[float, float]] = []

    async def listens() -> None:
        await wait_for(door)
        seen.append((clock.now, now()))

    clock.at(1.2345, lambda: host.post(door.set, True))
    run(partial(par, listens, partial(sleep, 10)), host=host)
    assert seen[0][0] == pytest.approx(1001.2345, abs=1e-6)
    assert seen[0][1] == int(1.2345 * 240) / 240


def test_two_posts_between_two_steps_come_in_order_without_plan_time_passing() -> None:
    clock = Clock()
    host = clock.host(rate=1)
    value = Fluent(0)
    seen: list[tuple[int, float]] = []

    async def listens() -> None:
        for number in (1, 2):
            await wait_for(value == number)
            seen.append((number, now()))

    clock.at(0.2, lambda: host.post(value.set, 1))
    clock.at(0.4, lambda: host.post(value.set, 2))
    run(partial(par, listens, partial(sleep, 1)), host=host)
    assert seen == [(1, 0.0), (2, 0.0)]


def test_a_deadline_and_a_post_before_it_the_post_wins() -> None:
    clock = Clock()
    host = clock.host()
    door = Fluent(False)
    clock.at(0.999, lambda: host.post(door.set, True))
    assert run(partial(timeout, 1.0, partial(wait_for, door)), host=host) is True


def test_without_an_open_source_a_plan_in_which_nothing_can_go_on_is_a_deadlock() -> None:
    with pytest.raises(DeadlockError, match="door open"):
        run(partial(wait_for, Fluent(False, "door open")), host=Clock().host())


def test_an_open_source_may_still_wake_the_plan_so_it_is_no_deadlock() -> None:
    clock = Clock()
    host = clock.host()
    door = Fluent(False)
    source = host.source("door sensor")
    clock.at(500.0, lambda: source.post(door.set, True))
    assert run(partial(wait_for, door), host=host) is True
    assert clock.now == pytest.approx(1500.0, abs=1e-3)


def test_when_the_last_source_closes_the_deadlock_is_told() -> None:
    clock = Clock()
    host = clock.host()
    source = host.source("door sensor")
    clock.at(3.0, source.close)
    clock.at(4.0, source.close)  # closing twice is allowed
    with pytest.raises(DeadlockError, match="door open"):
        run(partial(wait_for, Fluent(False, "door open")), host=host)
    assert clock.now == pytest.approx(1003.0, abs=1e-3)


def test_a_source_is_open_inside_its_with_block() -> None:
    host = Clock().host()
    with host.source("driver") as source:
        assert list(host.sources) == [source]
    with pytest.raises(DeadlockError):
        run(partial(wait_for, Fluent(False)), host=host)
    assert not host.sources


def test_the_step_limit_holds_while_the_plan_waits_for_a_source() -> None:
    clock = Clock()
    host = clock.host()
    host.source("silent sensor")
    with pytest.raises(StepLimit, match=r"480 world steps \(2 s of plan time\)"):
        run(partial(wait_for, Fluent(False)), host=host, max_steps=480)
    assert clock.now == pytest.approx(1002.0, abs=1e-3)


def test_a_plan_that_ends_at_the_step_limit_is_in_time() -> None:
    run(partial(sleep, 1.0), host=Clock().host(), max_steps=240)


def test_what_a_posted_function_raises_ends_the_run_with_all_cleanups() -> None:
    clock = Clock()
    host = clock.host()
    log: list[str] = []

    def breaks() -> None:
        raise OSError("the driver broke")

    async def plan() -> None:
        try:
            await sleep(10)
        finally:
            log.append("ended")

    clock.at(1.0, lambda: host.post(breaks))
    with pytest.raises(OSError, match="the driver broke"):
        run(plan, host=host)
    assert log == ["ended"]


def test_a_world_fluent_is_sampled_in_every_step_of_real_time() -> None:
    clock = Clock()
    reads: list[float] = []
    weight = Fluent(read=lambda: reads.append(clock.now) or clock.now >= 1000.5)
    run(partial(wait_for, weight), host=clock.host())
    assert len(reads) == pytest.approx(121, abs=2)


def test_a_host_serves_one_run_after_another_from_step_zero() -> None:
    clock = Clock()
    host = clock.host()
    times: list[float] = []

    async def plan() -> None:
        await sleep(1)
        times.append(now())

    run(plan, host=host)
    clock.now += 100
    run(plan, host=host)
    assert times == [1.0, 1.0]
    assert clock.now == pytest.approx(1102.0, abs=1e-3)


def test_a_thread_may_suspend_wake_and_evaporate_tasks_through_the_inbox() -> None:
    clock = Clock()
    host = clock.host()
    log: list[float] = []

    async def ticks() -> None:
        for _ in range(3):
            await sleep(1)
            log.append(now())

    async def plan() -> None:
        handle = task("ticks")
        clock.at(0.5, lambda: host.post(suspend, handle))
        clock.at(2.5, lambda: host.post(wake_up, handle))
        clock.at(3.5, lambda: host.post(evaporate, handle))
        await pursue(partial(tag, "ticks", ticks), partial(sleep, 10))

    with pytest.raises(BranchEvaporated):
        run(plan, host=host)
    assert log == pytest.approx([3.0], abs=0.01)


def test_a_bad_rate_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="rate"):
        RealTimeHost(0)


async def pick_and_place(log: list[str]) -> str:
    door = Fluent(False, "door")

    async def opens() -> None:
        await sleep(0.5)
        door.set(True)

    async def drives() -> str:
        await wait_for(door)
        log.append(f"through the door at {now()}")
        return await in_thread("driven".upper)

    _, driven = await par(opens, drives)
    await pursue(partial(sleep, 0.25), partial(sleep, 0.5))
    log.append(f"done at {now()}")
    return driven


def test_one_plan_runs_unchanged_on_all_hosts_and_gives_the_same_trace() -> None:
    class World:
        rate = 240

        def step(self) -> None:
            pass

    logs, texts = [], []
    for host in (VirtualHost(), SimulationHost(World()), Clock().host()):
        log: list[str] = []
        trace = Trace()
        assert run(partial(pick_and_place, log), host=host, trace=trace) == "DRIVEN"
        logs.append(log)
        texts.append([event for event in trace.events if event["event"] != "returned"])
    assert logs[0] == logs[1] == ["through the door at 0.5", "done at 0.75"]
    assert texts[0] == texts[1]
    assert [e["event"] for e in texts[0]] == [e["event"] for e in texts[2]]


def test_a_thread_that_posts_wakes_a_host_that_waits_for_its_inbox(monkeypatch: pytest.MonkeyPatch) -> None:
    host = RealTimeHost(clock=lambda: 0.0)  # a clock that stands still: only the inbox can end the wait
    door = Fluent(False)
    source = host.source("thread")
    thread = threading.Thread(target=lambda: source.post(door.set, True))
    wait = host.inbox.wait

    def begin_and_wait(seconds: float) -> None:
        if not thread.ident:
            thread.start()
        wait(seconds)

    monkeypatch.setattr(host.inbox, "wait", begin_and_wait)
    assert run(partial(wait_for, door), host=host) is True
    thread.join()


def test_a_wait_for_the_inbox_ends_after_its_time_and_what_comes_first_is_taken_first() -> None:
    inbox = Inbox()
    inbox.wait(0.0)
    assert not inbox.filled
    log: list[int] = []
    for number in range(3):
        inbox.put(partial(log.append, number))
    inbox.put(None)
    inbox.wait(0.0)
    assert inbox.filled
    for item in inbox.take():
        item()
    assert log == [0, 1, 2]
    assert not inbox.filled


def test_tasks_that_spin_in_real_time_make_no_progress_either() -> None:
    async def spin() -> None:
        while True:
            await sleep(0)

    with pytest.raises(NoProgress, match="spin"):
        run(spin, host=Clock().host())


def test_a_run_in_real_time_is_resumed_where_it_was_left_and_not_replayed() -> None:
    asked: list[float] = []

    async def ask() -> int:
        asked.append(now())
        return await in_thread(lambda: 5)

    async def top() -> object:
        return await seq(partial(sleep, 1), ask, partial(sleep, 2), ask)

    whole = Trace([])
    run(top, host=Clock().host(), trace=whole, resumable=True)
    cut = [number for number, event in enumerate(whole.events, 1) if event["event"] == "completed"][2]
    past = RecordedRun.of(whole.events[:cut])
    clock, again = Clock(), Trace([])
    asked.clear()
    assert run(top, host=clock.host(), trace=again, resumable=True, resume=Past(past)) == (None, 5, None, 5)
    assert asked == [3.0]
    assert clock.now < 1001, "what is taken over takes no time"
    with pytest.raises(ValueError, match="not replayed"):
        replay(top, again)


def test_a_fluent_that_another_thread_sets_is_seen_at_once_without_post() -> None:
    door: Fluent[bool] = Fluent(False, "door")
    seen: list[float] = []
    host = RealTimeHost(240)

    async def body() -> None:
        def callback() -> None:
            time.sleep(0.05)
            door.set(True)
            source.close()

        source = host.source("door")
        threading.Thread(target=callback).start()
        await wait_for(door)
        seen.append(now())
        assert threading.current_thread() is threading.main_thread()

    run(lambda: pursue(body, partial(sleep, 5)), host=host)
    assert seen[0] < 4
    assert door.value


def test_what_another_thread_sets_comes_in_order_also_while_nobody_waits() -> None:
    count: Fluent[int] = Fluent(0, "count")
    host = RealTimeHost(240)

    async def body() -> list[int]:
        found: list[int] = []
        await wait_for(count == 1, 0.01)
        thread = threading.Thread(target=lambda: [count.set(number) for number in range(1, 100)])
        with host.source("counter"):
            thread.start()
            while count.value < 99:
                await wait_for(count.changed())
                found.append(count.value)
        return found

    found = run(body, host=host)
    assert found == sorted(found)
    assert found[-1] == 99


def test_a_pulse_of_another_thread_is_handed_over_too() -> None:
    bell: Fluent[None] = Fluent(None, "bell")
    host = RealTimeHost(240)

    async def body() -> str:
        rung = bell.pulsed(missed="never")
        with host.source("bell"):
            timer = threading.Timer(0.05, bell.pulse)
            timer.start()
            await wait_for(rung)
        return "rung"

    assert run(body, host=host) == "rung"


def test_a_fluent_of_a_run_that_is_over_is_set_as_any_other() -> None:
    door: Fluent[bool] = Fluent(False, "door")
    run(partial(wait_for, door, 1), host=VirtualHost())
    thread = threading.Thread(target=partial(door.set, True))
    thread.start()
    thread.join()
    assert door.value


def test_a_deadlock_on_a_fluent_says_what_it_takes_to_wait_for_a_thread() -> None:
    door: Fluent[bool] = Fluent(False, "door")
    with pytest.raises(DeadlockError, match=r"with host\.source\("):
        run(partial(wait_for, door), host=VirtualHost())
