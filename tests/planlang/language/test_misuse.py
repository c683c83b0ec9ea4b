"""Misuse: each error shows the wrong and the right code."""

from __future__ import annotations

import asyncio
import functools
import threading
from functools import partial
from typing import Any

import pytest
from virtual_time import go

import planlang
from planlang import (
    PlanFailure,
    PlanStructureError,
    Policy,
    Recovery,
    VirtualHost,
    achieve,
    action,
    an_object,
    checkpoint,
    holding,
    monitor,
    par,
    par_each,
    partial_order,
    perform,
    plan,
    pursue,
    race,
    run,
    seq,
    sleep,
    tag,
    timeout,
    try_all,
    try_in_order,
    unwind_protect,
    wait_for,
    with_failure_handling,
)
from planlang.misuse import contrast
from planlang.testing import explore, run_plan


async def reach() -> str:
    await sleep(1)
    return "reached"


@plan
async def serve(*, cup: str = "a") -> None:
    await sleep(1)


def shows(wrong: str, right: str) -> str:
    """A pattern for the two lines of an error."""
    import re

    return f"(.|\n)*wrong: {re.escape(wrong)}\n  right: {re.escape(right)}"


def test_an_error_shows_wrong_and_right_code_on_lines_of_their_own() -> None:
    assert contrast("no", "a()", "await a()") == "no\n  wrong: a()\n  right: await a()"


# -- a called coroutine where a callable is meant


@pytest.mark.parametrize(
    ("call", "wrong"),
    [
        (lambda: par(reach, reach()), "await par(reach())"),
        (lambda: seq(reach()), "await seq(reach())"),
        (lambda: pursue(reach()), "await pursue(reach())"),
        (lambda: race(only=reach()), "await race(reach())"),
        (lambda: try_all(reach()), "await try_all(reach())"),
        (lambda: try_in_order(reach()), "await try_in_order(reach())"),
        (lambda: par_each([1], reach()), "await par_each(cups, reach())"),
        (lambda: partial_order({"a": reach()}, []), 'await partial_order({\'a\': reach()}, [("look", "grasp")])'),
        (lambda: timeout(1, reach()), "await timeout(2, reach())"),
        (lambda: tag("a", reach()), 'await tag("reach", reach())'),
        (lambda: unwind_protect(reach, reach()), "await unwind_protect(reach, reach())"),
        (lambda: with_failure_handling(reach()), "await with_failure_handling(reach(), Recovery(GraspMissed))"),
        (lambda: achieve(holding(an_object("Cup")), reach()), "await achieve(holding(cup), reach())"),
        (lambda: run(reach(), host=VirtualHost()), "run(reach(), host=VirtualHost())"),
        (lambda: run_plan(reach()), "run_plan(reach())"),
        (lambda: explore(reach()), "explore(reach())"),
        (lambda: Policy("p", None, reach()), 'Policy("keep away", init=reach())'),
        (lambda: Recovery(PlanFailure, reach()), "Recovery(GraspMissed, reach())"),
    ],
)
def test_a_called_coroutine_is_refused_and_closed_and_shown_in_a_whole_call(call: Any, wrong: str) -> None:
    with pytest.raises(PlanStructureError) as caught:
        go(call)
    assert isinstance(caught.value, TypeError)
    name = wrong.removeprefix("await ").partition("(")[0]
    right = f"{wrong.replace('reach()', 'reach')}    or    {wrong.replace('reach()', 'partial(reach, ...)')}"
    assert str(caught.value) == (
        f"you called reach(); pass reach or partial(reach, ...) to {name}\n  wrong: {wrong}\n  right: {right}"
    )


def test_a_called_plan_is_named_by_the_plan() -> None:
    with pytest.raises(TypeError, match=r"you called serve\(\); pass serve or partial\(serve, \.\.\.\) to par"):
        go(lambda: par(serve(cup="b")))


def test_a_called_coroutine_given_to_run_is_refused() -> None:
    with pytest.raises(TypeError, match=r"you called reach\(\); pass reach"):
        go(reach())


def test_a_result_where_a_branch_is_meant_is_refused_with_the_right_form() -> None:
    async def body() -> None:
        await par(await reach())  # type: ignore[arg-type]

    with pytest.raises(
        TypeError, match=r"has to be a branch, .*, not 'reached'" + shows("await par('reached')", "await par(reach)")
    ):
        go(body)


def test_a_plain_function_as_branch_is_refused_with_the_right_form() -> None:
    def plain() -> int:
        return 3

    with pytest.raises(TypeError, match=r"plain returned int" + shows("def plain(): ...", "async def plain(): ...")):
        go(partial(par, plain))


@pytest.mark.parametrize("construct", [par, seq, pursue, race, try_all, try_in_order])
@pytest.mark.parametrize("word", ["name", "limit"])
def test_reserved_words_do_not_name_branches(construct: Any, word: str) -> None:
    with pytest.raises(TypeError, match=f"'{word}' is reserved(.|\n)*wrong(.|\n)*right: .*the_{word}=reach"):
        go(partial(construct, **{word: reach}))


# -- a construct outside a plan


@pytest.mark.parametrize(
    "call",
    [
        partial(par, reach),
        partial(sleep, 1),
        partial(wait_for, planlang.Fluent(False)),
        partial(timeout, 1, reach),
        partial(seq, reach),
        partial(with_failure_handling, reach),
        serve,
        partial(perform, action("Reaching")),
        checkpoint,
    ],
)
def test_a_construct_outside_a_plan_says_how_to_run_one(call: Any) -> None:
    with pytest.raises(PlanStructureError) as caught:
        asyncio.run(call())
    assert "wrong: " in str(caught.value)
    assert "run(" in str(caught.value).splitlines()[-1]


def test_a_construct_in_a_thread_of_its_own_is_outside_the_plan() -> None:
    caught: list[BaseException] = []

    def thread() -> None:
        try:
            planlang.rng()
        except PlanStructureError as error:
            caught.append(error)

    async def body() -> None:
        one = threading.Thread(target=thread)
        one.start()
        one.join()

    go(body)
    assert "in its thread" in str(caught[0])


# -- a foreign awaitable


def test_asyncios_sleep_zero_is_refused_at_its_line_with_the_right_form() -> None:
    async def body() -> None:
        await asyncio.sleep(0)

    with pytest.raises(TypeError, match=r"another event loop" + shows("await asyncio.sleep(1)", "await sleep(1)")):
        go(body)


def test_what_needs_asyncios_loop_fails_with_a_note_about_plans() -> None:
    async def body() -> None:
        await asyncio.sleep(1)

    with pytest.raises(RuntimeError) as caught:
        go(partial(par, body))
    assert any("right: await sleep(1)" in note for note in caught.value.__notes__)


def test_a_future_of_another_loop_is_refused_at_its_line() -> None:
    loop = asyncio.new_event_loop()

    async def body() -> None:
        await loop.create_future()

    try:
        with pytest.raises(TypeError, match=r"awaits \S*Future at test_misuse\.py:\d+"):
            go(body)
    finally:
        loop.close()


def test_monitoring_what_is_no_request_is_refused() -> None:
    with pytest.raises(TypeError, match="request of monitor has to be a request"):
        go(functools.partial(monitor, "x"))


async def look() -> None: ...


@pytest.mark.parametrize(
    ("call", "right"),
    [
        (lambda: par([reach, look]), "await par(*[reach, look])"),
        (lambda: seq((reach, look)), "await seq(*(reach, look))"),
        (lambda: pursue({"arm": reach}), "await pursue(**{'arm': reach})"),
        (lambda: race([reach(), look()]), "await race(*[reach, look])"),
        (lambda: try_in_order([partial(reach)]), "await try_in_order(*[partial(...)])"),
    ],
)
def test_branches_in_a_list_are_refused_with_the_list_unpacked(call: Any, right: str) -> None:
    with pytest.raises(TypeError, match="takes branches one by one, not in a") as caught:
        go(call)
    wrong = right.replace("**", "").replace("*", "")
    assert str(caught.value).splitlines()[1:] in (
        [f"  wrong: {wrong}", f"  right: {right}"],
        [f"  wrong: {wrong.replace('reach', 'reach()').replace('look', 'look()')}", f"  right: {right}"],
    )
