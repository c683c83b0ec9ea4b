"""Evaporation: delivered at checkpoints until the task ends, children first, kept away by shields."""

from __future__ import annotations

import warnings
from contextlib import suppress
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import (
    CleanupOverrun,
    Evaporated,
    Fluent,
    PlanFailure,
    checkpoint,
    now,
    par,
    pursue,
    shield,
    sleep,
    tag,
    task,
    timeout,
    try_all,
    unwind_protect,
    wait_for,
)
from planlang import evaporate as evaporate_task
from planlang.failures import Timeout
from planlang.kernel import CutShort


def test_a_task_that_swallows_evaporation_gets_it_again_at_the_next_checkpoint() -> None:
    log: list[str] = []

    async def stubborn() -> None:
        for number in range(3):
            try:
                await sleep(10)
            except Evaporated:
                log.append(f"swallowed {number}")
        log.append("ended")

    with pytest.warns(CutShort, match="unwind_protect"):
        go(partial(pursue, stubborn, partial(sleep, 1)))
    assert log == ["swallowed 0", "swallowed 1", "swallowed 2", "ended"]


def test_a_swallowed_evaporation_comes_again_at_a_bare_checkpoint_before_anybody_else_runs() -> None:
    log: list[str] = []

    async def stubborn(name: str) -> None:
        with suppress(Evaporated):
            await sleep(9)
        log.append(f"{name} swallowed")
        try:
            await checkpoint()
        finally:
            log.append(f"{name} was told again")

    with pytest.warns(CutShort):
        go(partial(pursue, partial(stubborn, "a"), partial(stubborn, "b"), partial(sleep, 1)))
    assert log == ["a swallowed", "a was told again", "b swallowed", "b was told again"]


def test_a_task_into_which_evaporation_was_thrown_ends_evaporated_whatever_it_returns() -> None:
    async def returns_anyway() -> str:
        with suppress(Evaporated):
            await sleep(10)
        return "too late"

    async def plan() -> tuple[str, Any]:
        handle = task("late")
        await pursue(partial(tag, "late", returns_anyway), partial(sleep, 1))
        return handle.status.value.value, handle.result

    assert go(plan) == ("evaporated", None)


def test_a_task_that_ended_before_delivery_keeps_its_outcome() -> None:
    async def plan() -> tuple[str, str]:
        handle = task("quick")

        async def quick() -> str:
            await checkpoint()
            return "done"

        async def evaporates() -> None:
            await sleep(1)
            evaporate_task(handle)

        await par(partial(tag, "quick", quick), evaporates)
        return handle.status.value.value, handle.result

    assert go(plan) == ("succeeded", "done")


def test_children_are_evaporated_before_their_parents() -> None:
    log: list[str] = []

    async def leaf(name: str) -> None:
        try:
            await sleep(10)
        finally:
            log.append(name)

    async def inner() -> None:
        try:
            await par(partial(leaf, "one"), partial(leaf, "two"))
        finally:
            log.append("inner")

    go(partial(pursue, inner, partial(sleep, 0.1)))
    assert log == ["one", "two", "inner"]


def test_a_construct_returns_only_after_the_cleanup_of_its_branches() -> None:
    log: list[tuple[str, float]] = []

    async def retract() -> None:
        await sleep(0.5)
        log.append(("retracted", now()))

    async def winner() -> str:
        await sleep(0.25)
        return "won"

    async def plan() -> None:
        log.append((await pursue(winner, partial(unwind_protect, partial(sleep, 10), retract)), now()))

    go(plan)
    assert log == [("retracted", 0.75), ("won", 0.75)]


def test_an_evaporated_created_task_never_starts() -> None:
    async def fails() -> None:
        raise PlanFailure("at once")

    async def never() -> None:
        pytest.fail("this branch must not start")

    async def late() -> None:
        await checkpoint()

    async def plan() -> None:
        handle = task("never")
        evaporate_task(handle)
        await tag("never", never)

    from planlang.failures import BranchEvaporated

    with pytest.raises(BranchEvaporated, match="never"):
        go(plan)


def test_a_value_that_has_arrived_is_returned_and_evaporation_comes_at_the_next_checkpoint() -> None:
    log: list[Any] = []

    async def plan() -> None:
        fluent = Fluent(0)
        handle = task("waiter")

        async def waits() -> None:
            log.append(await wait_for(fluent))
            await checkpoint()
            log.append("not reached")

        async def sets_and_evaporates() -> None:
            await sleep(1)
            fluent.set(7)
            evaporate_task(handle)

        await par(partial(try_all, partial(tag, "waiter", waits), partial(sleep, 5)), sets_and_evaporates)

    go(plan)
    assert log == [7]


def test_a_shield_keeps_evaporation_away_until_it_ends() -> None:
    log: list[Any] = []

    async def body() -> None:
        with shield():
            await par(partial(sleep, 2), partial(sleep, 3))
            log.append(now())
        await checkpoint()
        log.append("not reached")

    go(partial(pursue, body, partial(sleep, 1)))
    assert log == [3.0]


def test_evaporation_from_inside_a_shield_works_as_usual() -> None:
    async def body() -> float:
        with shield():
            await pursue(partial(sleep, 1), partial(sleep, 9))
            return now()

    assert go(body) == 1.0


def test_shields_nest() -> None:
    log: list[float] = []

    async def body() -> None:
        with shield():
            with shield():
                await sleep(2)
            await sleep(1)
            log.append(now())

    go(partial(pursue, body, partial(sleep, 1)))
    assert log == [3.0]


def test_a_cleanup_that_overruns_its_bound_is_a_programming_error_with_its_line() -> None:
    async def cleanup() -> None:
        await sleep(60)

    async def plan() -> None:
        try:
            await pursue(partial(unwind_protect, partial(sleep, 10), cleanup, within=2), partial(sleep, 1))
        finally:
            assert now() == 3.0

    with pytest.raises(CleanupOverrun, match=r"2 s at test_cancel.py:\d+"):
        go(plan)


def test_of_nested_shields_that_overrun_together_one_error_is_raised_and_cleanup_goes_on() -> None:
    log: list[float] = []

    async def inner() -> None:
        with shield(within=1):
            await sleep(5)

    async def clean_up() -> None:
        await sleep(2)
        log.append(now())

    async def outer() -> None:
        with shield(within=1):
            await unwind_protect(inner, clean_up)

    with pytest.raises(CleanupOverrun):
        go(outer)
    assert log == [3.0]


def test_the_error_of_a_second_shield_that_overruns_in_the_step_of_the_first_does_not_cut_the_cleanup_short() -> None:
    log: list[float] = []

    async def clean_up() -> None:
        await sleep(2)
        log.append(now())

    async def outer() -> None:
        with shield(within=1), shield(within=1):
            await unwind_protect(partial(sleep, 5), clean_up)

    with pytest.raises(CleanupOverrun):
        go(outer)
    assert log == [3.0]


def test_an_overrun_evaporates_what_the_cleanup_started() -> None:
    log: list[str] = []

    async def part() -> None:
        try:
            await sleep(60)
        finally:
            log.append("part ended")

    async def plan() -> None:
        try:
            with shield(within=1):
                await par(part, part)
        except CleanupOverrun:
            log.append("overrun")
            await sleep(1)

    go(plan)
    assert log == ["part ended", "part ended", "overrun"]


def test_an_unshielded_await_in_a_finally_is_a_warning_with_its_line() -> None:
    async def forgetful() -> None:
        try:
            await sleep(10)
        finally:
            await sleep(1)

    with pytest.warns(CutShort) as caught:
        go(partial(pursue, forgetful, partial(sleep, 1)))
    assert caught[0].filename == __file__


def test_a_failure_in_the_cleanup_of_an_evaporated_branch_is_attached_to_what_is_raised() -> None:
    async def fails() -> None:
        await sleep(1)
        raise PlanFailure("first")

    async def cleanup() -> None:
        raise PlanFailure("in cleanup")

    with pytest.raises(PlanFailure, match="first") as caught:
        go(partial(par, fails, partial(unwind_protect, partial(sleep, 10), cleanup)))
    assert [str(failure) for failure in caught.value.cleanup_failures] == ["in cleanup"]
    (note,) = caught.value.__notes__
    assert note.startswith("during cleanup: PlanFailure: in cleanup in ")
    assert "(test_cancel.py:" in note


def test_a_failure_in_the_cleanup_of_an_evaporated_branch_is_a_note_on_a_programming_error() -> None:
    async def breaks() -> None:
        await sleep(1)
        raise ZeroDivisionError

    async def cleanup() -> None:
        raise PlanFailure("in cleanup")

    with pytest.raises(ZeroDivisionError) as caught:
        go(partial(par, breaks, partial(unwind_protect, partial(sleep, 10), cleanup)))
    assert ["during cleanup: PlanFailure: in cleanup" in note for note in caught.value.__notes__] == [True]


def test_a_programming_error_in_a_cleanup_comes_before_any_value() -> None:
    async def cleanup() -> None:
        raise ZeroDivisionError("in cleanup")

    with pytest.raises(ZeroDivisionError):
        go(partial(pursue, partial(sleep, 1), partial(unwind_protect, partial(sleep, 10), cleanup)))


def test_a_programming_error_in_a_cleanup_deep_below_passes_through_evaporated_parents() -> None:
    async def cleanup() -> None:
        raise ZeroDivisionError("deep")

    async def inner() -> None:
        await par(partial(unwind_protect, partial(sleep, 10), cleanup), partial(sleep, 10))

    with pytest.raises(ZeroDivisionError):
        go(partial(pursue, partial(par, partial(par, inner)), partial(sleep, 1)))


def test_cleanup_after_success_failure_and_evaporation() -> None:
    log: list[str] = []

    async def cleanup() -> None:
        await sleep(0.1)
        log.append("clean")

    async def fails() -> None:
        raise PlanFailure("no")

    async def plan() -> None:
        await unwind_protect(partial(sleep, 1), cleanup)
        with pytest.raises(PlanFailure):
            await unwind_protect(fails, cleanup)
        with pytest.raises(Timeout):
            await timeout(1, partial(unwind_protect, partial(sleep, 10), cleanup))

    go(plan)
    assert log == ["clean"] * 3


def test_raising_evaporated_by_hand_is_refused() -> None:
    from planlang import PlanStructureError

    async def plan() -> None:
        raise Evaporated

    with pytest.raises(PlanStructureError, match="evaporate its handle"):
        go(partial(par, plan))


@pytest.mark.long
def test_evaporating_ten_thousand_nested_constructs_works() -> None:
    async def nest(depth: int) -> None:
        if depth:
            await par(partial(nest, depth - 1))
        else:
            await sleep(10)

    with pytest.raises(Timeout):
        go(partial(timeout, 1, partial(nest, 9_900)))


def test_nothing_is_warned_about_when_cleanup_is_shielded() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        go(partial(pursue, partial(unwind_protect, partial(sleep, 10), partial(sleep, 1)), partial(sleep, 1)))


@pytest.mark.parametrize("depth", [0, 1, 2, 5])
def test_failures_of_cleanups_at_any_depth_are_attached_to_what_is_raised(depth: int) -> None:
    async def failing_cleanup() -> None:
        raise PlanFailure("the retract failed")

    body: Any = partial(unwind_protect, partial(sleep, 9), failing_cleanup)
    for _ in range(depth):
        body = partial(par, body, partial(sleep, 9))
    with pytest.raises(Timeout) as caught:
        go(partial(timeout, 1, body))
    assert [str(failure) for failure in caught.value.cleanup_failures] == ["the retract failed"]


def test_failures_of_cleanups_of_a_construct_that_is_broken_off_are_attached_to_what_breaks_it_off() -> None:
    async def failing_cleanup() -> None:
        raise PlanFailure("the retract failed")

    async def too_long() -> None:
        with shield(within=1):
            await par(partial(unwind_protect, partial(sleep, 9), failing_cleanup))

    with pytest.raises(CleanupOverrun) as caught:
        go(too_long)
    assert any("the retract failed" in note for note in caught.value.__notes__)
