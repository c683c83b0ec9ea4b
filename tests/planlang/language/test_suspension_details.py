"""Suspension, its hooks and what starts over: the promises that CRAM's own tests do not reach."""

from __future__ import annotations

from contextlib import suppress
from contextvars import ContextVar
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import BudgetExceeded

word: ContextVar[str] = ContextVar("word", default="nobody's")


def test_a_hook_is_called_at_once_by_the_suspender_in_the_context_of_the_task() -> None:
    seen: list[tuple[str, float]] = []

    async def worker() -> None:
        word.set("the worker's")
        async with on_suspension(lambda: seen.append((word.get(), now()))):
            await sleep(1)

    async def body() -> None:
        async def control() -> None:
            word.set("the suspender's")
            await sleep(0.5)
            suspend(task("worker"))
            assert seen == [("the worker's", 0.5)]
            assert word.get() == "the suspender's"
            wake_up(task("worker"))

        await par(partial(tag, "worker", worker), control)

    go(body)
    assert len(seen) == 1


def test_a_hook_is_called_once_per_transition_and_not_after_its_block() -> None:
    seen: list[float] = []

    async def worker() -> None:
        async with on_suspension(lambda: seen.append(now())):
            await sleep(1)
        await sleep(1)

    async def body() -> None:
        async def control() -> None:
            handle = task("worker")
            for _ in range(2):  # inside the block
                await sleep(0.25)
                async with task_suspended(handle), task_suspended(handle):
                    pass
            await sleep(1)  # after it
            async with task_suspended(handle):
                pass

        await par(partial(tag, "worker", worker), control)

    go(body)
    assert seen == [0.25, 0.5]


def test_hooks_of_a_child_held_already_are_not_called_when_its_parent_is_suspended() -> None:
    seen: list[str] = []

    async def child() -> None:
        async with on_suspension(lambda: seen.append("child")):
            await sleep(1)

    async def parent() -> None:
        async with on_suspension(lambda: seen.append("parent")):
            await tag("child", child)

    async def body() -> None:
        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(task("child")), task_suspended(task("parent")):
                await sleep(1)

        await par(partial(tag, "parent", parent), control)

    go(body)
    assert seen == ["child", "parent"]


@pytest.mark.parametrize("how", ["failure", "evaporation", "success"])
def test_task_suspended_wakes_up_however_its_block_ends(how: str) -> None:
    async def body() -> float:
        handle = task("worker")

        async def control() -> None:
            async with task_suspended(handle):
                await sleep(1)
                if how == "failure":
                    raise PlanFailure
                if how == "evaporation":
                    await sleep(9)

        async def controller() -> None:
            with suppress(PlanFailure):
                await pursue(control, partial(sleep, 2))

        await par(partial(tag, "worker", partial(sleep, 1)), controller)
        return now()

    assert go(body) == (3 if how == "evaporation" else 2)


def test_retry_after_suspension_waits_for_the_cleanup_even_if_it_outlasts_the_suspension() -> None:
    log: list[str] = []

    async def drive() -> None:
        log.append(f"begins {now():g}")
        await sleep(1)

    async def brake() -> None:
        await sleep(2)
        log.append(f"stopped {now():g}")

    async def body() -> None:
        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(task("driver")):
                await sleep(0.5)

        driver = partial(retry_after_suspension, partial(unwind_protect, drive, brake))
        await par(partial(tag, "driver", driver), control)

    go(body)
    assert log == ["begins 0", "stopped 2.5", "begins 2.5", "stopped 5.5"]


def test_retry_after_suspension_starts_over_as_often_as_it_is_suspended() -> None:
    begun: list[float] = []

    async def drive() -> str:
        begun.append(now())
        await sleep(1)
        return "arrived"

    async def body() -> str:
        async def control() -> None:
            for _ in range(3):
                await sleep(0.5)
                async with task_suspended(task("driver")):
                    await sleep(1)

        return str((await par(partial(tag, "driver", partial(retry_after_suspension, drive)), control))[0])

    assert go(body) == "arrived"
    assert begun == [0, 1.5, 3, 4.5]


def test_evaporated_while_held_what_starts_over_does_not_start_again() -> None:
    begun: list[float] = []

    async def drive() -> None:
        begun.append(now())
        await sleep(1)

    async def body() -> float:
        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(task("driver")):
                await sleep(1)
                evaporate(task("driver"))

        tagged = partial(tag, "driver", partial(retry_after_suspension, drive))
        await par(partial(try_all, tagged, partial(sleep, 5)), control)
        return now()

    assert go(body) == 5
    assert begun == [0]


def test_the_time_of_a_budget_stands_still_while_suspended() -> None:
    async def body() -> float:
        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(task("worker")):
                await sleep(3)

        with pytest.raises(BudgetExceeded):
            await par(partial(tag, "worker", partial(budget, partial(sleep, 9), seconds=1)), control)
        return now()

    assert go(body) == 4


def test_a_handle_shows_that_its_task_is_evaporating() -> None:
    seen: list[Status] = []

    async def body() -> None:
        handle = task("worker")
        guarded = partial(unwind_protect, partial(sleep, 9), partial(sleep, 1))

        async def control() -> None:
            seen.append(handle.status.value)
            await sleep(0.5)
            seen.append(handle.status.value)
            assert evaporate(handle)
            seen.append(handle.status.value)
            assert not evaporate(handle)
            assert not suspend(handle)
            assert not wake_up(handle)
            await sleep(2)
            seen.append(handle.status.value)

        await par(control, partial(try_all, partial(tag, "worker", guarded), partial(sleep, 5)))

    go(body)
    assert seen == [Status.CREATED, Status.RUNNING, Status.EVAPORATING, Status.EVAPORATED]


def test_a_value_set_while_held_is_latched_only_if_it_is_still_true_after_waking_up() -> None:
    for back, expected in ((False, None), (True, True)):
        fluent = Fluent(False)

        async def body(fluent: Fluent[bool] = fluent, back: bool = back) -> Any:
            async def control() -> None:
                async with task_suspended(task("waits")):
                    await sleep(1)
                    fluent.set(True)
                    fluent.set(back)
                    await sleep(1)

            return (await par(partial(tag, "waits", partial(wait_for, fluent, 3)), control))[0]

        assert go(body) is expected


def test_a_held_whenever_runs_its_body_after_waking_up() -> None:
    fluent = Fluent(0)

    async def body() -> Any:
        async def once() -> Return[float]:
            return Return(now())

        async def control() -> None:
            async with task_suspended(task("whenever")):
                await sleep(1)
                fluent.set(1)
                await sleep(1)

        return (await par(partial(tag, "whenever", partial(whenever, fluent, once)), control))[0]

    assert go(body) == 2


def test_a_suspended_holder_of_a_resource_keeps_it() -> None:
    async def user(start: float) -> float:
        await sleep(start)
        async with using("arm"):
            began = now()
            await sleep(1)
        return began

    async def body() -> list[Any]:
        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(task("first")):
                await sleep(2)

        return await par(partial(tag, "first", partial(user, 0)), partial(user, 0.1), control)

    assert go(body)[:2] == (0, 3)


class Refused(PlanFailure):
    """The error that a hook raises."""


def refuse() -> None:
    raise Refused


def test_a_hook_that_fails_leaves_nothing_suspended_and_the_others_are_called() -> None:
    stopped: list[str] = []

    async def worker() -> str:
        async with on_suspension(lambda: stopped.append("arm")), on_suspension(refuse):
            await sleep(2)
        return f"done at {now():g}"

    async def control() -> None:
        await sleep(1)
        with pytest.raises(Refused):
            suspend(task("worker"))
        with pytest.raises(Refused):
            async with task_suspended(task("worker")):
                raise AssertionError("the block does not begin")

    assert go(lambda: par(partial(tag, "worker", worker), control)) == ("done at 2", None)
    assert stopped == ["arm", "arm"]


@pytest.mark.parametrize("begins", ["before the block", "in the block", "not again", "in the block and not again"])
def test_task_suspended_wakes_what_it_has_suspended_and_only_that(begins: str) -> None:
    async def worker() -> float:
        await sleep(3)
        return now()

    async def workers() -> float:
        if begins.startswith("in the block"):
            await sleep(0.6)
        with suppress(PlanFailure):  # the block evaporates it
            return await tag("worker", worker)
        return await tag("worker", worker)

    async def control() -> None:
        await sleep(0.5)
        async with task_suspended(task("worker")):
            if begins.endswith("not again"):
                await sleep(1)
                return
            await sleep(0.5)
            evaporate(task("worker"))
            await sleep(0.5)
            suspend(task("worker"))  # the second one, at 1.5 s
        await sleep(7.5)
        wake_up(task("worker"))

    ended, _ = go(lambda: par(workers, control))
    times = {"not again": 4.0, "in the block and not again": 4.5}  # it stands still until the block ends, at 1.5 s
    assert ended == times.get(begins, 11.5)
