"""A run ends by itself: after a time of the plan, and after a number of attempts, never after seconds of a clock."""

from __future__ import annotations

from functools import partial

import pytest

from executive.runs.plan_body import Allowance, body_of
from planlang import Recovery, perform, plan
from planlang.designators import action
from planlang.failures import BudgetExceeded, ManipulationGoalNotReached
from planlang.testing import Script, run_plan


@plan
async def reach_in_vain() -> None:
    """Repeat a motion that never arrives."""
    await perform(action("Reaching"), recoveries=[Recovery(ManipulationGoalNotReached, retries=10**9)])


@pytest.mark.parametrize(("extended", "attempts"), [(0, 5), (2, 15)])
def test_a_plan_that_repeats_for_ever_gives_up_after_a_number_of_attempts(extended: int, attempts: int) -> None:
    body = body_of(reach_in_vain, {}, Allowance(1e6, 5), attempts=extended)
    run = run_plan(body, script=Script().on("Reaching", fails=ManipulationGoalNotReached))
    assert isinstance(run.failure, BudgetExceeded)
    assert run.failure.used == {"with_failure_handling": attempts}
    assert run.attempts("Reaching") == attempts + 1


def test_a_plan_that_takes_too_long_gives_up_after_a_time_of_the_plan() -> None:
    script = Script(takes=10.0).on("Reaching", fails=ManipulationGoalNotReached)
    run = run_plan(partial(body_of(reach_in_vain, {}, Allowance(60.0, 10**6))), script=script)
    assert isinstance(run.failure, BudgetExceeded)
    assert run.failure.seconds == run.seconds == 60.0
