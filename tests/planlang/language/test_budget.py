"""Budgets and evaporation stop recoveries and alternatives, and tell where the allowance went."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang import (
    RETRY,
    NoProgress,
    PlanFailure,
    Recovery,
    Return,
    VirtualHost,
    a_location,
    an_object,
    at_location,
    evaporate,
    now,
    par,
    race,
    run,
    seq,
    sleep,
    state_machine,
    tag,
    task_suspended,
    timeout,
    try_each_in_order,
    try_in_order,
    unwind_protect,
    with_failure_handling,
)
from planlang import task as task_of
from planlang.failures import BudgetExceeded, GraspMissed, ManipulationPoseUnreachable, ObjectNotFound, Timeout
from tests.support.refusals import failing


async def misses() -> None:
    await sleep(1)
    raise GraspMissed


def test_a_body_within_its_budget_returns_its_result() -> None:
    async def body() -> str:
        await sleep(1)
        return "done"

    assert go(partial(budget, body, 2, 0)) == "done"
    assert go(partial(budget, body)) == "done"


def test_when_the_time_is_used_up_the_body_is_evaporated_with_its_cleanup() -> None:
    async def plan() -> float:
        with failing(BudgetExceeded, seconds=2):
            await budget(partial(unwind_protect, partial(sleep, 10), partial(sleep, 1)), seconds=2)
        return now()

    assert go(plan) == 3.0


def test_what_is_tried_again_without_end_while_no_time_passes_ends_a_run_without_a_budget() -> None:
    async def fails() -> None:
        raise GraspMissed

    with pytest.raises(NoProgress, match="world step 0"):
        go(partial(with_failure_handling, fails, Recovery(GraspMissed, retries=10**9)))


def test_what_limits_a_run_passes_a_process_module_that_does_not_declare_it(executive: Any, module: Any) -> None:
    async def searches(wanted: Action) -> None:
        raise BudgetExceeded("3 searches are used up")

    executive.extra.append(module("arm", ("Reaching",), searches))
    with pytest.raises(BudgetExceeded, match="3 searches"):
        go(partial(perform, action("Reaching")), executive)


def test_the_failure_says_where_the_time_went(executive: Any, module: Any) -> None:
    async def works(wanted: Action) -> None:
        await sleep(2)

    executive.extra.append(module("arm", ("Reaching", "Lifting"), works))

    async def body() -> None:
        while True:
            await perform(action("Reaching"))
            await perform(action("Lifting"))
            await sleep(1)

    with pytest.raises(BudgetExceeded) as caught:
        go(partial(budget, body, seconds=11), executive)
    assert caught.value.spent == {"Reaching": 5.0, "Lifting": 4.0}
    assert str(caught.value) == "the budget of 11 s is used up, last by Reaching: Lifting 4 s, Reaching 5 s"


def test_nested_recoveries_share_the_attempts() -> None:
    runs: list[float] = []

    async def body() -> None:
        runs.append(now())
        await misses()

    inner = partial(with_failure_handling, body, Recovery(GraspMissed, retries=2))
    outer = partial(with_failure_handling, inner, Recovery(GraspMissed, retries=9))
    with failing(BudgetExceeded, attempts=4, used={"with_failure_handling": 4}):
        go(partial(budget, outer, attempts=4))
    assert len(runs) == 5


def test_a_further_place_takes_an_attempt(executive: Any) -> None:
    executive.places = [(float(x), 0.0, 0.0) for x in range(9)]

    async def body() -> None:
        raise ManipulationPoseUnreachable

    scope = partial(at_location, a_location(in_reach_of=an_object("Cup")), body)
    with failing(BudgetExceeded, used={"at_location": 2}):
        go(partial(budget, scope, attempts=2), executive)
    assert executive.log == ["at 0", "at 1", "at 2"]


def test_an_inner_budget_takes_from_the_outer_one_too() -> None:
    runs: list[float] = []

    async def body() -> None:
        runs.append(now())
        await misses()

    inner = partial(budget, partial(with_failure_handling, body, Recovery(GraspMissed, retries=9)), attempts=3)
    outer = partial(with_failure_handling, inner, Recovery(BudgetExceeded, retries=9))
    with pytest.raises(BudgetExceeded) as caught:
        go(partial(budget, outer, attempts=6))
    assert (caught.value.attempts, caught.value.used) == (6, {"with_failure_handling": 6})
    assert len(runs) == 7


def test_attempts_inside_an_inner_budget_with_enough_left_use_up_the_outer_one() -> None:
    inner = partial(budget, partial(with_failure_handling, misses, Recovery(GraspMissed, retries=9)), attempts=8)
    with pytest.raises(BudgetExceeded) as caught:
        go(partial(budget, inner, attempts=2))
    assert (caught.value.attempts, caught.value.used) == (2, {"with_failure_handling": 2})


@pytest.mark.parametrize("schedule", [None, *range(30)])
def test_that_a_budget_is_used_up_is_decided_after_the_round_whatever_the_schedule(schedule: int | None) -> None:
    log: list[str] = []

    async def fails() -> None:
        raise GraspMissed

    async def beside() -> None:
        log.append("begun")
        await sleep(1)

    asks = partial(with_failure_handling, fails, Recovery(GraspMissed, retries=1))
    with pytest.raises(BudgetExceeded):
        run(partial(budget, partial(par, beside, asks, beside), attempts=0), host=VirtualHost(), schedule=schedule)
    assert log == ["begun", "begun"]


def test_a_shielded_retry_goes_on_when_the_budget_is_used_up() -> None:
    runs: list[int] = []

    async def fails_once() -> None:
        runs.append(1)
        if len(runs) == 1:
            raise GraspMissed

    async def plan() -> None:
        with shield():
            await with_failure_handling(fails_once, Recovery(GraspMissed, retries=1))

    with pytest.raises(BudgetExceeded):
        go(partial(budget, plan, attempts=0))
    assert len(runs) == 2


def test_a_shielded_retry_takes_from_the_budgets_that_have_attempts_left() -> None:
    async def shielded() -> None:
        with shield():
            await with_failure_handling(misses, Recovery(GraspMissed, retries=2))

    outer = partial(with_failure_handling, partial(budget, shielded, attempts=0), Recovery(BudgetExceeded, retries=1))
    with pytest.raises(BudgetExceeded) as caught:
        go(partial(budget, outer, attempts=2))
    assert (caught.value.attempts, caught.value.used) == (2, {"with_failure_handling": 2})


def test_other_failures_pass_through() -> None:
    async def body() -> None:
        raise ObjectNotFound

    with pytest.raises(ObjectNotFound):
        go(partial(budget, body, 10))


def test_a_budget_that_is_used_up_cuts_no_cleanup_short_of_what_was_evaporated_in_that_moment() -> None:
    seen: list[float] = []

    async def succeeds() -> None:
        pass

    async def fails() -> None:
        raise PlanFailure("nothing there")

    async def cleanup() -> None:
        await sleep(5)
        seen.append(now())

    async def several() -> Any:
        return await par(lambda: par(succeeds, fails, succeeds))

    async def loser() -> None:
        await par(lambda: unwind_protect(lambda: with_failure_handling(several, Recovery(PlanFailure)), cleanup))

    with pytest.raises(BudgetExceeded):
        run(lambda: budget(lambda: pursue(loser, succeeds), attempts=0), host=VirtualHost())
    assert seen == [5]


async def hopeless() -> None:
    raise GraspMissed(what="cup")


def test_a_budget_of_time_does_not_count_attempts() -> None:
    with pytest.raises(GraspMissed):
        go(partial(budget, partial(with_failure_handling, hopeless, Recovery(PlanFailure, retries=5)), seconds=1))


def test_a_retry_in_the_cleanup_of_a_branch_that_is_evaporated_takes_no_budget_with_it() -> None:
    async def loser() -> None:
        try:
            await sleep(10)
        finally:
            await with_failure_handling(hopeless, Recovery(PlanFailure))

    async def winner() -> str:
        await sleep(0.5)
        return "won"

    assert go(partial(budget, partial(pursue, winner, loser), attempts=0)) == "won"


def test_what_a_shield_keeps_goes_on_retrying_after_its_budget_is_used_up() -> None:
    tries: list[int] = []

    async def body() -> None:
        tries.append(len(tries))
        raise GraspMissed(what="cup")

    async def shielded() -> None:
        with shield():
            await with_failure_handling(body, Recovery(PlanFailure, retries=3))

    with pytest.raises(BudgetExceeded):
        go(partial(budget, shielded, attempts=0))
    assert tries == [0, 1, 2, 3]


@pytest.mark.parametrize("seconds", [-1, float("nan")])
def test_a_timeout_or_budget_is_a_duration(seconds: float) -> None:
    for body in (partial(timeout, seconds, sleep), partial(budget, partial(sleep, 1), seconds=seconds)):
        with pytest.raises(ValueError, match="a duration"):
            go(body)


def test_the_attempts_of_a_budget_bound_all_recoveries_inside_however_nested_and_the_failure_counts_them() -> None:
    runs: list[int] = []

    async def step() -> None:
        runs.append(1)
        raise GraspMissed

    inner = partial(with_failure_handling, step, Recovery(GraspMissed, retry, retries=3))
    outer = partial(with_failure_handling, inner, Recovery(GraspMissed, retry, retries=3))
    with failing(BudgetExceeded, attempts=5, used={"with_failure_handling": 5}) as caught:
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
        return partial(with_failure_handling, partial(step, name), Recovery(GraspMissed, retry, retries=9))

    with pytest.raises(BudgetExceeded):
        go(partial(budget, partial(par, handled("a"), handled("b")), attempts=3))
    assert sorted(runs) == ["a", "a", "a", "b", "b"]


Plan = Callable[[], Awaitable[Any]]


class Stopped:
    """A body that waits, with a cleanup that fails 0.5 s after it is evaporated; ``begun`` says when it began."""

    def __init__(self, failure: type[PlanFailure] = GraspMissed) -> None:
        self.failure = failure
        self.begun: list[float] = []
        self.cleaned: list[float] = []

    async def __call__(self, *_: Any) -> None:
        self.begun.append(now())
        await unwind_protect(partial(sleep, 100), self.clean_up)

    async def clean_up(self) -> None:
        self.cleaned.append(now())
        await sleep(0.5)
        raise self.failure()


class Handlers:
    """Recoveries and alternatives that must not be used; ``used`` says when one was."""

    def __init__(self) -> None:
        self.used: list[float] = []

    async def recover(self, failure: PlanFailure) -> Any:
        self.used.append(now())
        return RETRY

    async def alternative(self, *_: Any) -> str:
        self.used.append(now())
        return "found"

    def instead(self, failure: PlanFailure) -> PlanFailure:
        self.used.append(now())
        return failure


async def handled(body: Plan, handlers: Handlers) -> Any:
    return await with_failure_handling(body, Recovery(GraspMissed, handlers.recover, retries=3))


async def escalated(body: Plan, handlers: Handlers) -> Any:
    return await with_failure_handling(body, Recovery(GraspMissed, retries=0, otherwise=handlers.instead))


async def given_up(body: Plan, handlers: Handlers) -> Any:
    await with_failure_handling(body, Recovery(GraspMissed, retries=0, otherwise=Return(None)))
    handlers.used.append(now())


async def tried(body: Plan, handlers: Handlers) -> Any:
    return await try_in_order(body, handlers.alternative)


async def each_tried(body: Plan, handlers: Handlers) -> Any:
    return await try_each_in_order([body, handlers.alternative], lambda one: one())


async def states(body: Plan, handlers: Handlers) -> Any:
    cases: Any = {("first", GraspMissed): "other"}
    return await state_machine({"first": body, "other": handlers.alternative}, cases, start="first", end="other")


CONSTRUCTS = [handled, escalated, given_up, tried, each_tried, states]
AROUND: dict[str, Callable[[Plan], Plan]] = {
    "bare": lambda plan: plan,
    "in a sequence": lambda plan: partial(seq, plan),
    "handled again": lambda plan: partial(with_failure_handling, plan, Recovery(PlanFailure, retries=2)),
    "tried again": lambda plan: partial(try_in_order, plan, plan),
}


@pytest.mark.parametrize("around", AROUND.values(), ids=AROUND.keys())
@pytest.mark.parametrize("construct", CONSTRUCTS)
def test_nothing_begins_after_a_timeout_though_a_cleanup_fails(construct: Any, around: Any) -> None:
    body, handlers = Stopped(), Handlers()
    with pytest.raises(Timeout) as raised:
        run(lambda: timeout(1, around(partial(construct, body, handlers))), host=VirtualHost())
    assert (body.begun, body.cleaned, handlers.used) == ([0.0], [1.0], [])
    assert [type(failure) for failure in raised.value.cleanup_failures] == [GraspMissed]


@pytest.mark.parametrize("outer", CONSTRUCTS)
@pytest.mark.parametrize("inner", CONSTRUCTS)
def test_nothing_begins_in_constructs_within_each_other(inner: Any, outer: Any) -> None:
    body, handlers = Stopped(), Handlers()
    nested = partial(outer, partial(inner, body, handlers), handlers)
    with pytest.raises(Timeout) as raised:
        run(lambda: timeout(1, nested), host=VirtualHost())
    assert (body.begun, handlers.used) == ([0.0], [])
    assert [type(failure) for failure in raised.value.cleanup_failures] == [GraspMissed]


def test_a_branch_that_lost_does_not_recover() -> None:
    body, handlers = Stopped(), Handlers()
    assert run(lambda: race(partial(sleep, 1), partial(handled, body, handlers)), host=VirtualHost()) == ("sleep", None)
    assert (body.begun, handlers.used) == ([0.0], [])


def test_a_location_scope_asks_for_no_further_place(executive: Any, module: Any) -> None:
    body = Stopped(ManipulationPoseUnreachable)
    with pytest.raises(Timeout):
        run(
            lambda: timeout(2, lambda: at_location(a_location(near=an_object("Cup")), body)),
            host=VirtualHost(),
            executive=executive,
        )
    assert body.begun == [0.5]
    assert executive.log == ["at 1"]


def test_a_recovery_that_swallows_its_evaporation_does_not_run_the_body_again() -> None:
    runs: list[float] = []

    async def body() -> None:
        runs.append(now())
        raise GraspMissed

    async def stubborn(failure: PlanFailure) -> Any:
        with suppress(GraspMissed):
            await Stopped()()
        return RETRY

    with pytest.raises(Timeout):
        run(
            lambda: timeout(1, lambda: with_failure_handling(body, Recovery(GraspMissed, stubborn))), host=VirtualHost()
        )
    assert runs == [0.0]


def test_a_cleanup_recovers_from_its_own_failures() -> None:
    """Inside a shield evaporation does not reach the task, so that all constructs work."""
    handlers = Handlers()
    missed = [GraspMissed(), GraspMissed()]

    async def retract() -> None:
        await sleep(0.25)
        if missed:
            raise missed.pop()

    cleanup = partial(with_failure_handling, retract, Recovery(GraspMissed, handlers.recover, retries=2))
    with pytest.raises(Timeout) as raised:
        run(lambda: timeout(1, lambda: unwind_protect(partial(sleep, 9), cleanup)), host=VirtualHost())
    assert handlers.used == [1.25, 1.5]
    assert raised.value.cleanup_failures == ()


def test_evaporation_while_suspended_begins_nothing_either() -> None:
    body, handlers = Stopped(), Handlers()

    async def stop() -> None:
        await sleep(1)
        async with task_suspended(task_of("work")):
            await sleep(1)
            evaporate(task_of("work"))

    async def main() -> None:
        with suppress(PlanFailure):
            await par(lambda: tag("work", partial(handled, body, handlers)), stop)

    run(main, host=VirtualHost())
    assert (body.begun, handlers.used) == ([0.0], [])
