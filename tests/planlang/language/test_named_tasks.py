"""Tasks by their names: which one a name stands for, and what may be done to it before and after it has run."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import BranchEvaporated


def test_a_name_asked_for_in_an_inner_plan_before_it_has_run_stands_for_the_outer_plans_task() -> None:
    @plan
    async def watcher() -> float:
        handle = task("drive")
        assert (handle.path, handle.status.value) == (None, Status.CREATED)
        await join(handle)
        assert handle.path == "body/par/later/drive"
        return now()

    async def later() -> None:
        await sleep(1)
        await tag("drive", partial(sleep, 2))

    async def body() -> float:
        return (await par(watcher, later))[0]

    assert go(body) == 3


def test_of_two_plans_that_tag_the_same_name_the_nearest_enclosing_one_is_meant() -> None:
    seen: list[str | None] = []

    @plan
    async def inner() -> None:
        async def look() -> None:
            await sleep(0.1)
            seen.append(task("same").path)

        await par(partial(tag, "same", partial(sleep, 1)), look)

    async def body() -> None:
        await par(partial(tag, "same", partial(sleep, 1)), inner)
        seen.append(task("same").path)

    go(body)
    assert seen == ["body/par/inner/par/tag/same", "body/par/tag/same"]


def test_a_handle_bound_to_an_outer_task_is_rebound_by_the_inner_plans_own_tag() -> None:
    @plan
    async def inner() -> tuple[str | None, str | None]:
        handle = task("same")
        await sleep(1)
        before = handle.path
        await tag("same", partial(sleep, 0.1))
        return before, handle.path

    async def body() -> Any:
        async def later() -> None:
            await sleep(0.5)
            await tag("same", partial(sleep, 5))

        return (await par(inner, later))[0]

    assert go(body) == ("body/par/later/same", "body/par/inner/same")


def test_all_who_asked_see_the_status_of_the_task() -> None:
    @plan
    async def watcher() -> float:
        await join(task("drive"))
        return now()

    async def body() -> Any:
        async def later() -> None:
            await sleep(1)
            await tag("drive", partial(sleep, 1))

        own = task("drive")
        return [*(await par(watcher, watcher, later, lambda: join(own)))[:2], own.status.value]

    assert go(body) == [2, 2, Status.SUCCEEDED]


def test_suspending_a_task_that_nobody_has_tagged_yet_holds_it_from_its_beginning() -> None:
    @plan
    async def controller() -> None:
        handle = task("drive")
        suspend(handle)
        await sleep(3)
        wake_up(handle)

    async def body() -> float:
        async def later() -> None:
            await sleep(1)
            await tag("drive", partial(sleep, 0))

        await par(controller, later)
        return now()

    assert go(body) == 3


def test_a_task_evaporated_before_it_is_tagged_never_begins() -> None:
    begun: list[str] = []

    async def drive() -> None:
        begun.append("drive")

    async def body() -> Status:
        handle = task("drive")
        assert evaporate(handle)
        assert not evaporate(handle)
        assert not suspend(handle)
        with pytest.raises(BranchEvaporated):
            await tag("drive", drive)
        return handle.status.value

    assert go(body) is Status.EVAPORATED
    assert begun == []


def test_what_an_ended_plan_asked_for_is_forgotten() -> None:
    @plan
    async def asks() -> Handle:
        return task("later")

    async def body() -> str | None:
        handle = await asks()
        await tag("later", partial(sleep, 0))
        return handle.path

    assert go(body) is None


def test_join_raises_the_programming_error_of_the_task() -> None:
    async def broken() -> None:
        await sleep(1)
        raise KeyError("broken")

    seen: list[str] = []

    async def body() -> None:
        async def joins() -> None:
            try:
                await join(task("broken"))
            except KeyError:
                seen.append("key error")
                raise

        await par(partial(tag, "broken", broken), joins)

    with pytest.raises(KeyError, match="broken"):
        go(body)


def test_task_suspended_wakes_only_what_it_has_suspended() -> None:
    async def body() -> float:
        handle = task("worker")

        async def worker() -> None:
            for _ in range(2):
                await try_all(partial(tag, "worker", partial(sleep, 1)), partial(sleep, 5))

        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(handle):
                await sleep(1)
                evaporate(handle)
            await sleep(6)

        await par(worker, control)
        return now()

    assert go(body) == 7.5


def test_two_live_tags_of_one_name_are_refused_with_the_right_form() -> None:
    async def body() -> None:
        await par(partial(tag, "same", partial(sleep, 1)), partial(tag, "same", partial(sleep, 1)))

    with pytest.raises(PlanStructureError, match=r"tagged 'same'(.|\n)*wrong(.|\n)*right.*same 2"):
        go(body)


def test_a_tag_is_named_by_a_string() -> None:
    with pytest.raises(TypeError, match="name of tag has to be a string"):
        go(partial(tag, 3, partial(sleep, 1)))
    with pytest.raises(TypeError, match="body of tag"):
        go(partial(tag, partial(sleep, 1), "name"))


async def stop() -> None:
    """Not a plain function."""


@pytest.mark.parametrize("called", [False, True])
def test_on_suspension_takes_a_plain_function(called: bool) -> None:
    async def body() -> None:
        wrong: Any = stop() if called else stop
        async with on_suspension(wrong):
            pass

    with pytest.raises(TypeError, match=r"plain function(.|\n)*wrong(.|\n)*right"):
        go(body)


def test_a_task_is_asked_for_in_a_plan_only() -> None:
    with pytest.raises(PlanStructureError, match="no plan is running"):
        task("drive")


def test_a_handle_and_a_plan_tell_what_they_are() -> None:
    @plan
    async def named() -> None: ...

    async def body() -> list[str]:
        handle = task("drive")
        before = repr(handle)
        assert handle.children == ()
        assert not wake_up(handle)
        await tag("drive", partial(sleep, 0))
        return [before, repr(handle), repr(named)]

    assert go(body) == ["<task drive, created>", "<task body/drive, succeeded>", "<plan named>"]


def test_a_deadlock_tells_for_the_end_of_which_task_a_join_waits() -> None:
    async def body() -> None:
        await join(task("never"))

    with pytest.raises(DeadlockError, match=r"body waits for the end of task 'never' at test_named_tasks\.py"):
        run(body, host=VirtualHost())


def test_a_deadlock_tells_of_a_task_that_was_suspended_before_it_began() -> None:
    async def body() -> None:
        suspend(task("held"))
        await par(partial(tag, "held", partial(sleep, 1)), lambda: join(task("held")))

    with pytest.raises(DeadlockError) as caught:
        run(body, host=VirtualHost())
    assert "  body/par/tag/held is suspended" in str(caught.value)
    assert "waits for the end of task 'held'" in str(caught.value)


def test_a_handle_asked_for_inside_stays_with_the_live_task_of_its_plan() -> None:
    seen: list[str | None] = []

    @plan
    async def inner() -> None:
        handle = task("work")
        await par(partial(tag, "work", partial(sleep, 1)), look)
        seen.append(handle.path)

    async def look() -> None:
        await sleep(0.5)

    async def outer_tag() -> None:
        await sleep(0.25)
        await tag("work", partial(sleep, 0.1))

    @plan
    async def top() -> None:
        await par(inner, outer_tag)

    go(top)
    assert seen == ["top/par/inner/par/tag/work"]
