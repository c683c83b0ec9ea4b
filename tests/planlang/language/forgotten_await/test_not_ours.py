"""What other threads, strangers and the time before the run do with coroutines is their own matter."""

from __future__ import annotations

import asyncio
import queue
import threading
import warnings
import weakref
from typing import Any

import pytest
from written_plan import WrittenPlan

from planlang import PlanStructureError, VirtualHost, run, sleep
from planlang.failures import GraspMissed
from planlang.kernel import forgotten


def go(body: Any, **options: Any) -> Any:
    return run(body, host=VirtualHost(), **options)


async def reach() -> str:
    await sleep(1)
    return "reached"


def test_a_run_beside_another_in_a_thread_leaves_alone_what_may_be_the_others() -> None:
    held: list[Any] = []
    inside, leave = threading.Event(), threading.Event()

    async def waits() -> None:
        inside.set()
        leave.wait(10)

    async def holds() -> str:
        held.append(reach())
        return "done"

    async def fails_holding() -> None:
        held.append(reach())
        raise GraspMissed

    other = threading.Thread(target=lambda: go(waits))
    other.start()
    inside.wait(10)
    try:
        assert go(holds) == "done"
        with pytest.raises(GraspMissed):
            go(fails_holding)
    finally:
        leave.set()
        other.join()
    for one in held:
        one.close()


@pytest.mark.parametrize("fails", [False, True])
@pytest.mark.parametrize("how", ["queue", "loop", "running"])
def test_what_was_handed_to_another_thread_is_awaited_there_after_the_run(how: str, fails: bool) -> None:
    ran: list[str] = []
    ended, taken = threading.Event(), threading.Event()
    waiting: queue.Queue[Any] = queue.Queue()

    async def work() -> None:
        ran.append(how)

    def works() -> None:
        if how == "queue":
            ended.wait(10)
        coroutine = waiting.get()
        taken.set()
        ended.wait(10)
        asyncio.run(coroutine)

    loop = asyncio.new_event_loop()

    async def body() -> str:
        if how == "loop":
            asyncio.run_coroutine_threadsafe(work(), loop)
        else:
            waiting.put(work())
        if how == "running":
            taken.wait(10)
        if fails:
            raise GraspMissed
        return "done"

    other = threading.Thread(target=works if how != "loop" else lambda: None)
    other.start()
    if fails:
        with pytest.raises(GraspMissed):
            go(body)
    else:
        assert go(body) == "done"
    ended.set()
    other.join()
    loop.call_soon(loop.stop)
    loop.run_forever()
    loop.run_until_complete(asyncio.sleep(0))
    loop.close()
    assert ran == [how]


def test_what_was_made_before_the_run_is_pythons_own_matter() -> None:
    early = [reach()]

    async def body() -> str:
        early.clear()
        await sleep(1)
        return "done"

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert go(body) == "done"
    assert [str(one.message) for one in caught] == ["coroutine 'reach' was never awaited"]


def test_what_was_made_before_the_run_hides_nothing_that_the_run_forgets() -> None:
    early = [reach() for _ in range(50)]

    async def body() -> None:
        while early:
            early.pop().close()
        reach()
        await sleep(1)

    with pytest.raises(PlanStructureError, match="without await"):
        go(body)


def test_coroutines_of_strangers_are_left_alone() -> None:
    space: dict[str, Any] = {}
    exec("async def foreign(): pass\ndef make(f): return f()", space)
    held: list[Any] = []

    async def body() -> str:
        held.append(space["make"](space["foreign"]))
        return "done"

    async def fails() -> None:
        held.append(space["make"](space["foreign"]))
        raise GraspMissed

    assert go(body) == "done"
    with pytest.raises(GraspMissed):
        go(fails)
    for one in held:
        assert one.cr_frame is not None
        one.close()


def test_without_the_interpreters_hook_nothing_is_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forgotten._Watch, "warn", None)
    monkeypatch.delattr(warnings, "_warn_unawaited_coroutine")
    forgotten.watch()
    assert not hasattr(warnings, "_warn_unawaited_coroutine")
    coroutine = reach()
    forgotten._dropped(coroutine)
    coroutine.close()


def test_dead_proxies_among_the_objects_of_a_process_do_no_harm() -> None:
    class Thing:
        pass

    thing = Thing()
    proxy = weakref.proxy(thing)
    del thing

    async def body() -> int:
        await sleep(1)
        return 3

    assert go(body) == 3
    assert type(proxy) is weakref.ProxyType


def test_a_search_for_which_the_stack_has_no_room_prints_nothing(
    monkeypatch: pytest.MonkeyPatch, written: WrittenPlan
) -> None:
    def no_more(*_: object) -> None:
        raise RecursionError

    monkeypatch.setattr(forgotten, "suspects", no_more)
    assert written("reach()\nawait sleep(1)") is None
