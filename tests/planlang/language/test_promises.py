"""Promises of the constructs, failures, budgets and resources that have no place in CRAM's lists."""

from __future__ import annotations

import inspect
from functools import partial
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planlang import (
    PROPAGATE,
    RETRY,
    PlanFailure,
    Recovery,
    Return,
    Trace,
    VirtualHost,
    achieve,
    budget,
    par,
    par_each,
    partial_order,
    pursue,
    race,
    retry,
    run,
    seq,
    sleep,
    state_machine,
    timeout,
    try_all,
    try_each_in_order,
    try_in_order,
    using,
    with_failure_handling,
    with_policies,
    with_requests,
)
from planlang import failures as taxonomy
from planlang.failures import BudgetExceeded, GraspMissed, NavigationFailure, Timeout
from planlang.runs import with_paths


def go(body: Any, **options: Any) -> Any:
    return run(body, host=VirtualHost(), **options)


# -- the tree of failures, as it is written in the documentation

TREE = """
PlanFailure
  LowLevelFailure
    NavigationFailure
      NavigationPoseUnreachable NavigationGoalNotReached NavigationGoalInCollision
    PerceptionFailure
      ObjectNotFound ObjectLost AmbiguousPerception
    LookingFailure
      LookingGoalUnreachable
    ManipulationFailure
      ManipulationPoseUnreachable ManipulationGoalNotReached ManipulationGoalInCollision
      GripperFailure
        GraspMissed GraspSlipped GripperGoalNotReached
      TorsoFailure
        TorsoGoalUnreachable
    EnvironmentManipulationFailure
      ContainerStuck HandleNotReachable
    CommunicationFailure
      HandoverNotTaken
  HighLevelFailure
    ObjectUnreachable ObjectUnfetchable ObjectUndeliverable ObjectNowhereToBeFound EnvironmentUnreachable
  DesignatorFailure
    LocationUnresolvable ObjectUnresolvable ActionUnresolvable MissingCapability
  CompositeFailure Timeout BudgetExceeded BranchEvaporated PolicyViolated GoalNotAchieved TransitionMissing
"""


def test_the_failures_form_the_documented_tree_and_no_other() -> None:
    parents: dict[str, str] = {}
    above: list[tuple[int, str]] = []
    for line in TREE.strip().splitlines():
        depth = len(line) - len(line.lstrip())
        while above and above[-1][0] >= depth:
            above.pop()
        for name in line.split():
            parents[name] = above[-1][1] if above else "Exception"
        above.append((depth, line.split()[-1]))
    found = {
        name: cls.__bases__[0].__name__
        for name, cls in vars(taxonomy).items()
        if inspect.isclass(cls) and issubclass(cls, PlanFailure)
    }
    assert found == parents


# -- constructs


@pytest.mark.parametrize("empty", [par, seq, partial(par_each, [], sleep), partial(partial_order, {}, [])])
def test_an_empty_construct_lets_others_have_their_turn(empty: Any) -> None:
    log: list[str] = []

    async def loops(name: str, wait: Any) -> None:
        for _ in range(3):
            log.append(name)
            await wait()

    go(partial(par, partial(loops, "a", empty), partial(loops, "b", partial(sleep, 0))))
    assert log == ["a", "b"] * 3


def test_try_each_in_order_takes_values_lazily() -> None:
    taken: list[int] = []

    def values() -> Any:
        for value in range(9):
            taken.append(value)
            yield value

    async def works(value: int) -> int:
        if value < 2:
            raise GraspMissed
        return value

    assert go(partial(try_each_in_order, values(), works)) == 2
    assert taken == [0, 1, 2]


def test_try_in_order_unwinds_a_failed_branch_with_its_children_before_the_next_starts() -> None:
    log: list[str] = []

    async def slow() -> None:
        try:
            await sleep(9)
        finally:
            log.append("unwound")

    async def fails() -> None:
        await sleep(1)
        raise GraspMissed

    async def second() -> str:
        log.append("second")
        return "done"

    assert go(partial(try_in_order, partial(par, slow, fails), second)) == "done"
    assert log == ["unwound", "second"]


def test_attachments_are_made_once_however_many_constructs_a_failure_passes() -> None:
    async def fails(kind: type[PlanFailure]) -> None:
        raise kind

    inner = partial(par, partial(fails, GraspMissed), partial(fails, NavigationFailure))
    with pytest.raises(GraspMissed) as caught:
        go(partial(par, partial(par, partial(timeout, 9, inner))))
    assert [(name, type(failure)) for name, failure in caught.value.siblings] == [("fails#2", NavigationFailure)]


def test_a_timeout_of_a_named_construct_says_what_took_too_long_and_how_long_it_had() -> None:
    async def reach() -> None:
        await sleep(9)

    with pytest.raises(Timeout, match=r"reach in timeout/timeout took longer than 2 s") as caught:
        go(partial(timeout, 2, reach))
    assert caught.value.seconds == 2


@pytest.mark.parametrize("seconds", [-1, float("nan")])
def test_a_timeout_or_budget_is_a_duration(seconds: float) -> None:
    for body in (partial(timeout, seconds, sleep), partial(budget, partial(sleep, 1), seconds=seconds)):
        with pytest.raises(ValueError, match="a duration"):
            go(body)


# -- recovery: at most 1 + sum(attempts) runs of the body, whatever recoveries and failures there are

KINDS = (GraspMissed, NavigationFailure, taxonomy.ManipulationFailure, taxonomy.ObjectNotFound)


@settings(max_examples=200, deadline=None)
@given(
    recoveries=st.lists(
        st.tuples(st.sampled_from(KINDS), st.integers(0, 3), st.sampled_from(["retry", "propagate", "return"])),
        max_size=4,
    ),
    outcomes=st.lists(st.one_of(st.none(), st.sampled_from(KINDS)), min_size=14, max_size=14),
)
def test_recoveries_do_what_the_table_of_counters_says(recoveries: Any, outcomes: Any) -> None:
    runs = 0

    async def body() -> str:
        nonlocal runs
        runs += 1
        kind = outcomes[runs - 1]
        if kind is not None:
            raise kind
        return "done"

    async def decide(word: str, failure: PlanFailure) -> Any:
        return {"retry": RETRY, "propagate": PROPAGATE, "return": Return("left")}[word]

    def model() -> tuple[int, Any]:
        left = [attempts for _, attempts, _ in recoveries]
        for number, kind in enumerate(outcomes, 1):
            if kind is None:
                return number, "done"
            match = next((n for n, entry in enumerate(recoveries) if issubclass(kind, entry[0])), None)
            if match is None or not left[match] or recoveries[match][2] == "propagate":
                return number, kind
            if recoveries[match][2] == "return":
                return number, "left"
            left[match] -= 1
        raise AssertionError

    made = [Recovery(kind, partial(decide, word), attempts=attempts) for kind, attempts, word in recoveries]
    try:
        outcome = go(partial(with_failure_handling, body, *made))
    except PlanFailure as failure:
        outcome = type(failure)
    assert (runs, outcome) == model()
    assert runs <= 1 + sum(attempts for _, attempts, _ in recoveries)


# -- budgets


def test_the_attempts_of_a_budget_bound_all_recoveries_inside_however_nested_and_the_failure_counts_them() -> None:
    runs: list[int] = []

    async def step() -> None:
        runs.append(1)
        raise GraspMissed

    inner = partial(with_failure_handling, step, Recovery(GraspMissed, retry, attempts=3))
    outer = partial(with_failure_handling, inner, Recovery(GraspMissed, retry, attempts=3))
    with pytest.raises(BudgetExceeded, match=r"5 attempts.*with_failure_handling again 5 times") as caught:
        go(partial(budget, outer, attempts=5))
    assert len(runs) == 6
    assert caught.value.used == {"with_failure_handling": 5}


def test_a_budget_without_attempts_left_still_allows_a_first_run() -> None:
    assert go(partial(budget, partial(try_all, partial(sleep, 1)), attempts=0)) is None


def test_branches_side_by_side_share_one_budget() -> None:
    runs: list[str] = []

    async def step(name: str) -> None:
        runs.append(name)
        await sleep(1)
        raise GraspMissed

    def handled(name: str) -> Any:
        return partial(with_failure_handling, partial(step, name), Recovery(GraspMissed, retry, attempts=9))

    with pytest.raises(BudgetExceeded):
        go(partial(budget, partial(par, handled("a"), handled("b")), attempts=3))
    assert sorted(runs) == ["a", "a", "a", "b", "b"]


# -- resources


def test_resources_are_in_the_trace_when_granted_and_released_on_evaporation_too() -> None:
    async def holds() -> None:
        async with using("left_arm", "base"):
            await sleep(9)

    trace = Trace()
    go(partial(pursue, holds, partial(sleep, 1)), trace=trace)
    told = [(e["step"], e["event"], e["path"], e["resources"]) for e in with_paths(trace.events) if "resources" in e]
    assert told == [
        (0, "acquired", "pursue/pursue/holds", ["left_arm", "base"]),
        (240, "released", "pursue/pursue/holds", ["left_arm", "base"]),
    ]


@settings(max_examples=60, deadline=None)
@given(
    users=st.lists(
        st.tuples(st.integers(0, 3), st.integers(1, 3), st.lists(st.sampled_from("abc"), min_size=1, max_size=3)),
        min_size=1,
        max_size=6,
    ),
    schedule=st.one_of(st.none(), st.integers(0, 99)),
)
def test_a_resource_has_one_holder_and_requests_never_deadlock(users: Any, schedule: int | None) -> None:
    held: set[str] = set()

    async def user(start: int, long: int, names: list[str]) -> None:
        await sleep(start)
        async with using(*names):
            assert not held & set(names)
            held.update(names)
            await sleep(long)
            held.difference_update(names)

    go(partial(par, *(partial(user, *one) for one in users)), schedule=schedule)
    assert held == set()


# -- public names


def test_every_public_name_has_a_docstring_and_is_listed_once() -> None:
    import planlang

    assert len(planlang.__all__) == len(set(planlang.__all__))
    for name in planlang.__all__:
        assert not callable(getattr(planlang, name)) or inspect.getdoc(getattr(planlang, name)), name
    for construct in (race, achieve, state_machine, with_policies, with_requests):
        assert construct.__name__ in planlang.__all__
