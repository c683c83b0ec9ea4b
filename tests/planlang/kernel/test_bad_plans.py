"""Plans and worlds that misbehave: each run ends with a clear error, all cleanups, and no coroutine left open."""

from __future__ import annotations

import gc
import inspect
import itertools
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from types import CoroutineType
from typing import Any

import pytest

from planlang import *
from planlang.kernel.cancel import MAX_DELIVERIES
from planlang.kernel.errors import CutShort
from planlang.testing import Belief, Script
from planlang.testing.scripted import ScriptedExecutive
from tests.support.examples import some


@pytest.fixture
def younger_things() -> Iterator[Callable[[], list[object]]]:
    """Yield what has come into being in the test and is not garbage; nothing else is looked through for it."""
    gc.freeze()
    yield lambda: (gc.collect(), gc.get_objects())[1]
    gc.unfreeze()


@pytest.fixture(autouse=True)
def nothing_is_left_open(monkeypatch: pytest.MonkeyPatch, younger_things: Callable[[], list[object]]) -> Iterator[None]:
    """Fail if a coroutine survives the test or the interpreter prints about one; stuck tasks alone may stay."""
    printed: list[object] = []
    monkeypatch.setattr(sys, "unraisablehook", lambda details: printed.append(details.exc_value))
    yield
    made = [thing for thing in younger_things() if isinstance(thing, CoroutineType)]
    left = [one for one in made if inspect.getcoroutinestate(one) != inspect.CORO_CLOSED]
    stuck = [one for one in left if "undying" in one.__qualname__]
    for one in stuck:  # and what it awaits
        if isinstance(one.cr_await, CoroutineType):
            stuck.append(one.cr_await)
    assert [one for one in left if one not in stuck] == []
    assert not printed


def go(plan: Any, host: Any = None, **options: Any) -> Any:
    """Run a plan and check that all nodes of its tree that began have ended."""
    trace = Trace()
    try:
        return run(plan, host=host or VirtualHost(), trace=trace, **options)
    finally:
        begun = [event["node"] for event in trace.events if event["event"] == "started"]
        ended = [event["node"] for event in trace.events if event["event"] == "ended"]
        assert set(begun) <= set(ended)
        assert len(ended) == len(set(ended))


class World:
    """A world that raises in one step."""

    rate = 240

    def __init__(self, error: BaseException, step: int = 3) -> None:
        self._error = error
        self._steps = step

    def step(self) -> None:
        self._steps -= 1
        if not self._steps:
            raise self._error


class Still:
    """The clock of a real-time host in which each sleep is over at once."""

    def __init__(self) -> None:
        self.now = 0.0

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def host(self) -> RealTimeHost:
        return RealTimeHost(clock=lambda: self.now, sleep=self.sleep)


async def undying(log: list[int]) -> None:
    """Swallow everything, for ever."""
    while True:
        try:
            await sleep(1)
        except BaseException:
            log.append(1)


# -- plans that swallow evaporation for ever


def test_a_stuck_task_is_given_up_after_exactly_one_hundred_deliveries() -> None:
    log: list[int] = []
    with pytest.warns(CutShort), pytest.raises(StuckTask, match=r"undying does not end .*test_bad_plans\.py:\d+"):
        go(partial(pursue, partial(undying, log), partial(sleep, 0.5)))
    assert len(log) == MAX_DELIVERIES == 100


def test_the_warning_for_each_of_its_hundred_awaits_is_shown_once() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("default")
        with pytest.raises(StuckTask):
            go(partial(pursue, partial(undying, []), partial(sleep, 0.5)))
    assert [one.category for one in caught] == [CutShort]


def test_what_to_write_instead_is_said_to_a_plan_that_swallows_evaporation() -> None:
    with pytest.warns(CutShort), pytest.raises(StuckTask, match=r"wrong: except BaseException.*\n.*right: except Pl"):
        go(partial(pursue, partial(undying, []), partial(sleep, 0.5)))


def test_a_task_that_gives_in_at_the_hundredth_delivery_is_not_stuck() -> None:
    async def tough() -> None:
        for _ in range(99):
            with suppress(BaseException):
                await sleep(100)
        await sleep(100)

    with pytest.warns(CutShort):
        go(partial(pursue, tough, partial(sleep, 0.5)))


def test_several_stuck_tasks_do_not_keep_the_others_from_ending() -> None:
    log: list[str] = []

    async def decent() -> None:
        try:
            await sleep(10)
        finally:
            log.append("cleaned")

    async def plan() -> None:
        stubborn = partial(undying, [])
        await pursue(partial(par, stubborn, decent, stubborn), partial(sleep, 1), stubborn, partial(par, decent))

    with pytest.warns(CutShort), pytest.raises(StuckTask):
        go(plan)
    assert log == ["cleaned", "cleaned"]


def test_a_shielded_task_that_swallows_everything_is_stuck_in_a_drain() -> None:
    async def undying_behind_a_shield() -> None:
        with shield(within=1e6):
            await undying([])

    with pytest.raises(StuckTask):
        go(partial(par, undying_behind_a_shield, partial(sleep, 1)), max_steps=10)


def test_after_a_stuck_task_another_plan_can_run() -> None:
    with pytest.warns(CutShort), pytest.raises(StuckTask):
        go(partial(pursue, partial(undying, []), partial(sleep, 1)))
    assert go(partial(par, partial(in_thread, int, "7"))) == (7,)


def test_constructs_begun_again_and_again_in_a_cleanup_are_stuck_too() -> None:
    async def undying_restart() -> None:
        while True:
            with suppress(BaseException):
                await par(partial(sleep, 1), partial(sleep, 2))

    with pytest.warns(CutShort), pytest.raises(StuckTask):
        go(partial(pursue, undying_restart, partial(sleep, 0.5)))


# -- cleanups that wait or fail


def test_a_cleanup_that_waits_without_a_shield_is_cut_short_with_a_warning_and_its_line() -> None:
    log: list[str] = []

    async def careless() -> None:
        try:
            await sleep(10)
        finally:
            await sleep(1)
            log.append("never")

    with pytest.warns(CutShort, match="unwind_protect") as caught:
        go(partial(pursue, careless, partial(sleep, 0.5)))
    assert caught[0].filename.endswith("test_bad_plans.py")
    assert log == []


@pytest.mark.parametrize("cleanup", [partial(sleep, 60), lambda: wait_for(Fluent(False))], ids=["long", "endless"])
def test_a_cleanup_that_waits_longer_than_its_bound_is_a_programming_error_and_no_deadlock(cleanup: Any) -> None:
    body = partial(unwind_protect, partial(sleep, 60), cleanup, within=2)
    with pytest.raises(CleanupOverrun, match="longer than 2 s"):
        go(partial(pursue, body, partial(sleep, 1)))


def test_an_overrun_of_our_own_code_names_the_line_of_the_plan_around_it() -> None:
    async def plan() -> None:
        await pursue(partial(unwind_protect, partial(sleep, 60), partial(sleep, 60), within=2), partial(sleep, 1))

    with pytest.raises(CleanupOverrun, match=r"started at test_bad_plans\.py:\d+; .*within="):
        go(plan)


def test_a_cleanup_that_fails_does_not_hide_the_failure_and_is_attached_to_it() -> None:
    async def fails() -> None:
        await sleep(1)
        raise PlanFailure("the arm")

    async def cleanup() -> None:
        raise PlanFailure("the gripper")

    with pytest.raises(PlanFailure, match="the arm") as caught:
        go(partial(par, fails, partial(unwind_protect, partial(sleep, 60), cleanup)))
    assert [str(other) for other in caught.value.cleanup_failures] == ["the gripper"]


def test_a_cleanup_with_a_programming_error_raises_it_once_all_children_are_dead() -> None:
    log: list[str] = []

    async def cleanup() -> None:
        raise KeyError("typo in the cleanup")

    async def slow() -> None:
        await sleep(1)
        log.append("slow cleanup done")

    async def plan() -> None:
        await pursue(
            partial(sleep, 0.5),
            partial(unwind_protect, partial(sleep, 60), cleanup),
            partial(unwind_protect, partial(sleep, 60), slow),
        )

    with pytest.raises(KeyError, match="typo in the cleanup"):
        go(plan)
    assert log == ["slow cleanup done"]


# -- drains: shields are void, time stands still, every wait raises


def waiting_cleanup(log: list[str]) -> Callable[[], Any]:
    """A plan whose shielded cleanup waits in several ways, each of which raises in a drain."""

    async def cleanup() -> None:
        for wait in (partial(sleep, 1), checkpoint, partial(wait_for, Fluent(True)), partial(in_thread, int)):
            try:
                await wait()
            except BaseException as error:
                log.append(type(error).__name__)

    async def plan() -> None:
        await par(partial(unwind_protect, partial(wait_for, Fluent(False, "door")), cleanup))

    return plan


@pytest.mark.parametrize(
    "host",
    [VirtualHost, lambda: Still().host(), lambda: SimulationHost(World(OSError("world"), 10**9))],
    ids=["virtual", "real time", "simulation"],
)
def test_in_the_drain_of_a_deadlock_every_wait_raises(host: Any) -> None:
    log: list[str] = []
    with pytest.raises(DeadlockError):
        go(waiting_cleanup(log), host())
    assert log == ["Evaporated"] * 4


@pytest.mark.parametrize("host", [VirtualHost, lambda: Still().host()], ids=["virtual", "real time"])
def test_in_the_drain_of_a_step_limit_every_wait_raises_and_time_stands_still(host: Any) -> None:
    log: list[str] = []
    clock: list[float] = []

    async def tells_time() -> None:
        try:
            await sleep(100)
        finally:
            clock.append(now())

    with pytest.raises(StepLimit):
        go(partial(par, waiting_cleanup(log), tells_time, partial(sleep, 0.1)), host(), max_steps=48)
    assert log == ["Evaporated"] * 4
    assert clock[0] <= 48 / 240
    assert len(clock) == 1


@pytest.mark.parametrize("error", [OSError("broke"), PlanFailure("odd"), ZeroDivisionError(), KeyboardInterrupt()])
def test_a_world_that_raises_drains_the_plan_and_its_error_is_raised_as_itself(error: BaseException) -> None:
    log: list[str] = []

    async def plan() -> None:
        await par(partial(sleep, 1), waiting_cleanup(log))

    with pytest.raises(type(error)) as caught:
        go(plan, SimulationHost(World(error)))
    assert caught.value is error
    if isinstance(error, Exception):
        assert error.__notes__ == ["raised by SimulationHost after 2 world steps"]
    assert log == ["Evaporated"] * 4


def test_a_world_that_raises_in_its_first_step_reaches_a_plan_in_no_recovery() -> None:
    async def swallows() -> None:
        with suppress(Exception):
            await sleep(1)

    with pytest.raises(OSError, match="broke"):
        go(partial(try_all, swallows, swallows), SimulationHost(World(OSError("broke"), 1)))


def test_an_async_generator_is_closed_in_a_drain() -> None:
    log: list[str] = []

    async def ticks() -> Any:
        try:
            while True:
                yield 1
                await sleep(1)
        finally:
            log.append("closed")

    async def plan() -> None:
        async for _ in ticks():
            pass

    with pytest.raises(StepLimit):
        go(plan, max_steps=500)
    assert log == ["closed"]


# -- loops that only pass checkpoints


async def noop() -> None:
    pass


async def forever(wait: Callable[[], Any]) -> None:
    while True:
        await wait()


async def lock() -> None:
    async with using("arm"):
        pass


PASSES: dict[str, Callable[[], Any]] = {
    "checkpoint": checkpoint,
    "sleep of no time": partial(sleep, 0),
    "wait_for what is true": lambda: wait_for(Fluent(True)),
    "par of nothing": par,
    "seq of nothing": seq,
    "par": partial(par, noop),
    "pursue": partial(pursue, noop, partial(sleep, 1)),
    "using": lock,
    "a timeout of nothing": partial(timeout, 1, noop),
}


@pytest.mark.parametrize("name", PASSES)
def test_a_loop_that_only_passes_checkpoints_makes_no_progress(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.kernel.event_loop.MAX_RESUMPTIONS", 500)
    with pytest.raises(NoProgress, match=r"forever|noop|test_bad_plans"):
        go(partial(par, partial(forever, PASSES[name]), partial(sleep, 1)))


def test_a_loop_of_calls_in_threads_makes_no_progress_in_simulation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.kernel.event_loop.MAX_RESUMPTIONS", 50)
    with pytest.raises(NoProgress):
        go(partial(forever, partial(in_thread, int)))


def test_a_loop_that_joins_what_is_dead_makes_no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.kernel.event_loop.MAX_RESUMPTIONS", 500)

    async def plan() -> None:
        await tag("done", noop)
        while True:
            await join(task("done"))

    with pytest.raises(NoProgress):
        go(plan)


def test_two_tasks_that_wake_each_other_without_end_make_no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.kernel.event_loop.MAX_RESUMPTIONS", 500)
    left, right = Fluent(True, "left"), Fluent(False, "right")

    async def play(mine: Fluent[bool], other: Fluent[bool]) -> None:
        while True:
            await wait_for(mine)
            mine.set(False)
            other.set(True)

    with pytest.raises(NoProgress, match=r"ping|pong"):
        go(partial(par, ping=partial(play, left, right), pong=partial(play, right, left)))


def test_values_without_end_in_one_step_make_no_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("planlang.kernel.event_loop.MAX_RESUMPTIONS", 500)

    async def body(value: int) -> None:
        pass

    with pytest.raises(NoProgress):
        go(partial(par_each, itertools.count(), body, limit=2))


def test_whenever_goes_on_in_the_next_step_so_a_body_without_waits_is_no_endless_step() -> None:
    calls: list[int] = []

    async def body() -> Any:
        calls.append(1)
        return Return("done") if len(calls) == 5 else None

    assert go(partial(whenever, Fluent(True), body)) == "done"


# -- process modules


def broken(belief: Belief, action: Action) -> Any:
    """Return what a process module with a mistake does."""
    return belief.what_is_not_there  # type: ignore[attr-defined]


def test_a_programming_error_of_a_process_module_ends_the_plan_as_itself_and_names_module_and_action() -> None:
    log: list[str] = []

    async def other() -> None:
        try:
            await sleep(9)
        finally:
            log.append("cleaned")

    cook = partial(perform, action("Cooking"))
    recovered = partial(with_failure_handling, cook, Recovery(PlanFailure, retries=3))
    executive = ScriptedExecutive(Script().on("Cooking", does=broken))
    with pytest.raises(AttributeError, match="what_is_not_there") as caught:
        go(partial(par, other, partial(try_all, recovered, other)), executive=executive)
    assert caught.value.__notes__ == ["raised by process module rule of Cooking, performing Cooking()"]
    assert log == ["cleaned", "cleaned"]


# -- recursion without end


async def endless_by_await() -> None:
    await endless_by_await()


async def endless_by_par() -> None:
    await par(noop, endless_by_par)


async def endless_by_pursue_and_timeout() -> None:
    await timeout(10, partial(pursue, endless_by_pursue_and_timeout))


async def endless_by_seq() -> None:
    await seq(endless_by_seq)


@pytest.mark.parametrize("endless", [endless_by_await, endless_by_seq])
def test_recursion_without_end_by_await_is_an_error_that_names_the_function_and_line(endless: Any) -> None:
    log: list[str] = []

    async def other() -> None:
        try:
            await sleep(1)
        finally:
            log.append("cleaned")

    with pytest.raises(RecursionError) as caught:
        go(partial(par, other, endless))
    (note,) = caught.value.__notes__
    assert f"recursion without end: {endless.__name__} at test_bad_plans.py:" in note
    assert log == ["cleaned"]


@pytest.mark.parametrize("endless", some([endless_by_par, endless_by_pursue_and_timeout]))
def test_recursion_without_end_by_constructs_is_an_error_that_names_the_functions(endless: Any) -> None:
    with pytest.raises(PlanStructureError, match=f"10000 nested.*: {endless.__name__} at test_bad_plans"):
        go(endless)


def test_recursion_in_a_cleanup_ends_too() -> None:
    with pytest.raises((RecursionError, PlanStructureError)):
        go(partial(pursue, partial(unwind_protect, partial(sleep, 9), endless_by_await), partial(sleep, 1)))
