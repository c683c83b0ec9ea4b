"""Misuse shows the wrong and the right code, and nothing that a plan may be written with is refused."""

from __future__ import annotations

import asyncio
import collections
import contextlib
import functools
import threading
import types
from collections.abc import Awaitable, Callable, Iterator
from decimal import Decimal
from enum import Enum, StrEnum
from fractions import Fraction
from functools import partial
from typing import Any, TypeVar
from unittest.mock import AsyncMock

import numpy as np
import pytest
from virtual_time import go

import planlang
from planlang import *
from planlang.failures import GoalNotAchieved, GraspMissed
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


ASYNCIO = shows(
    "await asyncio.sleep(1)    or await fetch()",
    "await sleep(1)    or, for an async function of asyncio, await in_thread(fetch)",
)


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
    with pytest.raises(TypeError, match=f"'{word}' (.|\n)*wrong(.|\n)*right: .*the_{word}=reach"):
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
    assert "no plan is running in this thread" in str(caught[0])


# -- a foreign awaitable


def test_asyncios_sleep_zero_is_refused_at_its_line_with_the_right_form() -> None:
    async def body() -> None:
        await asyncio.sleep(0)

    with pytest.raises(TypeError, match=r"another event loop" + ASYNCIO):
        go(body)


@pytest.mark.parametrize(
    "body", [lambda: asyncio.sleep(1), lambda: asyncio.Queue().get(), lambda: asyncio.to_thread(abs, -1)]
)
def test_asyncio_code_without_its_event_loop_says_how_it_runs_in_a_plan(body: Any) -> None:
    with pytest.raises(PlanStructureError, match=r"asyncio code needs an asyncio event loop" + ASYNCIO):
        go(partial(par, body))


def test_other_errors_in_plans_and_of_asyncio_stay_what_they_are() -> None:
    async def missing() -> None:
        raise AttributeError("no such pose")

    async def inside() -> None:
        asyncio.run(waits_for_itself())

    async def waits_for_itself() -> None:
        raise RuntimeError("of the code that asyncio runs")

    for body, error in ((missing, AttributeError), (inside, RuntimeError)):
        with pytest.raises(error) as caught:
            go(body)
        assert not isinstance(caught.value, PlanStructureError)


def test_a_fluent_in_and_or_if_shows_how_fluents_are_combined() -> None:
    door, light = Fluent(True, "door"), Fluent(True, "light")

    async def both() -> None:
        await wait_for(door and light)

    with pytest.raises(
        TypeError, match=r"door is a fluent(.|\n)*right: door_open & light_on    or    if door_open.value:"
    ):
        go(both)


def test_a_condition_in_and_shows_how_conditions_are_combined() -> None:
    cup, plate = an_object("Cup"), an_object("Plate")
    with pytest.raises(TypeError, match=r"holding\(Cup\) is a condition(.|\n)*right: holds\(.*\) & holds\(.*\)"):
        holding(cup) and holding(plate)


def test_the_value_of_a_fluent_given_to_wait_for_is_called_one() -> None:
    with pytest.raises(TypeError, match=r"pass the fluent itself"):
        go(lambda: wait_for(Fluent(False).value))  # type: ignore[arg-type]


def test_swapped_arguments_of_timeout_are_shown_in_their_order() -> None:
    with pytest.raises(TypeError, match="swapped" + shows("await timeout(reach, 5)", "await timeout(5, reach)")):
        go(lambda: timeout(reach, 5))  # type: ignore[arg-type]


def test_a_misspelt_action_is_told_with_the_one_that_may_be_meant() -> None:
    failure = run_plan(lambda: perform(action("Reachng"))).failure
    assert str(failure) == "nothing performs this action: Reachng(); did you mean 'Reaching'?"
    unknown = str(run_plan(lambda: perform(action("Dancing"))).failure)
    assert unknown.startswith("nothing performs this action: Dancing(); in a test, script.performs('Dancing')")


def test_run_without_a_host_shows_one() -> None:
    with pytest.raises(TypeError, match="needs a host" + shows("run(reach)", "run(reach, host=VirtualHost())")):
        run(reach)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="needs a host" + shows("run(serve)", "run(serve, host=VirtualHost())")):
        run()  # type: ignore[call-arg]


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


F = TypeVar("F", bound=Callable[..., Any])


class Colour(Enum):
    RED = "r"
    BLUE = "b"


class Step(StrEnum):
    LOOK = "look"
    GRASP = "grasp"


class Indexed:
    """Iterable by its items, as of old."""

    def __getitem__(self, index: int) -> int:
        return range(3)[index]


Pair = collections.namedtuple("Pair", "before after")


class Arm:
    async def __call__(self) -> str:
        return "called"

    async def reach(self, cup: str = "a") -> str:
        return cup

    @plan
    async def planned(self, cup: str = "a") -> tuple[object, str]:
        return self, cup


class Nothing:
    """Awaitable by an iterator that is no generator."""

    def __await__(self) -> Iterator[Any]:
        return iter(())


async def take(cup: object = "a") -> object:
    await sleep(0.1)
    return cup


async def misses(**grasp: object) -> None:
    raise GraspMissed


def logged(function: F) -> F:
    @functools.wraps(function)
    def wrapper(*arguments: Any, **named: Any) -> Any:
        return function(*arguments, **named)

    return wrapper  # type: ignore[return-value]


def bare(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *arguments, **named: function(*arguments, **named)


def went(body: Callable[[], Awaitable[Any]], **options: Any) -> Any:
    return run(body, host=VirtualHost(), trace=Trace([]), **options)


async def lasts(wait: Callable[[], Awaitable[Any]]) -> float:
    await wait()
    return now()


SECONDS = [np.float32(0.5), np.float64(0.5), np.array(0.5), Fraction(1, 2), Decimal("0.5")]


@pytest.mark.parametrize("half", SECONDS, ids=lambda value: type(value).__name__)
def test_a_duration_is_a_number_of_any_class(half: Any) -> None:
    async def shielded() -> None:
        with shield(within=half):
            await sleep(half)

    async def within() -> None:
        with contextlib.suppress(GraspMissed):
            await with_failure_handling(misses, Recovery(GraspMissed, within=half))
        await achieve(lambda: False, lambda: timeout(half, take), within=half)

    never = Fluent(False)
    for wait in (functools.partial(sleep, half), functools.partial(wait_for, never, half), shielded):
        assert went(functools.partial(lasts, wait)) == 0.5
    with pytest.raises(GoalNotAchieved):
        went(within)
    assert went(lambda: budget(take, seconds=half)) == "a"


@pytest.mark.parametrize("bad", [np.float64("nan"), Decimal("nan"), Decimal(-1), np.bool_(True), True, "1", 10**400])
def test_what_is_no_duration_is_refused_whatever_its_class(bad: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="has to be a duration"):
        went(functools.partial(sleep, bad))


def test_a_number_of_times_is_a_whole_number_of_any_class() -> None:
    two = np.int64(2)
    states = {"look": AsyncMock(return_value="seen"), "end": take}

    async def body() -> list[Any]:
        with contextlib.suppress(GraspMissed):
            await with_failure_handling(misses, Recovery(GraspMissed, retries=two))  # type: ignore[arg-type]
        await state_machine(states, {("look", "seen"): "end"}, "look", "end", max_visits=two)  # type: ignore[arg-type]
        await partial_order({"a": take}, [], limit=two)  # type: ignore[arg-type]
        await budget(take, attempts=two)  # type: ignore[arg-type]
        return await par_each([1, 2], take, limit=two)  # type: ignore[arg-type]

    assert went(body, seed=two, max_steps=np.int64(1000), schedule=two) == [1, 2]
    assert went(body, schedule=[two, np.int8(0)]) == [1, 2]
    assert run(body, host=VirtualHost(rate=np.int32(100)), trace=Trace([])) == [1, 2]  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [np.bool_(True), True, np.float64(2), "2", np.int64(0)])
def test_what_is_no_number_of_times_is_refused_whatever_its_class(bad: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="has to be a number of branches, a whole one, at least 1"):
        went(lambda: par_each([1], take, limit=bad))


@pytest.mark.parametrize("values", [Colour, Indexed(), np.arange(3), {1: 2}.keys(), (n for n in range(3)), b"ab"])
def test_values_are_whatever_can_be_gone_through(values: Any) -> None:
    async def body() -> int:
        await with_failure_handling(take, Recovery(GraspMissed, alternatives={"cup": lambda: given}))
        return len(await par_each(given, take))

    given = list(values) if isinstance(values, types.GeneratorType) else values
    assert went(body) == len([*given])
    assert went(lambda: try_each_in_order(given, take)) == next(iter(given))


def test_names_are_strings_of_any_class() -> None:
    async def body() -> Any:
        await tag(Step.LOOK, take)
        await tag(np.array(["grasp"])[0], take)
        Fluent(0, Step.LOOK)
        Fluent(0, np.array(["cup"])[0])
        done = await partial_order({Step.LOOK: take, Step.GRASP: take}, [(Step.LOOK, Step.GRASP)])
        return [*done], task("look").result

    assert went(body) == (["look", "grasp"], "a")


@pytest.mark.parametrize("orderings", [[Pair("a", "b")], np.array([["a", "b"]]), {("a", "b"): 1}, [["a", "b"]]])
@pytest.mark.parametrize("kind", [dict, types.MappingProxyType, collections.ChainMap])
def test_orderings_are_pairs_of_any_class_and_steps_any_mapping(orderings: Any, kind: Any) -> None:
    steps = kind({"a": functools.partial(sleep, 1), "b": functools.partial(sleep, 1)})
    assert went(lambda: lasts(lambda: partial_order(steps, orderings))) == 2.0


@pytest.mark.parametrize("pair", ["ab", {"a", "b"}, {"a": 1, "b": 2}])
def test_what_has_no_order_or_is_one_name_is_no_ordering(pair: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="pairs"):
        went(lambda: partial_order({"a": take, "b": take}, [pair]))


def test_what_a_partial_has_bound_is_not_filled_with_the_result_of_a_step() -> None:
    steps = {"cup": functools.partial(take, "other"), "pour": functools.partial(take, cup="mine")}
    assert went(lambda: partial_order(steps, [("cup", "pour")]))["pour"] == "mine"


def test_branches_are_whatever_gives_something_to_await() -> None:
    arm = Arm()
    branches = [
        arm,
        arm.reach,
        functools.partial(arm.reach, "b"),
        logged(take),
        bare(take),
        Nothing,
        AsyncMock(),
    ]
    results = ("called", "a", "b", "a", "a", None)
    for construct in (par, seq):
        assert went(functools.partial(construct, *branches))[:-1] == results


def test_plans_are_made_of_decorated_functions_and_of_methods() -> None:
    arm = Arm()
    assert went(plan(logged(take))) == went(plan(bare(take))) == "a"
    assert went(plan(arm)) == "called"
    assert went(arm.planned) == (arm, "a")
    assert went(functools.partial(arm.planned, cup="b")) == (arm, "b")
    assert went(lambda: Arm.planned(arm, "c")) == (arm, "c")


def test_lengths_and_amounts_are_numbers_of_any_class() -> None:
    table = an_object("Table")
    for half in SECONDS:
        assert a_location(near=table, within=half) == a_location(near=table, within=0.5)  # type: ignore[arg-type]
    assert action("Pouring", amount=np.int64(3)) == action("Pouring", amount=3)  # type: ignore[arg-type]
