"""Performances of steps: what a designator by class is bound for, and where it begins."""

from __future__ import annotations

from functools import partial

from planlang import Recovery, with_failure_handling
from planlang.designators import a_location, a_situation, action, an_object
from planlang.failures import GraspMissed, PlanFailure
from planlang.language.performances import Performance, by_class, performance_of, performing
from planlang.language.recovery import RETRY, RecoveryResult
from planlang.testing import run_plan

CUP, PLATE = an_object("Cup"), an_object("Plate")
BRING = action("Bring", object_acted_on=CUP)


def test_designators_by_class_are_found_in_locations_situations_and_lists() -> None:
    named = an_object("Cup", "http://example.org/#cup1")
    fillers = (named, a_location(on=PLATE), a_situation("Full", object_acted_on=CUP), (CUP, named), 3)
    assert list(by_class(fillers)) == [PLATE, CUP, CUP]
    assert performance_of(CUP) is None, "outside a plan"


def test_all_within_a_performance_mean_the_same_and_another_performance_has_another_path() -> None:
    found: list[Performance | None] = []

    async def inside() -> None:
        found.append(performance_of(CUP))

    async def plan() -> None:
        for _ in range(2):
            with performing(BRING, "with_failure_handling"):
                found.append(performance_of(CUP))  # before its first node
                await with_failure_handling(inside, Recovery(GraspMissed))
        found.append(performance_of(CUP))
        found.append(performance_of(PLATE))

    assert run_plan(plan).failure is None
    before, within, again, within_again, *outside = found
    assert before == within
    assert again == within_again
    assert outside == [None, None]
    assert before is not None
    assert again is not None
    assert before.path != again.path
    assert (before.step, before.actions, before.group) == (again.step, (BRING,), None)


def test_what_is_done_several_times_is_about_different_things_and_what_a_recovery_repeats_is_a_retry() -> None:
    found: list[Performance] = []

    async def body() -> None:
        with performing(BRING, "with_failure_handling", times=2):
            await with_failure_handling(partial(note, len(found)), Recovery(GraspMissed))
        if len(found) == 1:
            raise GraspMissed(what="cup1")

    async def note(_: int) -> None:
        if (performance := performance_of(CUP)) is not None:
            found.append(performance)

    async def plan() -> None:
        async def again(_: PlanFailure) -> RecoveryResult:
            return RETRY

        await with_failure_handling(body, Recovery(GraspMissed, again))

    assert run_plan(plan).failure is None
    assert [one.is_retry for one in found] == [False, True]
    assert [one.group is not None for one in found] == [True, True]
