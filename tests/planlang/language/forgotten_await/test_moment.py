"""A forgotten await ends the task or the run at its next checkpoint, with the line that made the coroutine."""

from __future__ import annotations

import gc
import subprocess
import sys
import warnings
from functools import partial
from typing import Any

import pytest
from written_plan import WrittenPlan, shows

import planlang
from planlang import PlanStructureError, VirtualHost, checkpoint, now, par, plan, run, seq, sleep, try_all, wait_for
from planlang.failures import GraspMissed


def go(body: Any, **options: Any) -> Any:
    return run(body, host=VirtualHost(), **options)


async def reach() -> str:
    await sleep(1)
    return "reached"


@plan
async def serve(*, cup: str = "a") -> None:
    await sleep(1)


def test_a_forgotten_await_is_an_error_at_the_next_checkpoint_with_its_line() -> None:
    times: list[float] = []

    async def body() -> None:
        await sleep(1)
        sleep(5)  # the mistake
        times.append(now())
        await sleep(1)
        times.append(now())

    with pytest.raises(PlanStructureError, match=r"test_moment\.py:\d+ calls sleep\(\) without await") as caught:
        go(body)
    assert "  wrong: sleep(5)  # the mistake\n  right: await sleep(5)  # the mistake" in str(caught.value)
    assert times == [1.0]


def test_a_forgotten_await_of_a_plan_function_is_named_by_the_plan() -> None:
    async def body() -> None:
        serve(cup="b")
        await sleep(1)

    with pytest.raises(PlanStructureError, match=shows('serve(cup="b")', 'await serve(cup="b")')):
        go(body)


def test_a_forgotten_await_of_a_name_in_a_module_is_shown_as_a_whole() -> None:
    async def body() -> None:
        planlang.par(reach, reach)
        await sleep(1)

    with pytest.raises(
        PlanStructureError, match=shows("planlang.par(reach, reach)", "await planlang.par(reach, reach)")
    ):
        go(body)


def test_a_forgotten_await_at_the_end_of_a_branch_is_an_error_too() -> None:
    async def body() -> None:
        await sleep(1)
        sleep(1)

    with pytest.raises(PlanStructureError, match=shows("sleep(1)", "await sleep(1)")):
        go(partial(par, body, partial(sleep, 9)))


def test_a_forgotten_await_before_a_failure_beats_the_failure() -> None:
    async def body() -> None:
        reach()
        raise GraspMissed

    with pytest.raises(PlanStructureError, match="reach"):
        go(partial(try_all, body, partial(sleep, 9)))


def test_a_forgotten_await_in_a_branch_evaporates_the_others() -> None:
    log: list[str] = []

    async def forgets() -> None:
        await sleep(1)
        reach()
        await checkpoint()
        log.append("went on")

    async def other() -> None:
        try:
            await sleep(9)
        finally:
            log.append(f"stopped {now():g}")

    with pytest.raises(PlanStructureError):
        go(partial(par, forgets, other))
    assert log == ["stopped 1"]


def test_every_checkpoint_raises_what_was_forgotten_before_it() -> None:
    fluent = planlang.Fluent(True)
    for waits in (checkpoint, partial(sleep, 0), partial(wait_for, fluent), partial(par, reach), partial(seq)):

        async def body(waits: Any = waits) -> None:
            reach()
            await waits()
            raise AssertionError

        with pytest.raises(PlanStructureError, match=r"without await"):
            go(body)


def test_outside_of_plans_python_warns_as_ever() -> None:
    go(reach)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        reach()
        gc.collect()
    assert [str(one.message) for one in caught] == ["coroutine 'reach' was never awaited"]


def test_a_coroutine_that_is_closed_is_not_forgotten() -> None:
    async def body() -> str:
        reach().close()
        await sleep(1)
        return "done"

    assert go(body) == "done"


def test_a_coroutine_kept_and_awaited_later_is_not_forgotten() -> None:
    async def body() -> str:
        later = reach()
        await sleep(1)
        return await later

    assert go(body) == "reached"


def test_returning_a_call_instead_of_its_result_is_an_error() -> None:
    async def body() -> Any:
        return reach()

    with pytest.raises(PlanStructureError, match=shows("return reach(...)", "return await reach(...)")):
        go(partial(par, body))


def test_a_forgotten_await_prints_nothing_and_leaves_nothing_unclosed() -> None:
    code = (
        "from planlang import *\n"
        "async def body():\n    sleep(1)\n    await sleep(1)\n"
        "try:\n    run(body, host=VirtualHost())\nexcept PlanStructureError as error:\n    print(type(error))\n"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert (ended.stdout, ended.stderr) == ("<class 'planlang.misuse.PlanStructureError'>\n", "")


def test_the_second_of_two_mistakes_is_not_printed_either(written: WrittenPlan) -> None:
    with pytest.raises(PlanStructureError, match=shows("reach('b')", "await reach('b')")):
        written("reach('b')\nreach('c')\nawait sleep(1)")


def test_what_survived_a_collection_of_garbage_is_found_too(written: WrittenPlan) -> None:
    with pytest.raises(PlanStructureError, match=shows("HELD.append(sleep(5))", "HELD.append(await sleep(5))")):
        written("HELD.append(sleep(5))\ngc.collect(0)")
