"""partial_order: order, slots, data flow, misuse. state_machine: outcomes, transitions, failures as outcomes."""

from __future__ import annotations

from enum import Enum
from functools import partial
from random import Random
from typing import Any

import hypothesis
import networkx as nx
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from virtual_time import go

from planlang import *
from planlang.failures import (
    BudgetExceeded,
    CompositeFailure,
    GraspMissed,
    ManipulationFailure,
    ObjectNotFound,
    TransitionMissing,
)
from planlang.runs import with_paths
from tests.support.examples import examples


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


def says(*outcomes: Any) -> Any:
    """A state that returns one outcome after another, or raises it."""
    left = list(outcomes)

    async def state() -> Any:
        outcome = left.pop(0)
        if isinstance(outcome, BaseException):
            raise outcome
        return outcome

    return state


class Seen(Enum):
    """Outcomes as an enumeration."""

    YES = 1
    NO = 2


def test_the_machine_follows_the_outcomes_and_returns_the_outcome_of_the_end_state() -> None:
    async def machine() -> Any:
        return await state_machine(
            {"look": says("lost", "found"), "search": says("again"), "grasp": says("held")},
            {("look", "lost"): "search", ("search", "again"): "look", ("look", "found"): "grasp"},
            start="look",
            end="grasp",
        )

    assert go(machine) == "held"


def test_outcomes_may_be_members_of_an_enum() -> None:
    states = {"look": says(Seen.NO, Seen.YES), "grasp": says("held")}
    transitions: Any = {("look", Seen.NO): "look", ("look", Seen.YES): "grasp"}
    assert go(partial(state_machine, states, transitions, "look", "grasp")) == "held"


def test_a_failure_takes_the_first_case_for_its_class_in_textual_order() -> None:
    for first, expected in ((ManipulationFailure, "general"), (GraspMissed, "special")):
        second = GraspMissed if first is ManipulationFailure else ManipulationFailure
        names = {GraspMissed: "special", ManipulationFailure: "general"}
        states = {"grasp": says(GraspMissed()), "special": says("special"), "general": says("general")}
        transitions: Any = {("grasp", first): names[first], ("grasp", second): names[second]}
        assert go(partial(state_machine, states, transitions, "grasp", ["special", "general"])) == expected


def test_a_composite_failure_takes_a_case_if_every_leaf_matches() -> None:
    composite = CompositeFailure(failures=(GraspMissed(), GraspMissed()), names=("a", "b"))
    states = {"grasp": says(composite), "end": says("so")}
    transitions: Any = {("grasp", ManipulationFailure): "end"}
    assert go(partial(state_machine, states, transitions, "grasp", "end")) == "so"


def test_a_failure_without_a_case_goes_outward_as_itself() -> None:
    failure = ObjectNotFound()
    states = {"grasp": says(failure), "end": says("so")}
    transitions: Any = {("grasp", ManipulationFailure): "end"}
    with pytest.raises(ObjectNotFound) as caught:
        go(partial(state_machine, states, transitions, "grasp", "end"))
    assert caught.value is failure


def test_an_end_state_may_be_left_by_a_failure() -> None:
    states = {"look": says("found", "found"), "grasp": says(GraspMissed(), "held")}
    transitions: Any = {("look", "found"): "grasp", ("grasp", GraspMissed): "look"}
    assert go(partial(state_machine, states, transitions, "look", "grasp")) == "held"


def test_an_outcome_without_a_case_is_transition_missing_that_names_state_and_outcome() -> None:
    states = {"look": says("odd"), "end": says("so")}
    with pytest.raises(TransitionMissing, match="state look, outcome odd") as caught:
        go(partial(state_machine, states, {("look", "found"): "end"}, "look", "end"))
    assert (caught.value.state, caught.value.outcome) == ("look", "odd")


def test_a_state_that_returns_no_outcome_is_a_type_error_with_the_right_form() -> None:
    states = {"look": says(None), "end": says("so")}
    with pytest.raises(TypeError, match=r"state 'look' returned None(.|\n)*wrong(.|\n)*right"):
        go(partial(state_machine, states, {("look", "found"): "end"}, "look", "end"))


@pytest.mark.parametrize(
    ("transitions", "start", "end", "message"),
    [
        ({}, "nowhere", "b", "no start state 'nowhere'; states: a, b"),
        ({}, "a", "nowhere", "no end state 'nowhere'; states: a, b"),
        ({("a", "x"): "nowhere"}, "a", "b", r"transition \(a, x\) -> nowhere: no state 'nowhere'"),
        ({("nowhere", "x"): "b"}, "a", "b", r"transition \(nowhere, x\) -> b: no state 'nowhere'"),
        ({("a", "x"): "a"}, "a", "b", "no transitions lead from 'a' to the end state 'b'"),
        ({("a", "x"): "a"}, "a", ["a", "b"], "end state"),
        ({("a", "x"): "b", ("b", "x"): "a"}, "a", "b", "'b' is an end state"),
        ({("a", KeyError): "b"}, "a", "b", "KeyError is not a subclass of PlanFailure"),
        ({("a", 3): "b"}, "a", "b", "a string or an Enum member"),
        ({}, "a", [], "needs an end state"),
    ],
)
def test_what_cannot_work_is_a_value_error_that_names_it_before_anything_starts(
    transitions: Any, start: str, end: Any, message: str
) -> None:
    begun: list[str] = []

    async def state() -> str:
        begun.append("a")
        return "x"

    with pytest.raises(ValueError, match=message):
        go(partial(state_machine, {"a": state, "b": state}, transitions, start, end))
    assert begun == []


def test_more_visits_than_allowed_are_budget_exceeded_with_the_visits_of_each_state() -> None:
    states = {"a": says("on", "on", "on"), "b": says("back", "back", "back"), "end": says("so")}
    transitions: Any = {("a", "on"): "b", ("b", "back"): "a", ("b", "out"): "end"}
    with pytest.raises(
        BudgetExceeded, match="state 'a' would be visited more than 2 times; visits: a 2, b 2"
    ) as caught:
        go(partial(state_machine, states, transitions, "a", "end", max_visits=2))
    assert caught.value.used == {"a": 2, "b": 2}


@pytest.mark.parametrize("visits", [0, -1])
def test_max_visits_is_at_least_one(visits: int) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        go(partial(state_machine, {"a": says("x")}, {}, "a", "a", max_visits=visits))


def test_a_machine_that_never_waits_and_never_ends_makes_no_progress() -> None:
    async def again() -> str:
        return "again"

    with pytest.raises(NoProgress):
        go(partial(state_machine, {"a": again, "b": again}, {("a", "again"): "a", ("a", "x"): "b"}, "a", "b"))


def test_a_machine_is_evaporated_between_states_too() -> None:
    async def tick() -> str:
        await sleep(1)
        return "again"

    async def body() -> float:
        machine = partial(state_machine, {"a": tick, "b": tick}, {("a", "again"): "a", ("a", "x"): "b"}, "a", "b")
        await pursue(machine, partial(sleep, 3.5))
        return now()

    assert go(body) == 3.5


def test_each_visit_is_a_node_and_each_transition_an_event_of_the_trace() -> None:
    states = {"look": says("lost", "found"), "grasp": says(GraspMissed()), "end": says("so")}
    transitions: Any = {("look", "lost"): "look", ("look", "found"): "grasp", ("grasp", GraspMissed): "end"}
    trace = Trace()
    go(partial(state_machine, states, transitions, "look", "end"), trace=trace)
    base = "state_machine/state_machine"
    told = [e for e in with_paths(trace.events) if e.get("kind") == "state"]
    ended = [(e["path"], e["status"]) for e in told if e["event"] == "ended"]
    assert ended == [
        (f"{base}/look", "succeeded"),
        (f"{base}/look#2", "succeeded"),
        (f"{base}/grasp", "failed"),
        (f"{base}/end", "succeeded"),
    ]
    steps = [(e["state"], e.get("outcome") or e["failure"]["type"], e["to"]) for e in trace.events if "to" in e]
    assert steps == [("look", "lost", "look"), ("look", "found", "grasp"), ("grasp", "GraspMissed", "end")]


@settings(max_examples=examples(60), deadline=None)
@hypothesis.given(
    table=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=5, max_size=5), flips=st.data()
)
def test_a_machine_visits_what_its_table_says(table: list[tuple[int, int]], flips: st.DataObject) -> None:
    """Random tables of five states with two outcomes each, against a loop over the table."""
    bits = flips.draw(st.lists(st.integers(0, 1), min_size=40, max_size=40))
    walked: list[str] = []

    def state(name: str) -> Any:
        async def visit() -> str:
            walked.append(name)
            return str(bits[len(walked) - 1])

        return visit

    names = [f"s{index}" for index in range(5)]
    transitions: Any = {
        (names[index], str(bit)): names[target] for index, row in enumerate(table) for bit, target in enumerate(row)
    }
    transitions["s0", GraspMissed] = "end"
    expected, at = [], 0
    for bit in bits:
        if len(expected) >= 40 or expected.count(names[at]) == 4:
            break
        expected.append(names[at])
        at = table[at][bit]
    states = {name: state(name) for name in names} | {"end": state("end")}
    with pytest.raises(BudgetExceeded):
        go(partial(state_machine, states, transitions, "s0", "end", max_visits=4))
    assert walked == expected
