"""Performances of steps: what a designator by class is bound for, and where it begins."""

from __future__ import annotations

from functools import partial

import pytest

from planlang import (
    Recovery,
    at_location,
    par,
    retry_after_suspension,
    sleep,
    tag,
    task,
    task_suspended,
    with_failure_handling,
)
from planlang.designators import a_location, a_situation, action, an_object
from planlang.failures import GraspMissed, ManipulationPoseUnreachable, PlanFailure
from planlang.kernel.primitives import node
from planlang.language.performances import Performance, by_class, performance_of, performing
from planlang.language.recovery import RETRY, RecoveryResult
from planlang.testing import Script, run_plan

CUP, PLATE, TABLE = an_object("Cup"), an_object("Plate"), an_object("Table", "http://example.org/#table1")
BRING = action("Bring", object_acted_on=CUP)


def test_designators_by_class_are_found_in_locations_situations_and_lists() -> None:
    named = an_object("Cup", "http://example.org/#cup1")
    fillers = (named, a_location(on=PLATE), a_situation("Full", object_acted_on=CUP), (CUP, named), 3)
    assert list(by_class(fillers)) == [PLATE, CUP, CUP]
    assert performance_of(CUP) is None, "outside a plan"


def test_all_within_a_performance_mean_the_same_and_another_performance_is_another_occasion() -> None:
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
    assert before.occasion != again.occasion
    assert (before.step, before.actions, before.group) == (again.step, (BRING,), None)


async def note(found: list[Performance]) -> None:
    if (performance := performance_of(CUP)) is not None:
        found.append(performance)


def occasions(found: list[Performance]) -> list[str]:
    """What tells performances apart."""
    return [one.occasion for one in found]


async def bring(found: list[Performance], times: int = 1) -> None:
    """Bring some cup."""
    for _ in range(times):
        with performing(BRING, "note", times=times):
            await node("note", "note", partial(note, found))


def missed(found: list[Performance], number: int) -> None:
    """Fail once, after so many performances."""
    if len(found) == number:
        raise GraspMissed(what="cup1")


@pytest.mark.parametrize("times", [1, 2])
def test_what_a_recovery_repeats_is_the_same_performance_and_a_loop_within_an_attempt_has_others(times: int) -> None:
    found: list[Performance] = []

    async def body() -> None:
        for _ in range(2):
            await bring(found, times)
        missed(found, 2 * times)

    assert run_plan(partial(with_failure_handling, body, Recovery(GraspMissed))).failure is None
    first, again = occasions(found)[: 2 * times], occasions(found)[2 * times :]
    assert first == again
    assert len(set(first)) == 2 * times
    assert [one.group is not None for one in found] == [times > 1] * 4 * times


def test_what_the_recovery_itself_does_is_not_the_same_as_what_it_repeats() -> None:
    found: list[Performance] = []

    async def look(_: PlanFailure) -> RecoveryResult:
        await bring(found)
        return RETRY

    async def body() -> None:
        await bring(found)
        missed(found, 1)

    assert run_plan(partial(with_failure_handling, body, Recovery(GraspMissed, look))).failure is None
    first, between, again = occasions(found)
    assert first == again
    assert first != between


def test_an_attempt_within_an_attempt_repeats_the_performances_of_its_own_place() -> None:
    found: list[Performance] = []

    async def inner() -> None:
        await bring(found)
        missed(found, 2)

    async def outer() -> None:
        await bring(found)
        await with_failure_handling(inner, Recovery(GraspMissed))
        missed(found, 3)

    assert run_plan(partial(with_failure_handling, outer, Recovery(GraspMissed))).failure is None
    before, within, within_again, *repeated = occasions(found)
    assert within == within_again
    assert repeated == [before, within]


def test_another_base_pose_repeats_the_performances_in_its_scope() -> None:
    found: list[Performance] = []

    async def body() -> None:
        await bring(found)
        if len(found) == 1:
            raise ManipulationPoseUnreachable(what="cup1")

    assert run_plan(partial(at_location, a_location(near=TABLE), body), script=Script()).failure is None
    assert len(found) == 2
    assert len(set(occasions(found))) == 1


def test_what_is_repeated_after_a_suspension_is_the_same_performance() -> None:
    found: list[Performance] = []

    async def interrupted() -> None:
        async def body() -> None:
            await bring(found)
            await sleep(5)

        await retry_after_suspension(body)

    async def other() -> None:
        await sleep(1)
        async with task_suspended(task("bringing")):
            await sleep(1)

    assert run_plan(partial(par, partial(tag, "bringing", interrupted), other)).failure is None
    assert len(found) == 2
    assert len(set(occasions(found))) == 1
