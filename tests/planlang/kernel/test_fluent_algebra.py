"""The algebra of fluents: every operator is lazy, shows current values, and raises its errors in the waiter."""

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import partial
from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st
from virtual_time import go

from planlang import *

BINARY: list[Callable[[Any, Any], Any]] = [
    operator.add,
    operator.sub,
    operator.mul,
    operator.truediv,
    operator.floordiv,
    operator.mod,
    operator.pow,
    operator.eq,
    operator.ne,
    operator.lt,
    operator.le,
    operator.gt,
    operator.ge,
]


def outcome(compute: Callable[[], Any]) -> Any:
    """The value, or the class of what is raised."""
    try:
        return compute()
    except Exception as error:
        return type(error)


@hypothesis.given(
    operation=st.sampled_from(BINARY), a=st.integers(-5, 5), b=st.integers(-5, 5), later=st.integers(-5, 5)
)
def test_an_expression_has_the_value_that_python_gives_for_the_current_values(
    operation: Any, a: int, b: int, later: int
) -> None:
    left, right = Fluent(a), Fluent(b)
    expressions = [operation(left, right), operation(left, b), operation(a, right)]
    for expression in expressions:
        assert outcome(lambda expression=expression: expression.value) == outcome(lambda: operation(a, b))
    left.set(later)
    assert outcome(lambda: expressions[0].value) == outcome(lambda: operation(later, b))


@hypothesis.given(a=st.integers(0, 2), b=st.integers(0, 2))
def test_and_or_and_not_follow_python(a: int, b: int) -> None:
    left, right = Fluent(a), Fluent(b)
    assert (left & right).value == (a and b)
    assert (left | right).value == (a or b)
    assert (a & right).value == (a and b)
    assert (a | right).value == (a or b)
    assert (~left).value == (not a)
    assert ((-left).value, abs(left).value) == (-a, a)


def test_what_the_second_operand_raises_is_not_met_when_the_first_one_decides() -> None:
    broken = 1 / Fluent(0) > 0
    assert (Fluent(False) & broken).value is False
    assert (Fluent(True) | broken).value is True
    with pytest.raises(ZeroDivisionError):
        _ = (Fluent(True) & broken).value


def test_an_error_is_raised_in_the_waiter_at_once_or_when_it_arises() -> None:
    number = Fluent(1)

    async def body() -> float:
        with pytest.raises(TypeError):
            await wait_for(number < "text")

        async def zero() -> None:
            await sleep(1)
            number.set(0)

        async def waits() -> None:
            with pytest.raises(ZeroDivisionError):
                await wait_for(1 / number > 5)

        await par(waits, zero)
        return now()

    assert go(body) == 1


@pytest.mark.parametrize(
    "use", [bool, lambda f: f and True, lambda f: f in [Fluent(1)], lambda f: not f, lambda f: 0 < f < 2]
)
def test_the_truth_of_an_expression_is_a_type_error_that_names_value(use: Any) -> None:
    with pytest.raises(TypeError, match=r"\.value"):
        use(Fluent(1) + 1)


def test_expressions_are_hashed_by_identity_like_fluents() -> None:
    fluent = Fluent(1)
    one, other = fluent + 1, fluent + 1
    assert len({one, other, one}) == 2
    assert hash(fluent) == hash(fluent)


def test_an_expression_pulses_when_one_of_its_fluents_does() -> None:
    left, right = Fluent(1), Fluent(2)
    for missed, expected in (("always", 3), ("once", 1), ("never", 0)):

        async def body(missed: str = missed) -> int:
            pulses = (left + right).pulsed(missed=missed)
            left.pulse()
            right.set(right.value + 1)
            right.pulse()
            seen = 0
            while await wait_for(pulses, timeout=1):
                seen += 1
            return seen

        assert go(body) == expected


def test_a_pulse_of_an_expression_with_one_fluent_twice_counts_once() -> None:
    fluent = Fluent(1)

    async def body() -> int:
        pulses = (fluent + fluent).pulsed("always")
        fluent.pulse()
        seen = 0
        while await wait_for(pulses, timeout=1):
            seen += 1
        return seen

    assert go(body) == 1


def test_a_pulse_while_somebody_waits_ends_the_wait_whatever_is_missed() -> None:
    fluent = Fluent(1)

    async def body() -> list[float]:
        async def waits(missed: str) -> float:
            await wait_for(fluent.pulsed(missed=missed))
            return now()

        async def pulses() -> float:
            await sleep(2)
            fluent.pulse()
            return 0

        return await par(*(partial(waits, missed) for missed in ("never", "once", "always")), pulses)

    assert go(body)[:3] == (2, 2, 2)


def test_changed_is_true_for_another_value_and_again_false_when_it_is_back() -> None:
    fluent = Fluent(1)
    changed = fluent.changed()
    fluent.set(2)
    assert changed.value
    fluent.set(1)
    assert not changed.value


@pytest.mark.parametrize("seconds", [-1, float("nan")])
def test_the_timeout_of_a_wait_is_a_duration(seconds: float) -> None:
    with pytest.raises(ValueError, match="a duration"):
        go(partial(wait_for, Fluent(False), seconds))


def test_an_expression_as_goal_is_read_anew_from_the_world() -> None:
    height = [1.0]
    fluent = Fluent(read=lambda: height[0], name="height")

    async def body() -> float:
        assert not (fluent > 2).value

        async def rise() -> None:
            height[0] = 3.0

        await achieve(fluent > 2, rise)
        return fluent.value

    assert go(body) == 1.0  # sampled once in the step
    assert fluent.value == 3.0


def test_signals_say_what_they_are() -> None:
    fluent = Fluent(1, "count")
    assert [str(fluent.changed()), str(fluent.pulsed()), str(fluent + 1)] == [
        "a change of count",
        "a pulse of count",
        "(count + 1)",
    ]


def test_signals_show_their_values_to_a_debugger() -> None:
    fluent, unknown = Fluent(1, "count"), Fluent(None, "height")
    assert [repr(fluent), repr(fluent > 2), repr(unknown + 1), repr(fluent.changed())] == [
        "<count = 1>",
        "<(count > 2) = False>",
        "<(height + 1)>",
        "<a change of count>",
    ]


def test_showing_a_world_fluent_does_not_read_the_world() -> None:
    def read() -> bool:
        raise AssertionError("the world was read")

    assert repr(Fluent(False, "door_open", read=read)) == "<door_open = False>"


def test_a_change_of_an_expression_can_be_waited_for() -> None:
    fluent = Fluent(1)

    async def body() -> float:
        changed = (fluent + 1).changed()

        async def change() -> None:
            await sleep(1)
            fluent.set(2)

        await par(partial(wait_for, changed), change)
        return now()

    assert go(body) == 1


def test_values_that_cannot_be_compared_as_a_whole_count_as_changed() -> None:
    fluent = Fluent(np.zeros(2))
    fluent.set(np.zeros(2))
    assert fluent.changes == 1


@pytest.mark.parametrize(
    ("combined", "value"),
    [
        (lambda f: f != 7, False),
        (lambda f: f <= 7, True),
        (lambda f: f >= 8, False),
        (lambda f: 1 + f, 8),
        (lambda f: f - 1, 6),
        (lambda f: 1 - f, -6),
        (lambda f: f * 2, 14),
        (lambda f: 2 * f, 14),
        (lambda f: f / 2, 3.5),
        (lambda f: 14 / f, 2.0),
        (lambda f: f // 2, 3),
        (lambda f: 15 // f, 2),
        (lambda f: f % 4, 3),
        (lambda f: 10 % f, 3),
        (lambda f: f**2, 49),
        (lambda f: 2**f, 128),
        (lambda f: -f, -7),
        (lambda f: abs(-f), 7),
        (lambda f: 0 & f, 0),
        (lambda f: 0 | f, 7),
    ],
)
def test_operators_of_a_fluent_are_those_of_its_value_on_either_side(combined: Any, value: Any) -> None:
    assert combined(Fluent(7)).value == value
