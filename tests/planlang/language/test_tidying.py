"""Doors that are opened only so that the robot gets through are closed again: in scripted plans, without a world."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from loaded_plans import read

from planlang import Recovery, explain, open_what_is_in_the_way, perform, with_failure_handling
from planlang.designators import Condition, FixedPose, Object, action, an_object
from planlang.failures import BehindClosedDoor, ContainerStuck, NavigationFailure, ObjectUnreachable, PlanFailure
from planlang.language.loading import load_plan
from planlang.language.recovery import without_recoveries
from planlang.language.tidying import passed, tidied
from planlang.testing import Script, run_plan

CUP = an_object("Cup", "http://example.org/#cup1")
ONE, TWO = (an_object("Door", f"http://example.org/#door{number}") for number in (1, 2))
BEYOND = FixedPose(x=1.0)
LATER = """
from planlang import Recovery, action, an_object, open_what_is_in_the_way, perform, plan
from planlang.failures import BehindClosedDoor

TABLE = an_object("KitchenTable", "http://example.org/#table1")
DOOR, OTHER = (an_object("Door", f"http://example.org/#door{number}") for number in (1, 2))


@plan
async def leave_open():
    before = Recovery(BehindClosedDoor, open_what_is_in_the_way(TABLE))
    await perform(action("Translation-LocationChange", to_location=TABLE), recoveries=[before])
"""
OPEN, CLOSE, AGAIN = "OpeningAContainerArtifact", "ClosingAContainerArtifact", "ClosingDoorsAgain"


def fetching(*doors: Object, shut: bool = True) -> Callable[[], Awaitable[Any]]:
    """A plan that fetches a cup from behind doors, within what is tidied."""
    failure = ObjectUnreachable(what="cup1")
    beyond = tuple((door, BEYOND) for door in doors) if shut else ()
    failure.__cause__ = BehindClosedDoor(what="cup1", door=doors[0], further=doors[1:], beyond=beyond)
    left: list[PlanFailure] = [failure]

    async def fetch() -> None:
        if left:
            raise left.pop()
        await perform(action("ClosingAGripper", object_acted_on=CUP))

    async def plan() -> None:
        await with_failure_handling(fetch, Recovery(ObjectUnreachable, open_what_is_in_the_way(CUP)))

    return lambda: tidied(plan)


def script(*needed: Object) -> Script:
    """A robot that closes doors after the plan; later steps need some of them."""
    made = Script().performs(AGAIN)
    for door in needed:
        made.fact(str(Condition("leads_back", (door, BEYOND))))
    return made


def test_a_door_that_no_later_step_needs_is_closed_from_its_other_side_before_the_step_runs_again() -> None:
    run = run_plan(fetching(ONE), script=script())
    assert run.failure is None
    assert run.happened_before(CLOSE, "ClosingAGripper")
    assert (run.attempts(CLOSE), run.attempts(AGAIN)) == (1, 0)


@pytest.mark.parametrize("doors", [(ONE,), (ONE, TWO)])
def test_doors_that_later_steps_need_are_closed_when_the_plan_has_succeeded(doors: tuple[Object, ...]) -> None:
    run = run_plan(fetching(*doors), script=script(ONE))
    assert run.happened_before("ClosingAGripper", AGAIN)
    assert (run.attempts(OPEN), run.attempts(CLOSE), run.attempts(AGAIN)) == (len(doors), 0, 1)


def test_a_door_that_cannot_be_closed_from_its_other_side_is_tried_again_after_the_plan() -> None:
    run = run_plan(fetching(ONE), script=script().on(CLOSE, fails=ContainerStuck))
    assert run.failure is None
    assert (run.attempts(CLOSE), run.attempts(AGAIN)) == (1, 1)


def test_a_door_through_which_a_search_may_come_back_is_closed_after_the_plan() -> None:
    run = run_plan(lambda: tidied(lambda: passed(ONE, None)), script=script())
    assert (run.attempts(CLOSE), run.attempts(AGAIN)) == (0, 1)


def test_a_door_that_was_open_before_is_left_open() -> None:
    run = run_plan(fetching(ONE, shut=False), script=script())
    assert (run.attempts(OPEN), run.attempts(CLOSE), run.attempts(AGAIN)) == (1, 0, 0)


@pytest.mark.parametrize(("step", "closed"), [(f"{OPEN}", 0), ("LookingAtSomething", 1)])
@pytest.mark.parametrize("needed", [(), (ONE,)])
def test_a_door_that_a_later_step_opens_is_not_closed_again(step: str, closed: int, needed: tuple[Object, ...]) -> None:
    later = (f'    await perform(action("{step}", object_acted_on={what}))' for what in ("OTHER", "DOOR"))
    module = load_plan(read(LATER, *later))
    failure = BehindClosedDoor(what="table1", door=ONE, beyond=((ONE, BEYOND),))
    stage = script(*needed).on("Translation-LocationChange", fails=lambda: failure, times=1)
    run = run_plan(lambda: tidied(module.leave_open), script=stage)
    assert run.failure is None
    assert run.attempts(CLOSE) + run.attempts(AGAIN) == closed


def test_a_plan_that_has_succeeded_does_not_fail_because_a_door_stays_open() -> None:
    run = run_plan(fetching(ONE), script=script(ONE).on(AGAIN, fails=ContainerStuck))
    assert run.failure is None
    assert run.attempts(AGAIN) == 1


def test_a_plan_that_has_fetched_a_thing_does_not_fail_because_the_robot_does_not_get_back_from_a_door() -> None:
    run = run_plan(fetching(ONE), script=script(ONE).on(AGAIN, fails=NavigationFailure))
    assert run.failure is None


def test_a_plan_that_ends_with_a_drive_fails_if_the_robot_does_not_get_back_from_a_door() -> None:
    module = load_plan(read(LATER))
    failure = BehindClosedDoor(what="table1", door=ONE, beyond=((ONE, BEYOND),))
    stage = (
        script(ONE).on("Translation-LocationChange", fails=lambda: failure, times=1).on(AGAIN, fails=NavigationFailure)
    )
    run = run_plan(lambda: tidied(module.leave_open), script=stage)
    assert isinstance(run.failure, NavigationFailure)


def test_a_failed_plan_closes_no_door() -> None:
    run = run_plan(fetching(ONE), script=script(ONE).on("ClosingAGripper", fails=ContainerStuck))
    assert isinstance(run.failure, ContainerStuck)
    assert run.attempts(AGAIN) == 0


def held_at_last(failure: PlanFailure) -> Callable[[], Awaitable[Any]]:
    """A plan that fails with a cup in its hand."""

    async def plan() -> None:
        await perform(action("ClosingAGripper", object_acted_on=CUP))
        raise failure

    return lambda: tidied(plan)


EMPTYING = "EmptyingTheHands"


def test_what_is_held_when_a_plan_has_failed_is_put_down_and_the_failure_says_where() -> None:
    failure = ObjectUnreachable(what="cup1")
    put = "cup1 was put down on table1"
    run = run_plan(held_at_last(failure), script=Script().performs(EMPTYING).on(EMPTYING, returns=(put,)))
    assert run.failure is failure
    assert failure.afterwards == (put,)
    assert put in explain(failure)


def test_a_failure_to_put_down_what_is_held_does_not_replace_that_of_the_plan() -> None:
    failure = ObjectUnreachable(what="cup1")
    run = run_plan(held_at_last(failure), script=Script().performs(EMPTYING).on(EMPTYING, fails=ContainerStuck))
    assert run.failure is failure
    assert run.attempts(EMPTYING) == 1


def test_empty_hands_put_nothing_down_after_a_failure() -> None:
    async def plan() -> None:
        raise ObjectUnreachable

    run = run_plan(lambda: tidied(plan), script=Script().performs(EMPTYING))
    assert isinstance(run.failure, ObjectUnreachable)
    assert run.attempts(EMPTYING) == 0


def test_a_plan_without_recoveries_ends_with_what_it_holds() -> None:
    async def bare() -> None:
        with without_recoveries():
            await held_at_last(ObjectUnreachable())()

    run = run_plan(bare, script=Script().performs(EMPTYING))
    assert run.attempts(EMPTYING) == 0
