"""Misuse: each error shows the wrong and the right code."""

from __future__ import annotations

import asyncio
import functools
import threading
from functools import partial
from typing import Any

import pytest

import planlang
from planlang import (
    PlanFailure,
    PlanStructureError,
    Policy,
    Recovery,
    VirtualHost,
    action,
    checkpoint,
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
from planlang.kernel.errors import contrast


def go(body: Any, **options: Any) -> Any:
    return run(body, host=VirtualHost(), **options)


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
    ("name", "call"),
    [
        ("par", lambda: par(reach, reach())),
        ("seq", lambda: seq(reach())),
        ("pursue", lambda: pursue(reach())),
        ("race", lambda: race(only=reach())),
        ("try_all", lambda: try_all(reach())),
        ("try_in_order", lambda: try_in_order(reach())),
        ("par_each", lambda: par_each([1], reach())),
        ("partial_order", lambda: partial_order({"a": reach()}, [])),
        ("timeout", lambda: timeout(1, reach())),
        ("tag", lambda: tag("a", reach())),
        ("unwind_protect", lambda: unwind_protect(reach, reach())),
        ("with_failure_handling", lambda: with_failure_handling(reach())),
    ],
)
def test_a_called_coroutine_is_refused_and_closed(name: str, call: Any) -> None:
    with pytest.raises(TypeError) as caught:
        go(call)
    assert str(caught.value) == (
        f"you called reach(); pass reach or partial(reach, ...) to {name}\n"
        f"  wrong: await {name}(reach())\n"
        f"  right: await {name}(reach)    or    await {name}(partial(reach, ...))"
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
        TypeError, match=r"par takes branches.*not 'reached'" + shows("await par(await reach(cup))", "")
    ):
        go(body)


def test_called_coroutines_in_policies_and_recoveries_are_refused() -> None:
    with pytest.raises(TypeError, match=r"you called reach\(\).* to policy 'a'"):
        Policy("a", None, reach())  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"you called reach\(\).* to Recovery"):
        Recovery(PlanFailure, reach())  # type: ignore[arg-type]


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
    with pytest.raises(TypeError, match="monitor takes a request"):
        go(functools.partial(monitor, "x"))
