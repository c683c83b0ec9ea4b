"""partial_order: order, slots, data flow, misuse; against networkx and by brute force."""

from __future__ import annotations

from functools import partial
from random import Random
from typing import Any

import hypothesis
import networkx as nx
import pytest
from hypothesis import strategies as st
from virtual_time import go

from planlang import *


async def nothing() -> None: ...


@hypothesis.given(
    st.integers(1, 8).flatmap(
        lambda n: st.tuples(
            st.just(n),
            st.lists(
                st.tuples(st.integers(0, n - 1), st.integers(0, n - 1)).filter(lambda e: e[0] < e[1]), max_size=16
            ),
            st.lists(st.integers(0, 3), min_size=n, max_size=n),
            st.one_of(st.none(), st.integers(1, 3)),
            st.one_of(st.none(), st.integers(0, 99)),
        )
    )
)
def test_steps_start_as_soon_as_their_predecessors_succeeded_and_a_slot_is_free(case: Any) -> None:
    count, edges, durations, limit, schedule = case
    started: dict[int, int] = {}
    ended: dict[int, int] = {}

    async def step(number: int) -> int:
        started[number] = round(now() * 240)
        await sleep(durations[number] / 240)
        ended[number] = round(now() * 240)
        return number

    steps = {str(number): partial(step, number) for number in range(count)}
    orderings = [(str(a), str(b)) for a, b in edges]
    result = go(lambda: partial_order(steps, orderings, limit), schedule=schedule)
    assert result == {str(number): number for number in range(count)}
    assert list(result) == list(steps)
    for a, b in edges:
        assert ended[a] <= started[b]
    if limit is None:
        for number in range(count):
            assert started[number] == max([ended[a] for a, b in edges if b == number], default=0)
    else:
        for moment in range(max(ended.values())):
            assert sum(started[n] <= moment < ended[n] for n in range(count)) <= limit


def test_a_thousand_steps_take_as_long_as_the_longest_chain() -> None:
    rng = Random(1)
    count = 1000
    edges = [(i, j) for i in range(count) for j in {i + 1 + rng.randrange(30) for _ in range(2)} if j < count]

    async def step() -> None:
        await sleep(0.05)

    async def plan() -> float:
        await partial_order({str(n): step for n in range(count)}, [(str(a), str(b)) for a, b in edges])
        return now()

    longest = nx.dag_longest_path_length(nx.DiGraph(edges)) + 1
    assert go(plan) == pytest.approx(longest * 0.05)


def test_of_the_ready_steps_the_textually_first_starts_when_a_slot_is_free() -> None:
    log: list[str] = []

    async def step(name: str) -> None:
        log.append(name)
        await sleep(0.1)

    go(lambda: partial_order({name: partial(step, name) for name in "dcba"}, [("d", "c")], limit=1))
    assert log == ["d", "c", "b", "a"]


def test_a_step_after_a_failed_one_never_starts() -> None:
    async def fails() -> None:
        raise PlanFailure("first")

    async def never() -> None:
        pytest.fail("its predecessor failed")

    with pytest.raises(PlanFailure, match="first"):
        go(lambda: partial_order({"a": fails, "b": never}, [("a", "b")]))


def test_a_parameter_named_like_a_predecessor_gets_its_result() -> None:
    async def find() -> str:
        return "cup"

    async def grasp(find: str, force: float = 2.0) -> str:
        return f"{find} with {force:g} N"

    async def tell(grasp: str, find: str) -> tuple[str, str]:
        return grasp, find

    steps = {"find": find, "grasp": grasp, "tell": tell}
    result = go(lambda: partial_order(steps, [("find", "grasp"), ("grasp", "tell")]))
    assert result["tell"] == ("cup with 2 N", "cup")


def test_a_parameter_that_no_predecessor_fills_is_refused_before_anything_starts() -> None:
    async def needs(other: int) -> None: ...

    async def never() -> None:
        pytest.fail("nothing may start")

    with pytest.raises(ValueError, match="'needs' has a parameter 'other'"):
        go(lambda: partial_order({"never": never, "needs": needs, "other": never}, [("needs", "other")]))


def test_an_unknown_name_in_an_ordering_lists_the_steps() -> None:
    with pytest.raises(ValueError, match="no step 'z'; steps: a, b"):
        go(lambda: partial_order({"a": nothing, "b": nothing}, [("a", "z")]))


def test_a_repeated_ordering_is_accepted() -> None:
    assert go(lambda: partial_order({"a": nothing, "b": nothing}, [("a", "b"), ("a", "b")])) == {"a": None, "b": None}


def test_simultaneous_failures_raise_the_textually_first_with_the_others_as_siblings() -> None:
    async def fails(what: str) -> None:
        raise PlanFailure(what)

    for schedule in (None, 1, 2):
        with pytest.raises(PlanFailure, match="one") as caught:
            go(lambda: partial_order({"x": partial(fails, "one"), "y": partial(fails, "two")}, []), schedule=schedule)
        assert [name for name, _ in caught.value.siblings] == ["y"]


def test_a_step_whose_parameters_python_cannot_tell_is_given_none() -> None:
    class Opaque:
        __signature__ = "none"

        async def __call__(self) -> str:
            return "done"

    assert go(partial(partial_order, {"a": nothing, "b": Opaque()}, [("a", "b")])) == {"a": None, "b": "done"}
