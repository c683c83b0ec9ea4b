"""A run ends by itself: after a time of the plan, and after a number of attempts, never after seconds of a clock."""

from __future__ import annotations

from functools import partial

from executive.runs.allowance import Allowance
from executive.runs.plan_body import body_of
from planlang import RETRY, PlanFailure, Recovery, RecoveryResult, perform, plan
from planlang.designators import action
from planlang.failures import BudgetExceeded, ManipulationGoalNotReached
from planlang.testing import Script, run_plan


@plan
async def reach_in_vain() -> None:
    """Repeat a motion that never arrives."""
    await perform(action("Reaching"), recoveries=[Recovery(ManipulationGoalNotReached, retries=10**9)])


def test_a_plan_that_repeats_for_ever_gives_up_after_a_number_of_attempts() -> None:
    body = body_of(reach_in_vain, {}, Allowance(1e6, attempts := 5, 10**6))
    run = run_plan(body, script=Script().on("Reaching", fails=ManipulationGoalNotReached))
    assert isinstance(run.failure, BudgetExceeded)
    assert run.failure.used == {"with_failure_handling": attempts}
    assert run.attempts("Reaching") == attempts + 1


def test_a_recovery_that_itself_never_ends_is_ended_by_the_time_of_the_run() -> None:
    async def back_off(failure: PlanFailure) -> RecoveryResult:
        await perform(action("SteppingBack"))
        return RETRY

    @plan
    async def reach() -> None:
        await perform(action("Reaching"), recoveries=[Recovery(ManipulationGoalNotReached, back_off)])

    script = Script().on("Reaching", fails=ManipulationGoalNotReached).on("SteppingBack", after=1e5)
    run = run_plan(body_of(reach, {}, Allowance(60.0, 5, 10**6)), script=script)
    assert isinstance(run.failure, BudgetExceeded)
    assert "is used up, last by SteppingBack: " in str(run.failure)
    assert run.seconds == 60.0


def test_a_plan_that_takes_too_long_gives_up_after_a_time_of_the_plan() -> None:
    script = Script(takes=10.0).on("Reaching", fails=ManipulationGoalNotReached)
    run = run_plan(partial(body_of(reach_in_vain, {}, Allowance(60.0, 10**6, 10**6))), script=script)
    assert isinstance(run.failure, BudgetExceeded)
    assert run.failure.seconds == run.seconds == 60.0
