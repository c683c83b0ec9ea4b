"""What a plan may be written with, though it is not what is written most often: nothing of it is refused."""

from __future__ import annotations

import collections
import contextlib
import functools
import types
from collections.abc import Awaitable, Callable, Iterator
from decimal import Decimal
from enum import Enum, StrEnum
from fractions import Fraction
from typing import Any, TypeVar
from unittest.mock import AsyncMock

import numpy as np
import pytest

from planlang import (
    Fluent,
    Recovery,
    Trace,
    VirtualHost,
    achieve,
    action,
    an_object,
    budget,
    now,
    par,
    par_each,
    partial_order,
    plan,
    run,
    seq,
    shield,
    sleep,
    state_machine,
    tag,
    task,
    timeout,
    try_each_in_order,
    wait_for,
    with_failure_handling,
)
from planlang.designators import a_location
from planlang.failures import GoalNotAchieved, GraspMissed

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


async def reach(cup: object = "a") -> object:
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


def go(body: Callable[[], Awaitable[Any]], **options: Any) -> Any:
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
        await achieve(lambda: False, lambda: timeout(half, reach), within=half)

    never = Fluent(False)
    for wait in (functools.partial(sleep, half), functools.partial(wait_for, never, half), shielded):
        assert go(functools.partial(lasts, wait)) == 0.5
    with pytest.raises(GoalNotAchieved):
        go(within)
    assert go(lambda: budget(reach, seconds=half)) == "a"


@pytest.mark.parametrize("bad", [np.float64("nan"), Decimal("nan"), Decimal(-1), np.bool_(True), True, "1", 10**400])
def test_what_is_no_duration_is_refused_whatever_its_class(bad: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="has to be a duration"):
        go(functools.partial(sleep, bad))


def test_a_number_of_times_is_a_whole_number_of_any_class() -> None:
    two = np.int64(2)
    states = {"look": AsyncMock(return_value="seen"), "end": reach}

    async def body() -> list[Any]:
        with contextlib.suppress(GraspMissed):
            await with_failure_handling(misses, Recovery(GraspMissed, attempts=two))  # type: ignore[arg-type]
        await state_machine(states, {("look", "seen"): "end"}, "look", "end", max_visits=two)  # type: ignore[arg-type]
        await partial_order({"a": reach}, [], limit=two)  # type: ignore[arg-type]
        await budget(reach, attempts=two)  # type: ignore[arg-type]
        return await par_each([1, 2], reach, limit=two)  # type: ignore[arg-type]

    assert go(body, seed=two, max_steps=np.int64(1000), schedule=two) == [1, 2]
    assert go(body, schedule=[two, np.int8(0)]) == [1, 2]
    assert run(body, host=VirtualHost(rate=np.int32(100)), trace=Trace([])) == [1, 2]  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [np.bool_(True), True, np.float64(2), "2", np.int64(0)])
def test_what_is_no_number_of_times_is_refused_whatever_its_class(bad: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="has to be a number of branches, a whole one, at least 1"):
        go(lambda: par_each([1], reach, limit=bad))


@pytest.mark.parametrize("values", [Colour, Indexed(), np.arange(3), {1: 2}.keys(), (n for n in range(3)), b"ab"])
def test_values_are_whatever_can_be_gone_through(values: Any) -> None:
    async def body() -> int:
        await with_failure_handling(reach, Recovery(GraspMissed, alternatives={"cup": lambda: given}))
        return len(await par_each(given, reach))

    given = list(values) if isinstance(values, types.GeneratorType) else values
    assert go(body) == len([*given])
    assert go(lambda: try_each_in_order(given, reach)) == next(iter(given))


def test_names_are_strings_of_any_class() -> None:
    async def body() -> Any:
        await tag(Step.LOOK, reach)
        await tag(np.array(["grasp"])[0], reach)
        Fluent(0, Step.LOOK)
        Fluent(0, np.array(["cup"])[0])
        done = await partial_order({Step.LOOK: reach, Step.GRASP: reach}, [(Step.LOOK, Step.GRASP)])
        return [*done], task("look").result

    assert go(body) == (["look", "grasp"], "a")


@pytest.mark.parametrize("orderings", [[Pair("a", "b")], np.array([["a", "b"]]), {("a", "b"): 1}, [["a", "b"]]])
@pytest.mark.parametrize("kind", [dict, types.MappingProxyType, collections.ChainMap])
def test_orderings_are_pairs_of_any_class_and_steps_any_mapping(orderings: Any, kind: Any) -> None:
    steps = kind({"a": functools.partial(sleep, 1), "b": functools.partial(sleep, 1)})
    assert go(lambda: lasts(lambda: partial_order(steps, orderings))) == 2.0


@pytest.mark.parametrize("pair", ["ab", {"a", "b"}, {"a": 1, "b": 2}])
def test_what_has_no_order_or_is_one_name_is_no_ordering(pair: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="pairs"):
        go(lambda: partial_order({"a": reach, "b": reach}, [pair]))


def test_what_a_partial_has_bound_is_not_filled_with_the_result_of_a_step() -> None:
    steps = {"cup": functools.partial(reach, "other"), "pour": functools.partial(reach, cup="mine")}
    assert go(lambda: partial_order(steps, [("cup", "pour")]))["pour"] == "mine"


def test_branches_are_whatever_gives_something_to_await() -> None:
    arm = Arm()
    branches = [arm, arm.reach, functools.partial(arm.reach, "b"), logged(reach), bare(reach), Nothing, AsyncMock()]
    results = ["called", "a", "b", "a", "a", None]
    for construct in (par, seq):
        assert go(functools.partial(construct, *branches))[:-1] == results


def test_plans_are_made_of_decorated_functions_and_of_methods() -> None:
    arm = Arm()
    assert go(plan(logged(reach))) == go(plan(bare(reach))) == "a"
    assert go(plan(arm)) == "called"
    assert go(arm.planned) == (arm, "a")
    assert go(functools.partial(arm.planned, cup="b")) == (arm, "b")
    assert go(lambda: Arm.planned(arm, "c")) == (arm, "c")


def test_lengths_and_amounts_are_numbers_of_any_class() -> None:
    table = an_object("Table")
    for half in SECONDS:
        assert a_location(near=table, within=half) == a_location(near=table, within=0.5)  # type: ignore[arg-type]
    assert action("Pouring", amount=np.int64(3)) == action("Pouring", amount=3)  # type: ignore[arg-type]
