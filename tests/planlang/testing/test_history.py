"""Questions about a run: their answers, and the reasons that the answers give."""

from __future__ import annotations

from functools import partial

import pytest

from planlang import *
from planlang.failures import GraspMissed, GraspSlipped, GripperFailure, NavigationFailure, ObjectUnfetchable
from planlang.testing import NoSuchStep, PlanRun, Script, run_plan


@plan
async def grasp() -> None:
    await sleep(1)
    raise GraspMissed(what="cup")


async def drive() -> None:
    await sleep(0.5)


async def main() -> None:
    await drive_first()
    await par(look=lambda: sleep(2), listen=lambda: sleep(3))
    await with_failure_handling(grasp, Recovery(GraspMissed, retries=2, otherwise=ObjectUnfetchable))


async def drive_first() -> None:
    await seq(drive=drive, turn=drive)
    await pursue(fast=lambda: sleep(1), slow=lambda: sleep(2))


@pytest.fixture
def run() -> PlanRun[None]:
    return run_plan(main)


def test_one_step_happened_before_another_if_it_had_ended_when_that_began(run: PlanRun[None]) -> None:
    assert run.happened_before("pursue", "look")
    assert run.happened_before("look", "grasp")
    backwards = run.happened_before("grasp", "look")
    assert not backwards
    assert str(backwards) == (
        "grasp (5 to 6 s, failed with GraspMissed: the gripper closed on nothing: cup); look (2 to 4 s, succeeded)"
    )
    assert repr(backwards).startswith("<no: grasp (5 to 6 s")
    assert not run.happened_before("look", "listen")
    assert not run.happened_before("par", "look"), "a construct has not ended when its branches begin"


def test_steps_overlap_if_both_are_open_at_some_moment(run: PlanRun[None]) -> None:
    assert run.overlapped("look", "listen")
    assert run.overlapped("listen", "par")
    assert not run.overlapped("fast", "look")
    assert "fast (1 to 2 s, succeeded)" in str(run.overlapped("fast", "look"))


def test_attempts_are_counted_with_how_they_went(run: PlanRun[None]) -> None:
    assert run.attempts("grasp") == 3
    assert run.attempts("with_failure_handling") == 3
    assert run.attempts("nothing of the kind") == 0
    count = run.attempts("grasp")
    assert count.explained()[1] == (
        "grasp, attempt 2: 6 to 7 s, failed with GraspMissed: the gripper closed on nothing: cup"
    )
    assert run.attempts("nothing").explained() == ["nothing never began"]
    assert (str(count), repr(count), f"{count}") == ("3", "3", "3")


def test_a_path_that_leaves_levels_out_is_answered_with_the_whole_path() -> None:
    async def wipe() -> None:
        await perform(action("Wiping"), name="Wipe", recoveries=[Recovery(GraspMissed)])

    ended = run_plan(partial(par, left=wipe), script=Script().performs("Wiping"))
    whole = "left/with_failure_handling/Wipe"
    assert ended.attempts(whole) == 1
    assert ended.attempts("left/Wipe").explained() == [f"left/Wipe never began; did you mean {whole!r}?"]
    with pytest.raises(AssertionError, match=f"no step 'left/Wipe' ran; did you mean '{whole}'?"):
        ended.succeeded("left/Wipe")


def test_steps_end_evaporated_succeeded_or_failed(run: PlanRun[None]) -> None:
    assert run.evaporated("slow")
    assert not run.evaporated("fast")
    assert run.succeeded("fast")
    assert not run.succeeded("grasp")


def test_failures_are_told_by_class_with_subclasses_causes_and_members() -> None:
    async def worse() -> None:
        raise GraspSlipped()

    async def both() -> None:
        await try_all(grasp, worse)

    run = run_plan(main)
    assert run.failed_with("grasp", GraspMissed)
    assert run.failed_with("grasp", GripperFailure)
    assert not run.failed_with("grasp", GraspSlipped)
    assert not run.failed_with("look", PlanFailure)
    assert run.failed_with("main", ObjectUnfetchable, because_of=GraspMissed)
    assert not run.failed_with("main", ObjectUnfetchable, because_of=NavigationFailure)
    composite = run_plan(both)
    assert composite.failed_with("try_all", GripperFailure), "all of its members are"
    assert not composite.failed_with("try_all", GraspMissed)


def test_never_is_about_steps_failures_or_records_maybe_during_a_step(run: PlanRun[None]) -> None:
    assert run.never("speak")
    assert not run.never("look")
    assert run.never("grasp", during="look")
    assert not run.never("listen", during="look")
    assert run.never(NavigationFailure)
    assert not run.never(GripperFailure)
    assert run.never(GripperFailure, during="par")
    assert run.never(lambda event: event["event"] == "drained")
    found = run.never(lambda event: event.get("status") == "evaporated")
    assert not found
    assert "main/pursue/slow" in str(found) or "slow" in str(found)
    assert str(run.never("look")) == "look ran: 2 to 4 s, succeeded"


def test_a_step_that_did_not_run_is_no_answer(run: PlanRun[None]) -> None:
    with pytest.raises(NoSuchStep, match="no step 'listn' ran; did you mean 'listen'"):
        run.overlapped("look", "listn")
    with pytest.raises(NoSuchStep, match="no step 'xyz' ran; steps that did: main, seq, drive"):
        run.evaporated("xyz")
    assert issubclass(NoSuchStep, AssertionError)


def test_one_run_of_a_step_is_asked_by_number_by_parent_or_as_itself(run: PlanRun[None]) -> None:
    assert len(run.steps("grasp")) == 3
    assert run.steps("grasp#2")[0].start == 6.0
    first, second, third = run.steps("grasp")
    assert run.happened_before(first, second)
    assert not run.overlapped(second, third)
    assert run.attempts(third) == 1
    assert len(run.steps("seq/drive")) == 1
    assert first.within(run.steps("with_failure_handling")[0])
    assert not first.within(second)


def test_performed_steps_are_asked_by_name_or_class() -> None:
    async def reach() -> None:
        for name in ("approach", "lift"):
            await perform(action("http://knowrob.org/kb/knowrob.owl#Reaching"), name=name)

    run = run_plan(reach)
    assert run.attempts("Reaching") == 2
    assert run.attempts("lift") == 1
    assert run.happened_before("approach", "lift")


def test_the_tree_shows_every_step_and_a_failure_where_it_arose() -> None:
    async def reach() -> None:
        await par(
            ok=partial(perform, action("Perceiving"), name="look"),
            bad=partial(perform, action("ClosingAGripper")),
        )

    run = run_plan(reach, script=Script().on("ClosingAGripper", fails=GraspMissed, after=0.5))
    assert run.tree() == (
        "reach: 0 to 0.5 s, failed\n"
        "  par: 0 to 0.5 s, failed\n"
        "    ok: 0 to 0.5 s, evaporated\n"
        "      look, Perceiving(): 0 to 0.5 s, evaporated\n"
        "    bad: 0 to 0.5 s, failed\n"
        "      ClosingAGripper(): 0 to 0.5 s, failed with GraspMissed: the gripper closed on nothing"
    )
    assert repr(run) == "<run of reach: raised GraspMissed after 0.5 s>"


def test_a_plan_counts_once_although_its_branch_has_its_name() -> None:
    async def body() -> None:
        await par(grasp=lambda: grasp())

    assert run_plan(body).attempts("grasp") == 1


def test_what_was_evaporated_before_it_began_has_no_time() -> None:
    async def fail() -> None:
        raise GraspMissed()

    async def body() -> None:
        from planlang import evaporate, task

        async def first() -> None:
            evaporate(task("second"))

        await par(first, lambda: tagged())

    async def tagged() -> None:
        await tag("second", partial(sleep, 1))

    run = run_plan(body)
    assert run.evaporated("second")
    assert run.attempts("second") in (0, 1)


def test_reasons_are_short_enough_to_be_shown_whole() -> None:
    async def miss() -> None:
        await sleep(1)
        raise GraspMissed("the gripper closed on nothing, and this is a very long story about how it came to that")

    async def body() -> None:
        await with_failure_handling(lambda: tag("miss", miss), Recovery(GraspMissed, retries=9))

    run = run_plan(body)
    reason = str(run.evaporated("miss"))
    assert reason.endswith("; and 7 more)")
    assert "closed on nothing, and this is a very long st..." in reason
    assert len(str(run.overlapped("miss#2", "miss#3"))) < 240
    assert "how it came to that" in run.tree(), "which is not cut"
