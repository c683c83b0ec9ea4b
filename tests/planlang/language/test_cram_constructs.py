"""Facts of CRAM's own tests of the language, L1-L32; where we decide differently, the name of the test says what."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import CompositeFailure, GraspMissed, ObjectNotFound

Plan = Callable[[], Awaitable[Any]]


async def fails(after: float = 0.0, what: str = "failed") -> None:
    await sleep(after)
    raise PlanFailure(what)


async def returns(value: Any, after: float = 0.0) -> Any:
    await sleep(after)
    return value


def test_l1_a_top_level_plan_returns_the_value_of_its_body() -> None:
    assert go(partial(returns, 17)) == 17


def test_l2_both_branches_of_par_run() -> None:
    log: list[int] = []

    async def note(number: int) -> None:
        log.append(number)

    go(partial(par, partial(note, 1), partial(note, 2)))
    assert log == [1, 2]


def test_l3_two_branches_play_ping_pong_through_a_fluent() -> None:
    ball = Fluent("ping")
    log: list[str] = []

    async def player(mine: str, other: str) -> None:
        for _ in range(5):
            await wait_for(ball == mine)
            log.append(mine)
            ball.set(other)

    go(partial(par, partial(player, "ping", "pong"), partial(player, "pong", "ping")))
    assert log == ["ping", "pong"] * 5


def test_l4_a_failing_branch_keeps_the_other_from_its_effect_and_the_caller_catches_the_failure() -> None:
    log: list[str] = []

    async def slow() -> None:
        await sleep(1)
        log.append("effect")

    async def plan() -> float:
        with pytest.raises(PlanFailure, match="failed"):
            await par(partial(fails, 0.01), slow)
        return now()

    assert go(plan) < 0.1
    assert log == []


def test_l5_failing_the_producer_evaporates_all_workers_at_both_levels() -> None:
    log: list[str] = []
    handle_states: list[Status] = []

    async def worker(name: str) -> None:
        try:
            await wait_for(Fluent(False))
        finally:
            log.append(name)

    async def workers() -> None:
        await par(partial(worker, "inner 1"), partial(worker, "inner 2"))

    async def plan() -> None:
        with pytest.raises(PlanFailure):
            await par(partial(fails, 0.1), partial(worker, "outer"), partial(tag, "workers", workers))
        handle_states.append(task("workers").status.value)

    go(plan)
    assert log == ["outer", "inner 1", "inner 2"]
    assert handle_states == [Status.EVAPORATED]


def test_l6_five_tagged_forms_in_seq_run_in_order() -> None:
    log: list[int] = []

    async def note(number: int) -> int:
        log.append(number)
        return number

    assert go(lambda: seq(*[partial(tag, f"t{n}", partial(note, n)) for n in range(5)])) == (0, 1, 2, 3, 4)
    assert log == [0, 1, 2, 3, 4]


def test_l7_a_task_is_suspended_inside_task_suspended_and_runs_after_it() -> None:
    seen: list[Status] = []

    async def plan() -> None:
        handle = task("worker")

        async def watcher() -> None:
            await sleep(0.1)
            async with task_suspended(handle):
                seen.append(handle.status.value)
                await sleep(5)
                seen.append(handle.status.value)
            seen.append(handle.status.value)

        await par(partial(tag, "worker", partial(sleep, 1)), watcher)
        assert now() == pytest.approx(6.0)

    go(plan)
    assert seen == [Status.SUSPENDED, Status.SUSPENDED, Status.RUNNING]


def test_l8_a_branch_whose_fluent_was_set_during_the_suspension_wins_after_wake_up() -> None:
    async def plan() -> Any:
        ready = Fluent(False)
        handle = task("tree")

        async def first() -> str:
            await wait_for(ready)
            return "first"

        async def tree() -> str:
            return await pursue(first, partial(returns, "second", 10))

        async def watcher() -> None:
            await sleep(0.1)
            async with task_suspended(handle):
                ready.set(True)
                await sleep(20)

        return (await par(partial(tag, "tree", tree), watcher))[0]

    assert go(plan) == "first"


def test_l9_waiting_leaves_under_one_suspended_tag_do_not_proceed_although_the_fluent_is_true() -> None:
    log: list[str] = []

    async def plan() -> None:
        ready = Fluent(False)
        handle = task("tree")

        async def leaf() -> None:
            await wait_for(ready)
            log.append("leaf")

        async def tree() -> None:
            await par(partial(par, leaf, leaf), partial(par, leaf, partial(par, leaf, leaf)))

        async def watcher() -> None:
            await sleep(0.1)
            async with task_suspended(handle):
                ready.set(True)
                await sleep(1)
                log.append("woken up")

        await par(partial(tag, "tree", tree), watcher)

    go(plan)
    assert log == ["woken up"] + ["leaf"] * 5


def test_l10_on_suspension_runs_and_the_task_stays_held_as_long_as_the_body_of_the_suspender_lasts() -> None:
    log: list[Any] = []

    async def plan() -> None:
        handle = task("worker")

        async def worker() -> None:
            async with on_suspension(lambda: log.append(("stopped", now()))):
                await sleep(1)
            log.append(("done", now()))

        async def watcher() -> None:
            await sleep(0.5)
            async with task_suspended(handle):
                await sleep(2)

        await par(partial(tag, "worker", worker), watcher)

    go(plan)
    assert log == [("stopped", 0.5), ("done", 3.0)]


def test_l11_when_the_second_branch_of_pursue_succeeds_the_first_has_no_effect() -> None:
    log: list[str] = []

    async def slow() -> None:
        await sleep(1)
        log.append("effect")

    assert go(partial(pursue, slow, partial(returns, "second", 0.1))) == "second"
    assert log == []


def test_l12_when_the_second_branch_of_pursue_fails_the_failure_propagates() -> None:
    log: list[str] = []

    async def slow() -> None:
        await sleep(1)
        log.append("effect")

    with pytest.raises(PlanFailure, match="failed"):
        go(partial(pursue, slow, partial(fails, 0.1)))
    assert log == []


def nested(plan: Plan, depth: int) -> Plan:
    """The plan inside ``depth`` constructs."""
    for _ in range(depth):
        plan = partial(par, plan)
    return plan


@pytest.mark.parametrize("schedule", [None, 0, 1, 2, 3])
@pytest.mark.parametrize("success_depth", [0, 1, 3])
@pytest.mark.parametrize("failure_depth", [0, 1, 3])
def test_l13_failure_beats_a_simultaneous_success_in_any_nesting_and_schedule(
    schedule: int | None, success_depth: int, failure_depth: int
) -> None:
    log: list[str] = []

    async def third() -> None:
        try:
            await sleep(10)
        finally:
            log.append("evaporated")

    with pytest.raises(PlanFailure, match="failed"):
        go(
            partial(
                pursue,
                nested(partial(returns, 1, 0.5), success_depth),
                nested(partial(fails, 0.5), failure_depth),
                third,
            ),
            schedule=schedule,
        )
    assert log == ["evaporated"]


def test_l14_a_failure_is_caught_by_its_class() -> None:
    async def plan() -> str:
        try:
            await seq(partial(par, partial(par, misses)))
        except GraspMissed as failure:
            return str(failure)
        return "nothing"

    async def misses() -> None:
        raise GraspMissed("closed on air")

    assert go(plan) == "closed on air"


def test_l15_a_handler_for_one_kind_does_not_catch_another() -> None:
    async def misses() -> None:
        raise GraspMissed

    async def plan() -> None:
        try:
            await par(partial(par, misses))
        except ObjectNotFound:
            pytest.fail("this handler is for another failure")

    with pytest.raises(GraspMissed):
        go(plan)


def test_l16_a_handler_for_an_ancestor_catches_across_two_task_levels() -> None:
    async def misses() -> None:
        raise GraspMissed

    async def plan() -> str:
        try:
            await par(partial(par, misses))
        except PlanFailure as failure:
            return type(failure).__name__
        return "nothing"

    assert go(plan) == "GraspMissed"


def test_l17_an_unhandled_programming_error_in_a_doubly_nested_par_reaches_the_caller_as_itself() -> None:
    error = ZeroDivisionError("mine")

    async def wrong() -> None:
        raise error

    with pytest.raises(ZeroDivisionError) as caught:
        go(partial(par, partial(par, wrong)))
    assert caught.value is error


def test_l18_no_construct_catches_a_programming_error_and_it_beats_failures_of_the_same_round() -> None:
    async def wrong() -> None:
        raise ZeroDivisionError

    async def fine() -> None: ...

    for construct in (par, pursue, try_all, try_in_order):
        with pytest.raises(ZeroDivisionError):
            go(partial(construct, wrong, partial(fails), fine))
    with pytest.raises(ZeroDivisionError):
        go(partial(par, fails_at_once, wrong))


async def fails_at_once() -> None:
    raise PlanFailure("at once")


def test_l19_try_all_succeeds_with_the_first_success_even_after_failures() -> None:
    assert go(partial(try_all, fails, partial(returns, "late", 1), partial(returns, "later", 2))) == "late"


def test_l20_try_all_fails_when_all_fail_with_the_failures_in_textual_order() -> None:
    with pytest.raises(CompositeFailure) as caught:
        go(lambda: try_all(partial(fails, 0.3, "a"), second=partial(fails, 0.1, "b"), third=partial(fails, 0.2, "c")))
    assert [str(failure) for failure in caught.value.failures] == ["a", "b", "c"]
    assert caught.value.names == ("fails", "second", "third")


def test_l21_try_in_order_tries_one_after_another_and_code_after_a_failure_does_not_run() -> None:
    log: list[str] = []

    async def form(name: str, good: bool) -> str:
        log.append(name)
        if not good:
            raise PlanFailure(name)
        return name

    assert (
        go(lambda: try_in_order(partial(form, "a", False), partial(form, "b", True), partial(form, "c", True))) == "b"
    )
    assert log == ["a", "b"]


def test_l22_try_in_order_fails_when_all_fail_in_order() -> None:
    with pytest.raises(CompositeFailure) as caught:
        go(lambda: try_in_order(partial(fails, 0, "a"), partial(fails, 0, "b")))
    assert [str(failure) for failure in caught.value.failures] == ["a", "b"]


def test_l23_to_l25_try_each_in_order_returns_the_first_value_that_works_or_fails_with_all() -> None:
    async def even(number: int) -> int:
        if number % 2:
            raise PlanFailure(f"{number} is odd")
        return number * 10

    assert go(partial(try_each_in_order, [1, 3, 4, 6], even)) == 40
    with pytest.raises(CompositeFailure) as caught:
        go(partial(try_each_in_order, [1, 3], even))
    assert [str(failure) for failure in caught.value.failures] == ["1 is odd", "3 is odd"]
    with pytest.raises(CompositeFailure) as nothing:
        go(partial(try_each_in_order, [], even))
    assert nothing.value.failures == ()


def test_l26_a_construct_decides_once_for_all_branches_that_died_together() -> None:
    with pytest.raises(PlanFailure, match="a") as caught:
        go(lambda: par(a=partial(fails, 0.5, "a"), b=partial(fails, 0.5, "b"), c=partial(fails, 0.6, "c")))
    assert [(name, str(failure)) for name, failure in caught.value.siblings] == [("b", "b")]


@pytest.mark.parametrize(
    ("orderings", "expected"),
    [
        ([("2", "1")], ["2", "3", "1"]),
        ([("1", "3"), ("3", "2")], ["1", "3", "2"]),
        ([("2", "1"), ("3", "1")], ["2", "3", "1"]),
    ],
    ids=["one ordering", "a chain", "two predecessors"],
)
def test_l27_to_l29_partial_order_respects_its_orderings(orderings: Any, expected: list[str]) -> None:
    log: list[str] = []

    async def step(name: str) -> None:
        log.append(name)

    go(lambda: partial_order({name: partial(step, name) for name in "123"}, orderings))
    assert log == expected


def test_l30_a_cycle_is_refused_by_name_before_anything_starts() -> None:
    async def never() -> None:
        pytest.fail("nothing may start")

    steps = {"free": never, "a": never, "b": never, "c": never}
    with pytest.raises(ValueError, match=r"cycle in orderings: (a < b < c < a|b < c < a < b|c < a < b < c)"):
        go(lambda: partial_order(steps, [("a", "b"), ("b", "c"), ("c", "a")]))
    with pytest.raises(ValueError, match="a < a"):
        go(lambda: partial_order(steps, [("a", "a")]))


def test_l31_suspend_wake_up_and_evaporate_a_waiting_task_in_turn() -> None:
    seen: list[Status] = []

    async def plan() -> None:
        handle = task("waits")

        async def control() -> None:
            await sleep(0.1)
            seen.append(handle.status.value)
            assert suspend(handle)
            seen.append(handle.status.value)
            assert wake_up(handle)
            seen.append(handle.status.value)
            assert evaporate(handle)
            seen.append(handle.status.value)
            assert not evaporate(handle)
            await sleep(0.1)
            seen.append(handle.status.value)

        await par(partial(try_all, partial(tag, "waits", partial(wait_for, Fluent(False))), partial(sleep, 1)), control)

    go(plan)
    assert seen == [Status.RUNNING, Status.SUSPENDED, Status.RUNNING, Status.EVAPORATING, Status.EVAPORATED]


def test_l32_a_failure_triggered_during_the_suspension_propagates_after_wake_up() -> None:
    async def plan() -> float:
        broken = Fluent(False)
        handle = task("worker")

        async def worker() -> None:
            await wait_for(broken)
            raise GraspMissed

        async def watcher() -> None:
            async with task_suspended(handle):
                broken.set(True)
                await sleep(3)
            await sleep(1)

        with pytest.raises(GraspMissed):
            await par(partial(tag, "worker", worker), watcher)
        return now()

    assert go(plan) == 3.0
