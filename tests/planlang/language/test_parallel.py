"""par, pursue, race, try_all, par_each, seq and timeout: results, empty ones, evaporation from outside, misuse."""

from __future__ import annotations

import gc
import warnings
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import BranchEvaporated, CompositeFailure, GraspMissed, NavigationFailure, Timeout
from planlang.language.branches import concurrent_branches
from planlang.runs import with_paths
from tests.support.refusals import failing


async def gives(value: Any, after: float = 0.0) -> Any:
    await sleep(after)
    return value


async def fails(what: str, after: float = 0.0) -> Any:
    await sleep(after)
    raise PlanFailure(what)


def test_results_come_in_textual_order_whatever_the_order_of_ending() -> None:
    assert go(partial(par, partial(gives, 1, 0.3), partial(gives, 2, 0.1), third=partial(gives, 3, 0.2))) == (1, 2, 3)


def test_empty_constructs() -> None:
    assert go(par) == ()
    assert go(seq) == ()
    assert go(partial(par_each, [], gives)) == []
    assert go(partial(partial_order, {}, [])) == {}
    for construct in (pursue, race, try_all, try_in_order):
        with pytest.raises(CompositeFailure) as caught:
            go(construct)
        assert caught.value.failures == ()


def test_race_names_the_winner() -> None:
    assert go(partial(race, slow=partial(gives, 1, 0.2), fast=partial(gives, 2, 0.1))) == ("fast", 2)


def test_of_simultaneous_successes_the_textually_first_counts() -> None:
    for schedule in (None, 1, 2, 3):
        plan = partial(race, a=partial(gives, 1, 0.1), b=partial(gives, 2, 0.1))
        assert go(plan, schedule=schedule) == ("a", 1)


def test_a_failure_after_the_decision_does_not_change_the_outcome() -> None:
    async def fails_in_cleanup() -> None:
        try:
            await sleep(10)
        finally:
            raise PlanFailure("too late")

    assert go(partial(pursue, partial(gives, "won", 0.1), fails_in_cleanup)) == "won"


def test_a_coroutine_object_is_refused_with_the_right_form_and_closed() -> None:
    async def reach() -> None: ...

    async def plan(construct: Any) -> None:
        await construct(reach())

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for construct in (par, pursue, race, try_all, seq, try_in_order):
            with pytest.raises(TypeError, match=r"you called reach\(\); pass reach or partial\(reach, \.\.\.\)"):
                go(partial(plan, construct))
        gc.collect()


def test_an_evaporated_branch_of_par_raises_branch_evaporated_and_ends_the_rest() -> None:
    async def plan() -> float:
        handle = task("victim")

        async def control() -> None:
            await sleep(1)
            evaporate(handle.children[0])

        async def victim() -> None:
            await par(first=partial(sleep, 5), second=partial(sleep, 6))

        with pytest.raises(BranchEvaporated, match="victim/par/first"):
            await par(partial(tag, "victim", victim), control)
        return now()

    assert go(plan) == 1.0


def test_pursue_goes_on_without_a_branch_evaporated_from_outside_until_nobody_is_left() -> None:
    async def plan() -> list[Any]:
        handle = task("race")

        async def control() -> None:
            await sleep(1)
            evaporate(handle.children[0])

        two = partial(pursue, first=partial(sleep, 5), second=partial(gives, "second", 6))
        one = partial(pursue, first=partial(sleep, 5))
        results: list[Any] = [(await par(partial(tag, "race", two), control))[0]]
        with pytest.raises(BranchEvaporated, match="pursue/first"):
            await par(partial(tag, "race", one), control)
        return results

    assert go(plan) == ["second"]


def test_an_evaporated_branch_of_try_all_becomes_a_member_of_the_composite_failure() -> None:
    async def plan() -> Any:
        handle = task("tries")

        async def control() -> None:
            await sleep(1)
            evaporate(handle.children[0])

        tries = partial(try_all, first=partial(sleep, 5), second=partial(fails, "no", 2))
        with pytest.raises(CompositeFailure) as caught:
            await par(partial(tag, "tries", tries), control)
        return [type(failure) for failure in caught.value.failures]

    assert go(plan) == [BranchEvaporated, PlanFailure]


def test_par_each_takes_values_lazily_and_runs_at_most_limit_at_a_time() -> None:
    taken: list[int] = []
    live = [0, 0]

    def values() -> Any:
        for value in range(10):
            taken.append(value)
            yield value

    async def body(value: int) -> int:
        live[0] += 1
        live[1] = max(live)
        assert len(taken) <= value + 3
        await sleep(0.1)
        live[0] -= 1
        return value * value

    assert go(partial(par_each, values(), body, 3)) == [n * n for n in range(10)]
    assert live[1] == 3


def test_par_each_fails_as_par_does_and_takes_no_more_values() -> None:
    taken: list[int] = []

    def values() -> Any:
        for value in range(100):
            taken.append(value)
            yield value

    async def body(value: int) -> None:
        await sleep(0.1)
        if value == 3:
            raise PlanFailure("three")

    with pytest.raises(PlanFailure, match="three"):
        go(partial(par_each, values(), body, limit=2))
    assert taken == [0, 1, 2, 3]


def test_an_error_in_the_values_ends_the_branches_first() -> None:
    log: list[str] = []

    def values() -> Any:
        yield 1
        raise OSError("no more")

    async def body(value: int) -> None:
        try:
            await sleep(1)
        finally:
            log.append("ended")

    with pytest.raises(OSError, match="no more"):
        go(partial(par_each, values(), body))
    assert log == []  # the branch had not begun

    with pytest.raises(OSError, match="no more"):
        go(partial(par_each, values(), body, limit=1))
    assert log == ["ended"]


@pytest.mark.parametrize("limit", [0, -1])
def test_a_limit_is_at_least_one(limit: int) -> None:
    for plan in (partial(par_each, [1], gives, limit), partial(partial_order, {"a": partial(gives, 1)}, [], limit)):
        with pytest.raises(ValueError, match="at least 1"):
            go(plan)


@pytest.mark.parametrize(("named", "step"), [({"name": "Park"}, "Park"), ({}, "Waiting")])
def test_timeout_names_the_step_that_took_too_long(
    executive: Any, module: Any, named: dict[str, str], step: str
) -> None:
    async def wait(action: Action) -> None:
        await sleep(60)

    executive.extra.append(module("waiting", ("Waiting",), wait))

    async def plan() -> None:
        await timeout(2, partial(perform, action("Waiting"), **named))

    with failing(Timeout, seconds=2, construct=f"{step} in plan/timeout"):
        go(plan, executive)


def test_timeout_names_its_construct_and_returns_after_the_cleanup() -> None:
    async def slow() -> None:
        await sleep(10)

    async def plan() -> None:
        await timeout(2, slow)

    with failing(Timeout, seconds=2, construct="slow in plan/timeout") as caught:
        go(plan)
    assert caught.value.seconds == 2


def test_a_body_that_ends_in_the_step_of_the_deadline_was_in_time_under_every_schedule() -> None:
    async def body() -> str:
        for _ in range(4):
            await par(partial(sleep, 0.25))
        return "in time"

    for schedule in (None, 0, 1, 2):
        assert go(partial(timeout, 1, body), schedule=schedule) == "in time"


def test_of_two_deadlines_in_one_step_the_inner_one_strikes_first() -> None:
    with failing(Timeout, construct="sleep in timeout/timeout/timeout/timeout"):
        go(partial(timeout, 1, partial(timeout, 1, partial(sleep, 5))))


def test_a_timeout_of_zero_lets_a_body_end_that_needs_no_time() -> None:
    assert go(partial(timeout, 0, partial(gives, 1))) == 1


def test_the_same_failure_is_raised_as_itself_through_nested_constructs() -> None:
    failure = PlanFailure("one")

    async def raises() -> None:
        raise failure

    with pytest.raises(PlanFailure) as caught:
        go(partial(par, partial(pursue, partial(seq, raises)), partial(sleep, 1)))
    assert caught.value is failure
    assert failure.siblings == ()


def test_branches_are_named_by_function_or_keyword_and_never_by_line() -> None:
    async def work() -> None: ...

    class Callable:
        async def __call__(self) -> None: ...

    trace = Trace()

    async def plan() -> None:
        await par(work, work, partial(work), Callable(), lambda: work(), key=work)
        await par(work, name="again")

    go(plan, trace=trace)
    paths = [e["path"] for e in with_paths(trace.events) if e["event"] == "started" and e["kind"] == "branch"]
    assert paths == [
        "plan",
        "plan/par/work",
        "plan/par/work#2",
        "plan/par/work#3",
        "plan/par/Callable",
        "plan/par/lambda",
        "plan/par/key",
        "plan/again/work",
    ]


def test_a_deadline_that_passes_while_its_body_is_unwound_changes_nothing() -> None:
    async def fails() -> None:
        await sleep(0.5)
        raise GraspMissed(what="cup")

    slow = partial(timeout, 1, partial(unwind_protect, partial(sleep, 10), partial(sleep, 2)))
    with pytest.raises(GraspMissed) as caught:
        go(partial(par, slow, fails))
    assert caught.value.cleanup_failures == ()


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

    with failing(Timeout, seconds=2, construct="reach in timeout/timeout") as caught:
        go(partial(timeout, 2, reach))
    assert caught.value.seconds == 2


def paths() -> list[str]:
    return [branch.path for branch in concurrent_branches()]


def test_there_is_no_concurrent_branch_where_no_plan_runs() -> None:
    assert concurrent_branches() == ()


def test_branches_of_par_are_concurrent_and_what_runs_in_turn_is_not() -> None:
    found: dict[str, list[str]] = {}

    async def look(name: str) -> None:
        await sleep(0.1)
        found[name] = paths()

    async def top() -> None:
        await look("top")
        await seq(partial(look, "in turn"), partial(tag, "part", partial(look, "tagged")))
        await partial_order({"first": partial(look, "step")}, [])
        await par(left=partial(look, "left"), right=partial(par, inner=partial(look, "inner")))

    run(top, host=VirtualHost())
    for name in ("top", "in turn", "tagged", "step"):
        assert found[name] == ["top"], name
    assert found["left"] == ["top/par/left", "top"]
    assert found["inner"] == ["top/par/right/par/inner", "top/par/right", "top"]
