"""Injected faults: any step of a plan fails by name, attempt and time, and its cleanup runs."""

from __future__ import annotations

from functools import partial

import pytest

from planlang import (
    Recovery,
    action,
    now,
    par,
    perform,
    plan,
    retry_after_suspension,
    seq,
    shield,
    sleep,
    tag,
    unwind_protect,
    with_failure_handling,
)
from planlang.failures import GraspMissed, GraspSlipped, ObjectLost, PlanFailure
from planlang.testing import Fault, Script, run_plan

log: list[str] = []


@plan
async def carry() -> float:
    async def work() -> float:
        await par(arm=lambda: sleep(2), base=lambda: sleep(3))
        return now()

    async def put_back() -> None:
        await sleep(0.5)
        log.append(f"put back at {now():g}")

    return await unwind_protect(work, put_back)


async def main() -> float:
    return await with_failure_handling(carry, Recovery(ObjectLost, attempts=3))


@pytest.fixture(autouse=True)
def empty_log() -> None:
    log.clear()


def test_a_step_fails_as_it_begins() -> None:
    run = run_plan(main, faults=[Fault("carry", GraspMissed)])
    assert isinstance(run.failure, GraspMissed)
    assert run.failed_with("carry", GraspMissed)
    assert run.seconds == 0
    assert log == []
    assert run.failure.where is not None
    assert run.failure.where.path.endswith("carry")


def test_a_step_fails_at_the_attempt_that_was_named() -> None:
    run = run_plan(main, faults=[Fault("carry", ObjectLost, attempt=1), Fault("carry", GraspMissed, attempt=2)])
    assert isinstance(run.failure, GraspMissed)
    assert [step.status for step in run.steps("carry")] == ["failed", "failed"]


def test_a_step_fails_some_time_after_it_began_with_its_children_evaporated_and_its_cleanup_done() -> None:
    run = run_plan(main, faults=[Fault("carry", ObjectLost, attempt=1, after=2.5)])
    assert run.value == 2.5 + 0.5 + 3.0
    assert log == ["put back at 3", "put back at 6.5"]
    assert run.evaporated("carry/par/base")
    first, second = run.steps("carry")
    assert (first.status, first.end, second.start) == ("failed", 3.0, 3.0)


def test_a_step_fails_at_a_plan_time_if_it_runs_then() -> None:
    async def twice() -> None:
        await seq(one=lambda: sleep(1), two=lambda: sleep(1))

    run = run_plan(partial(twice), faults=[Fault("seq", GraspSlipped, at=1.5)])
    assert isinstance(run.failure, GraspSlipped)
    assert run.seconds == 1.5
    late = run_plan(partial(twice), faults=[Fault("seq", GraspSlipped, at=5)])
    assert late.failure is None
    assert late.unused == ("fault GraspSlipped in seq at 5 s",)
    before = run_plan(main, faults=[Fault("carry", ObjectLost, at=2.0)])
    assert before.attempts("carry") == 2


def test_a_performed_step_is_told_by_its_name_or_its_class() -> None:
    reach = partial(perform, action("Reaching"), name="ReachForBottle")
    for name in ("ReachForBottle", "Reaching", "perform_twice/ReachForBottle"):

        async def perform_twice() -> None:
            await reach()
            await reach()

        run = run_plan(perform_twice, faults=[Fault(name, GraspMissed, attempt=2, after=0.5)])
        assert isinstance(run.failure, GraspMissed), name
        assert run.seconds == 1.5
        assert [step.status for step in run.steps("ReachForBottle")] == ["succeeded", "failed"]


def test_tags_branches_and_constructs_can_fail_too() -> None:
    async def work() -> None:
        await par(
            a=lambda: tag("watch", partial(sleep, 2)), b=lambda: retry_after_suspension(partial(sleep, 2)), c=carry
        )

    for step in ("watch", "a", "b", "retry_after_suspension", "par", "work", "par/a"):
        for after in (None, 1.0):
            run = run_plan(work, faults=[Fault(step, ObjectLost, after=after)])
            assert isinstance(run.failure, ObjectLost), (step, after)
            assert run.failed_with(step, ObjectLost)
            assert all(found.end is not None for found in run.steps())


def test_a_shielded_part_is_broken_off_too_for_a_fault_is_the_steps_own() -> None:
    async def guarded() -> None:
        with shield(within=10):
            await sleep(4)

    run = run_plan(guarded, faults=[Fault("guarded", ObjectLost, after=1)])
    assert isinstance(run.failure, ObjectLost)
    assert run.seconds == 1


def test_a_fault_may_be_a_programming_error_which_no_recovery_catches() -> None:
    with pytest.raises(ZeroDivisionError):
        run_plan(main, faults=[Fault("carry", ZeroDivisionError)])


def test_faults_of_a_script_are_those_of_the_first_attempt_unless_it_says_otherwise() -> None:
    assert run_plan(main, script=Script().fault("carry", ObjectLost)).attempts("carry") == 2
    always = run_plan(main, script=Script().fault("carry", ObjectLost, attempt=None))
    assert always.attempts("carry") == 4
    assert isinstance(always.failure, ObjectLost)
    assert run_plan(main, script=Script().fault("carry", ObjectLost, at=4)).failure is None


def test_equal_faults_give_equal_traces() -> None:
    faults = [Fault("carry", lambda: PlanFailure("lost"), after=1.25), Fault("arm", ObjectLost, attempt=None, after=1)]
    assert run_plan(main, faults=faults).trace.text() == run_plan(main, faults=faults).trace.text()
