"""The watchdog: code that reaches no checkpoint ends with an error that names the task and the line."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

from planlang import *
from planlang.kernel import runner as dog
from planlang.kernel import unwatched
from planlang.kernel.errors import Overdue
from planlang.kernel.hosts import WATCHDOG
from planlang.runs import with_paths

SHORT = 0.05


class World:
    """A world that does what the test says when stepped."""

    rate = 240

    def __init__(self, does: Callable[[], object] = int) -> None:
        self.step = does


def spin(seconds: float = 30.0) -> None:
    """Plain Python code that never waits."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        pass


async def never_waits() -> None:
    spin()


@pytest.mark.parametrize(
    "host",
    [
        VirtualHost(watchdog=SHORT),
        SimulationHost(World(), watchdog=SHORT),
        RealTimeHost(clock=lambda: 0.0, watchdog=SHORT),
    ],
    ids=["virtual", "simulation", "real time"],
)
def test_a_plan_that_never_waits_ends_with_its_task_and_line_on_every_host(host: Any) -> None:
    with pytest.raises(NoProgress, match=r"par/never_waits did not reach a checkpoint .* at test_watchdog\.py:\d+"):
        run(partial(par, never_waits, partial(sleep, 1)), host=host)


def test_blocking_code_that_never_returns_to_python_is_interrupted_in_the_main_thread() -> None:
    async def blocks() -> None:
        time.sleep(30)

    with pytest.raises(NoProgress, match=r"blocks did not reach.*await in_thread\(f\)"):
        run(blocks, host=VirtualHost(watchdog=SHORT))


def test_code_that_no_task_runs_is_watched_as_well() -> None:
    def values() -> Any:
        spin()
        yield 1

    async def body(value: int) -> None:
        pass

    with pytest.raises(NoProgress, match=r"did not reach a checkpoint .* test_watchdog\.py"):
        run(partial(par_each, values(), body, limit=1), host=VirtualHost(watchdog=SHORT))


def test_a_run_in_another_thread_is_watched_too() -> None:
    caught: list[BaseException] = []

    def runs() -> None:
        try:
            run(never_waits, host=VirtualHost(watchdog=SHORT))
        except BaseException as error:
            caught.append(error)

    thread = threading.Thread(target=runs)
    thread.start()
    thread.join(20)
    assert isinstance(caught[0], NoProgress)


def test_code_that_swallows_the_interruption_is_interrupted_again() -> None:
    async def swallows() -> None:
        for _ in range(3):
            with suppress(BaseException):
                spin()
        spin()

    with pytest.raises(NoProgress):
        run(swallows, host=VirtualHost(watchdog=SHORT))


def test_nothing_of_the_watchdog_is_told_in_the_trace_and_every_node_ends() -> None:
    trace = Trace()
    with pytest.raises(NoProgress):
        run(partial(par, never_waits, partial(sleep, 1)), host=VirtualHost(watchdog=SHORT), trace=trace)
    assert "drained" not in [event["event"] for event in trace.events]
    assert not [event for event in trace.events if "failure" in event]
    started = {event["path"] for event in with_paths(trace.events) if event["event"] == "started"}
    assert started <= {event["path"] for event in with_paths(trace.events) if event["event"] == "ended"}


def test_the_other_tasks_are_cleaned_up() -> None:
    log: list[str] = []

    async def other() -> None:
        try:
            await sleep(1)
        finally:
            log.append("cleaned")

    with pytest.raises(NoProgress):
        run(partial(par, other, never_waits), host=VirtualHost(watchdog=SHORT))
    assert log == ["cleaned"]


def test_slow_worlds_and_calls_in_threads_are_not_the_plans_fault() -> None:
    def slow() -> None:
        gate.wait(3 * SHORT)

    gate = threading.Event()
    run(partial(par, partial(in_thread, slow), partial(sleep, 1 / 240)), host=VirtualHost(watchdog=SHORT))
    run(partial(sleep, 1 / 240), host=SimulationHost(World(slow), watchdog=SHORT))


def test_what_may_take_long_is_not_counted_and_what_follows_is() -> None:
    async def patient() -> None:
        with unwatched():
            spin(4 * SHORT)

    async def impatient() -> None:
        await patient()
        spin()

    run(patient, host=VirtualHost(watchdog=SHORT))
    with pytest.raises(NoProgress):
        run(impatient, host=VirtualHost(watchdog=SHORT))
    with unwatched():
        assert True, "nothing runs here"


def test_the_watchdog_barks_after_ten_seconds_unless_told_otherwise() -> None:
    assert WATCHDOG == 10.0
    assert [host.watchdog for host in (VirtualHost(), SimulationHost(World()), RealTimeHost())] == [10.0] * 3
    assert VirtualHost(watchdog=None).watchdog is None


class Run:
    """A scheduler as the watchdog sees it."""

    def __init__(self) -> None:
        self.mark = (0, 0, 0)
        self.idle = False
        self.interrupts = 0
        self.interrupted = False

    def progress(self) -> tuple[int, ...]:
        return self.mark


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> tuple[Run, dog.Watch, list[type[BaseException]]]:
    """A run, its watch with a period of 10 s, and what the watchdog has summoned."""
    summoned: list[type[BaseException]] = []
    one = Run()
    watch = dog.Watch(one, 10.0, signal_number=signal.SIGINT)  # type: ignore[arg-type]
    monkeypatch.setattr(watch, "_interrupt", summoned.append)
    return one, watch, summoned


def test_it_barks_when_nothing_moved_for_the_whole_period(watched: Any) -> None:
    one, watch, summoned = watched
    one.mark = (1, 0, 0)
    assert watch.look(100.0) == 1.0
    watch.look(109.9)
    assert summoned == []
    assert watch.look(110.0) == dog.INSIST
    assert summoned == [Overdue]


def test_code_that_computes_is_given_processor_time_and_not_the_wall_clocks(
    watched: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, watch, summoned = watched
    one.mark, computed = (1, 0, 0), 50.0
    monkeypatch.setattr(watch, "_processor_time", lambda: computed)
    watch.look(0.0)
    for second in range(1, 240):  # on a machine so busy that a processor is had for a twenty-fifth of the time
        computed += 0.04
        watch.look(float(second))
    assert summoned == []
    for second in range(240, 252):
        computed += 0.04
        watch.look(float(second))
    assert summoned


def test_code_that_has_computed_and_is_blocked_then_is_interrupted_after_a_period_of_waiting(
    watched: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    one, watch, summoned = watched
    one.mark, computed = (1, 0, 0), 0.0
    monkeypatch.setattr(watch, "_processor_time", lambda: computed)
    watch.look(0.0)
    for second in range(1, 6):
        computed += 1.0
        watch.look(float(second))
    for second in range(6, 15):
        watch.look(float(second))
    assert summoned == []
    watch.look(15.0)
    assert summoned == [Overdue]


def test_every_movement_and_every_wait_of_the_host_begins_the_period_anew(watched: Any) -> None:
    one, watch, summoned = watched
    for second in range(0, 100, 9):
        one.mark = (0, second, 0)
        watch.look(float(second))
    one.idle = True
    watch.look(500.0)
    one.idle = False
    watch.look(509.0)
    assert summoned == []


def test_one_ctrl_c_is_never_insisted_on_and_the_second_after_a_tenth_of_a_second(watched: Any) -> None:
    one, watch, summoned = watched
    one.interrupts, one.interrupted = 1, True
    watch.look(1.0)
    watch.look(2.0)
    assert summoned == []
    one.interrupts = 2
    assert watch.look(2.0) == dog.INSIST
    watch.look(2.05)
    assert summoned == []
    watch.look(2.11)
    assert summoned == [KeyboardInterrupt]
    one.interrupted = False
    assert watch.look(2.2) == 1.0


def test_a_switched_off_watchdog_still_looks_for_ctrl_c() -> None:
    one = Run()
    watch = dog.Watch(one, None, signal_number=signal.SIGINT)  # type: ignore[arg-type]
    watch.look(0.0)
    assert watch.look(1e6) == 1.0


def test_a_summons_that_no_longer_applies_is_dropped_and_a_real_ctrl_c_is_told_apart() -> None:
    one = Run()
    watch = dog.Watch(one, 10.0, signal_number=signal.SIGINT)  # type: ignore[arg-type]
    frame = sys._getframe()
    assert not watch.answer(frame)
    watch._request = (Overdue, (9, 9, 9))  # the run has moved since
    assert watch.answer(frame)
    watch._request = (KeyboardInterrupt, one.mark)  # heeded meanwhile
    assert watch.answer(frame)
    watch._request = (Overdue, one.mark)
    with pytest.raises(Overdue):
        watch.answer(frame)


def test_code_that_stands_in_a_debugger_is_left_alone() -> None:
    assert not dog._debugged(sys._getframe())

    inside = SimpleNamespace(f_globals={"__name__": "pdb"}, f_back=None)
    assert dog._debugged(SimpleNamespace(f_globals={"__name__": "plan"}, f_back=inside))  # type: ignore[arg-type]


def test_code_of_the_scheduler_itself_is_never_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    watch = dog.Watch(Run(), 10.0, signal_number=signal.SIGINT)  # type: ignore[arg-type]
    own = SimpleNamespace(f_code=SimpleNamespace(co_filename=dog.__file__))
    monkeypatch.setattr(dog.sys, "_current_frames", lambda: {threading.get_ident(): own})
    watch._interrupt(Overdue)
    assert watch._request is None


def test_the_thread_of_the_watchdog_ends_when_there_is_nothing_to_watch() -> None:
    one = dog._Watchdog()
    with one.watching(dog.Watch(Run(), None, signal_number=signal.SIGINT)):  # type: ignore[arg-type]
        thread = one._thread
        assert thread is not None
    for _ in range(dog._IDLE_LOOKS + 1):
        one.nudge()
    thread.join(10)
    assert one._thread is None


def test_with_a_handler_of_the_users_own_ctrl_c_is_the_users_and_the_watchdog_still_barks() -> None:
    heard: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:

        async def presses() -> None:
            os.kill(os.getpid(), signal.SIGINT)
            await sleep(1)

        run(presses, host=VirtualHost())
        with pytest.raises(NoProgress):
            run(never_waits, host=VirtualHost(watchdog=SHORT))
    finally:
        signal.signal(signal.SIGINT, before)
    assert heard == [signal.SIGINT]


def test_where_processor_time_cannot_be_told_only_time_that_passes_counts(
    watched: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(time, "pthread_getcpuclockid")
    assert watched[1]._processor_time() == 0.0
