"""What constructs do in moments that are rare: used up at once, evaporated on the way, asked for without need."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest

from planlang import (
    Fluent,
    Recovery,
    Return,
    Trace,
    VirtualHost,
    a_location,
    a_posture,
    action,
    an_object,
    at_location,
    budget,
    explain,
    look_from_another_place,
    par,
    partial_order,
    plan,
    pursue,
    run,
    shield,
    sleep,
    tag,
    task,
    timeout,
    unwind_protect,
    whenever,
    with_failure_handling,
)
from planlang import evaporate as evaporate_task
from planlang.failures import (
    BranchEvaporated,
    BudgetExceeded,
    GraspMissed,
    ManipulationPoseUnreachable,
    ObjectLost,
    ObjectNotFound,
    ObjectNowhereToBeFound,
    ObjectUnreachable,
    PlanFailure,
)

CUP = an_object("Cup", "http://example.org/map#cup1")
TABLE = an_object("Table", "http://example.org/map#table1")
NEAR_CUP = a_location(in_reach_of=CUP)


def go(plan: Any, executive: Any = None, **options: Any) -> Any:
    return run(plan, host=VirtualHost(), executive=executive, **options)


async def hopeless() -> None:
    raise GraspMissed(what="cup")


async def nothing() -> None: ...


# budgets and bounds


def test_a_budget_of_a_negative_number_of_attempts_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 0, not -1"):
        go(partial(budget, nothing, attempts=-1))


def test_a_budget_of_time_does_not_count_attempts() -> None:
    with pytest.raises(GraspMissed):
        go(partial(budget, partial(with_failure_handling, hopeless, Recovery(PlanFailure, attempts=5)), seconds=1))


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
            await with_failure_handling(body, Recovery(PlanFailure, attempts=3))

    with pytest.raises(BudgetExceeded):
        go(partial(budget, shielded, attempts=0))
    assert tries == [0, 1, 2, 3]


def test_a_deadline_that_passes_while_its_body_is_unwound_changes_nothing() -> None:
    async def fails() -> None:
        await sleep(0.5)
        raise GraspMissed(what="cup")

    slow = partial(timeout, 1, partial(unwind_protect, partial(sleep, 10), partial(sleep, 2)))
    with pytest.raises(GraspMissed) as caught:
        go(partial(par, slow, fails))
    assert caught.value.cleanup_failures == ()


# recoveries


def test_a_recovery_of_a_negative_number_of_attempts_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 0, not -2"):
        Recovery(PlanFailure, attempts=-2)


def test_alternatives_without_a_value_for_the_first_run_are_refused() -> None:
    async def body(grasp: str) -> None: ...

    with pytest.raises(ValueError, match="at least one value"):
        go(partial(with_failure_handling, body, Recovery(PlanFailure, alternatives={"grasp": list})))


def test_a_recovery_may_raise_the_failure_itself_again() -> None:
    async def again(failure: PlanFailure) -> Any:
        raise failure

    with pytest.raises(GraspMissed) as caught:
        go(partial(with_failure_handling, hopeless, Recovery(PlanFailure, again)))
    assert caught.value.__cause__ is None


def test_an_object_that_can_be_seen_from_nowhere_is_nowhere_to_be_found(executive: Any) -> None:
    executive.places = []

    async def body() -> None:
        raise ObjectNotFound(what="cup")

    with pytest.raises(ObjectNowhereToBeFound) as caught:
        go(partial(with_failure_handling, body, Recovery(ObjectNotFound, look_from_another_place(CUP))), executive)
    assert isinstance(caught.value.__cause__, ObjectUnreachable)


def test_whenever_ends_where_its_body_has_evaporated_it() -> None:
    bodies: list[int] = []

    async def body() -> None:
        bodies.append(1)
        evaporate_task(task("watching"))

    with pytest.raises(BranchEvaporated):
        go(partial(tag, "watching", partial(whenever, Fluent(True), body)))
    assert bodies == [1]


def test_whenever_leaves_with_what_its_body_returns() -> None:
    async def body() -> Return[str]:
        return Return("left")

    assert go(partial(whenever, Fluent(True), body)) == "left"


# explanations


def test_causes_that_are_no_plan_failures_and_failures_during_cleanup_are_explained() -> None:
    async def fails_in_cleanup() -> None:
        raise ObjectLost(what="plate")

    async def stuck() -> None:
        await unwind_protect(partial(sleep, 10), fails_in_cleanup)

    async def fails() -> None:
        await sleep(1)
        raise GraspMissed(what="cup") from OSError("gripper jammed")

    with pytest.raises(GraspMissed) as caught:
        go(partial(par, fails, stuck))
    lines = explain(caught.value).splitlines()
    assert [line.strip() for line in lines if "cleanup" in line] == [
        f"during cleanup: ObjectLost: {ObjectLost(what='plate')}"
    ]
    assert lines[-1].strip() == "because of OSError: gripper jammed"


# orders, tags, plans


def test_a_step_whose_parameters_python_cannot_tell_is_given_none() -> None:
    class Opaque:
        __signature__ = "none"

        async def __call__(self) -> str:
            return "done"

    assert go(partial(partial_order, {"a": nothing, "b": Opaque()}, [("a", "b")])) == {"a": None, "b": "done"}


def test_a_handle_asked_for_inside_stays_with_the_live_task_of_its_plan() -> None:
    seen: list[str | None] = []

    @plan
    async def inner() -> None:
        handle = task("work")
        await par(partial(tag, "work", partial(sleep, 1)), look)
        seen.append(handle.path)

    async def look() -> None:
        await sleep(0.5)

    async def outer_tag() -> None:
        await sleep(0.25)
        await tag("work", partial(sleep, 0.1))

    @plan
    async def top() -> None:
        await par(inner, outer_tag)

    go(top)
    assert seen == ["top/par/inner/par/tag/work"]


def test_an_executive_may_write_where_there_is_no_trace(executive: Any) -> None:
    async def top() -> str:
        executive.write("seen", {"what": "cup"})
        return "written"

    assert go(top, executive) == "written"
    trace = Trace()
    go(top, executive, trace=trace)
    assert [event["what"] for event in trace.events if event["event"] == "seen"] == ["cup"]


# at_location


def test_a_location_scope_of_no_attempts_is_refused(executive: Any) -> None:
    with pytest.raises(ValueError, match="at least 1, not 0"):
        go(partial(at_location, NEAR_CUP, nothing, attempts=0), executive)


def test_a_nested_scope_that_finds_no_place_leaves_the_outer_place_alone(executive: Any) -> None:
    nowhere = a_location(in_reach_of=TABLE)
    solutions = executive.solutions
    executive.solutions = lambda location: iter(()) if location is nowhere else solutions(location)

    async def body() -> str:
        try:
            await at_location(nowhere, nothing)
        except ObjectUnreachable as failure:
            return failure.what
        return "reached"

    assert go(partial(at_location, NEAR_CUP, body), executive) == "table1"
    assert executive.log == ["at 1"]


@pytest.mark.parametrize(
    ("raised", "arrives"), [(ManipulationPoseUnreachable, ObjectUnreachable), (ObjectNotFound, ObjectNotFound)]
)
def test_a_failure_on_the_way_to_another_place_is_handled_as_one_at_it(
    executive: Any, module: Any, raised: type[PlanFailure], arrives: type[PlanFailure]
) -> None:
    async def fails(wanted: Any) -> None:
        raise raised

    executive.extra.append(module("arm", ("Tucking",), fails))
    executive.retry_actions = (action("Tucking"),)

    async def body() -> None:
        raise ManipulationPoseUnreachable

    with pytest.raises(arrives):
        go(partial(at_location, NEAR_CUP, body), executive)


def test_a_location_that_is_about_no_object_is_named_itself(executive: Any) -> None:
    executive.places = []
    with pytest.raises(ObjectUnreachable) as caught:
        go(partial(at_location, a_posture("carrying"), nothing), executive)
    assert "carrying" in str(caught.value.what)


def test_a_place_that_cannot_be_watched_fails_the_scope(executive: Any) -> None:
    def is_at(solution: Any) -> bool:
        raise ObjectLost(what="the base")

    executive.is_at = is_at
    ended: list[str] = []

    async def body() -> None:
        try:
            await sleep(5)
        finally:
            ended.append("body")

    with pytest.raises(ObjectLost):
        go(partial(at_location, NEAR_CUP, body), executive)
    assert ended == ["body"]
