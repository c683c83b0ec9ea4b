"""Facts of CRAM's own tests of task trees, K1-K11, and the rules of suspension by count."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import BranchEvaporated, Timeout


def test_k1_a_parent_that_ends_leaves_evaporated_children() -> None:
    async def body() -> tuple[Status, Status]:
        child = task("child")

        async def parent() -> None:
            await pursue(partial(tag, "child", partial(sleep, 10)), partial(sleep, 1))

        parent_handle = task("parent")
        await tag("parent", parent)
        return parent_handle.status.value, child.status.value

    assert go(body) == (Status.SUCCEEDED, Status.EVAPORATED)


async def parent_and_child() -> None:
    await tag("child", partial(sleep, 1))


def test_k2_to_k4_suspending_the_parent_suspends_the_child_and_waking_it_wakes_the_child() -> None:
    seen: list[Status] = []

    async def body() -> float:
        child, parent = task("child"), task("parent")

        async def control() -> None:
            await sleep(0.5)
            suspend(parent)
            seen.append(child.status.value)
            await sleep(2)
            seen.append(child.status.value)
            wake_up(parent)
            seen.append(child.status.value)

        await par(partial(tag, "parent", parent_and_child), control)
        return now()

    assert go(body) == 3.0
    assert seen == [Status.SUSPENDED, Status.SUSPENDED, Status.RUNNING]


def test_k5_waking_a_child_under_a_suspended_parent_only_lowers_its_count() -> None:
    seen: list[Status] = []

    async def body() -> None:
        child, parent = task("child"), task("parent")

        async def control() -> None:
            await sleep(0.1)
            suspend(child)
            suspend(parent)
            assert wake_up(child)
            assert not wake_up(child)
            seen.append(child.status.value)
            wake_up(parent)
            seen.append(child.status.value)

        await par(partial(tag, "parent", parent_and_child), control)

    go(body)
    assert seen == [Status.SUSPENDED, Status.RUNNING]


def test_k6_a_child_suspended_itself_stays_so_when_its_parent_wakes_up() -> None:
    seen: list[Status] = []

    async def body() -> None:
        child, parent = task("child"), task("parent")

        async def control() -> None:
            await sleep(0.1)
            suspend(child)
            suspend(parent)
            wake_up(parent)
            seen.append(child.status.value)
            wake_up(child)
            seen.append(child.status.value)

        await par(partial(tag, "parent", parent_and_child), control)

    go(body)
    assert seen == [Status.SUSPENDED, Status.RUNNING]


def test_k7_evaporating_the_parent_evaporates_the_child() -> None:
    async def body() -> tuple[Status, Status]:
        child, parent = task("child"), task("parent")

        async def control() -> None:
            await sleep(0.1)
            evaporate(parent)

        await par(partial(try_all, partial(tag, "parent", parent_and_child), partial(sleep, 1)), control)
        return parent.status.value, child.status.value

    assert go(body) == (Status.EVAPORATED, Status.EVAPORATED)


def test_k8_a_failing_parent_leaves_evaporated_children() -> None:
    async def body() -> tuple[Status, Status]:
        child, parent = task("child"), task("parent")

        async def fails() -> None:
            await sleep(0.5)
            raise PlanFailure("no")

        async def of_parent() -> None:
            await par(parent_and_child, fails)

        with pytest.raises(PlanFailure):
            await tag("parent", of_parent)
        return parent.status.value, child.status.value

    assert go(body) == (Status.FAILED, Status.EVAPORATED)


def test_k9_suspension_is_counted() -> None:
    async def body() -> float:
        handle = task("child")

        async def control() -> None:
            await sleep(0.5)
            suspend(handle)
            suspend(handle)
            await sleep(1)
            wake_up(handle)
            assert handle.status.value is Status.SUSPENDED
            await sleep(1)
            wake_up(handle)

        await par(parent_and_child, control)
        return now()

    assert go(body) == 3.0


def test_k10_a_task_suspended_before_it_exists_begins_held() -> None:
    log: list[float] = []

    async def body() -> None:
        handle = task("late")
        suspend(handle)

        async def late() -> None:
            log.append(now())

        async def control() -> None:
            await sleep(2)
            wake_up(handle)

        await par(partial(tag, "late", late), control)

    go(body)
    assert log == [2.0]


def test_k11_suspending_waking_and_evaporating_dead_tasks_changes_nothing() -> None:
    async def body() -> list[bool]:
        handle = task("done")
        await tag("done", partial(sleep, 0.1))
        return [suspend(handle), wake_up(handle), evaporate(handle)]

    assert go(body) == [False, False, False]


def test_a_task_cannot_suspend_itself_or_what_waits_for_it() -> None:
    async def body() -> None:
        outer = task("outer")

        async def inner() -> None:
            with pytest.raises(PlanStructureError, match="cannot suspend itself"):
                suspend(outer)
            with pytest.raises(PlanStructureError, match="cannot suspend itself"):
                suspend(task("inner"))

        await tag("outer", partial(tag, "inner", inner))

    go(body)


def test_timers_and_timeouts_of_held_tasks_stand_still() -> None:
    ticks: list[tuple[str, float]] = []

    async def ticker(name: str) -> None:
        for _ in range(4):
            await sleep(0.25)
            ticks.append((name, now()))

    async def body() -> None:
        handle = task("worker")

        async def worker() -> None:
            await timeout(1.5, partial(par, partial(ticker, "a"), partial(ticker, "b")))

        async def control() -> None:
            await sleep(0.6)
            async with task_suspended(handle):
                await sleep(2)

        await par(partial(tag, "worker", worker), control)

    go(body)
    assert [time for name, time in ticks if name == "a"] == [0.25, 0.5, 2.75, 3.0]


def test_a_timeout_still_strikes_after_the_suspension() -> None:
    async def body() -> float:
        handle = task("worker")

        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(handle):
                await sleep(2)

        with pytest.raises(Timeout):
            await par(partial(tag, "worker", partial(timeout, 1, partial(sleep, 10))), control)
        return now()

    assert go(body) == 3.0


def test_evaporating_a_held_task_clears_the_counts_and_runs_only_its_cleanup() -> None:
    log: list[str] = []

    async def body() -> None:
        handle = task("worker")
        ready = Fluent(False)

        async def worker() -> None:
            try:
                await wait_for(ready)
                log.append("code after the wait")
            finally:
                log.append("cleanup")

        async def cleanup() -> None:
            await sleep(0.5)
            log.append("shielded cleanup")

        async def control() -> None:
            await sleep(0.1)
            suspend(handle)
            ready.set(True)
            await sleep(1)
            evaporate(handle)
            suspend(handle)
            await sleep(1)
            log.append("later")

        tagged = partial(tag, "worker", partial(unwind_protect, worker, cleanup))
        await par(partial(try_all, tagged, partial(sleep, 5)), control)

    go(body)
    assert log == ["cleanup", "shielded cleanup", "later"]


def test_hooks_of_suspension_are_called_children_first_inner_first_once() -> None:
    log: list[str] = []

    async def child() -> None:
        async with on_suspension(lambda: log.append("child")):
            await sleep(1)

    async def parent() -> None:
        async with (
            on_suspension(lambda: log.append("parent, outer")),
            on_suspension(lambda: log.append("parent, inner")),
        ):
            await par(child, partial(sleep, 1))

    async def body() -> None:
        handle = task("parent")

        async def control() -> None:
            await sleep(0.1)
            suspend(handle)
            suspend(handle)
            wake_up(handle)
            wake_up(handle)

        await par(partial(tag, "parent", parent), control)

    go(body)
    assert log == ["child", "parent, inner", "parent, outer"]


def test_retry_after_suspension_evaporates_the_body_and_runs_it_from_the_start() -> None:
    log: list[tuple[str, float]] = []

    async def drive() -> str:
        log.append(("begun", now()))
        try:
            await sleep(1)
        finally:
            log.append(("stopped", now()))
        return "arrived"

    async def body() -> str:
        handle = task("driver")

        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(handle):
                await sleep(2)

        results = await par(partial(tag, "driver", partial(retry_after_suspension, drive)), control)
        return results[0]

    assert go(body) == "arrived"
    assert log == [("begun", 0.0), ("stopped", 0.5), ("begun", 2.5), ("stopped", 3.5)]


def test_two_live_tags_of_one_name_in_one_plan_are_refused() -> None:
    async def body() -> None:
        await par(partial(tag, "same", partial(sleep, 1)), partial(tag, "same", partial(sleep, 1)))

    with pytest.raises(PlanStructureError, match="same"):
        go(body)


def test_a_later_tag_of_the_same_name_rebinds_the_handle() -> None:
    paths: list[str | None] = []

    async def body() -> None:
        handle = task("again")
        for _ in range(2):
            await tag("again", partial(sleep, 1))
            paths.append(handle.path)

    go(body)
    assert paths == ["body/again", "body/again#2"]


def test_a_tag_is_found_from_an_inner_plan_and_names_of_different_plans_do_not_clash() -> None:
    seen: list[Any] = []

    @plan
    async def inner() -> None:
        await tag("own", partial(sleep, 0.1))
        seen.append(task("outer").status.value)
        seen.append(task("own").path)

    async def body() -> None:
        await par(partial(tag, "outer", partial(sleep, 1)), inner, partial(tag, "own", partial(sleep, 1)))
        seen.append(task("own").path)

    go(body)
    assert seen == [Status.RUNNING, "body/par/inner/own", "body/par/tag#2/own"]


def test_join_returns_the_result_or_raises_the_failure() -> None:
    async def fails() -> None:
        raise PlanFailure("as itself")

    async def gives() -> int:
        await sleep(1)
        return 5

    async def body() -> Any:
        handle = task("gives")
        return await par(partial(tag, "gives", gives), partial(join, handle))

    assert go(body) == (5, 5)

    async def failing() -> None:
        handle = task("fails")
        with pytest.raises(PlanFailure):
            await tag("fails", fails)
        with pytest.raises(PlanFailure, match="as itself"):
            await join(handle)

    go(failing)


def test_joining_an_evaporated_task_raises_branch_evaporated() -> None:
    async def body() -> None:
        handle = task("gone")

        async def control() -> None:
            await sleep(0.5)
            evaporate(handle)

        async def joins() -> None:
            with pytest.raises(BranchEvaporated):
                await join(handle)

        tagged = partial(tag, "gone", partial(sleep, 5))
        await par(partial(try_all, tagged, partial(sleep, 1)), control, joins)

    go(body)


def test_a_handle_shows_the_live_children_by_path() -> None:
    seen: list[Any] = []

    async def body() -> None:
        handle = task("tree")

        async def look() -> None:
            await sleep(0.1)
            seen.extend((child.path, child.status.value) for child in handle.children)
            inner: Handle = handle.children[0]
            suspend(inner)
            again = handle.children[0]  # a second handle of the same task
            seen.append((inner.status.value, again.status.value))
            wake_up(inner)
            seen.append((inner.status.value, again.status.value))

        tree = partial(par, first=partial(sleep, 1), second=partial(sleep, 1))
        await par(partial(tag, "tree", tree), look)

    go(body)
    assert seen == [
        ("body/par/tag/tree/par/first", Status.RUNNING),
        ("body/par/tag/tree/par/second", Status.RUNNING),
        (Status.SUSPENDED, Status.SUSPENDED),
        (Status.RUNNING, Status.RUNNING),
    ]


def test_the_status_of_a_task_can_be_waited_for() -> None:
    async def body() -> float:
        handle = task("worker")
        await par(
            partial(tag, "worker", partial(sleep, 2)),
            lambda: wait_for(handle.status == Status.SUCCEEDED),
        )
        return now()

    assert go(body) == 2.0
