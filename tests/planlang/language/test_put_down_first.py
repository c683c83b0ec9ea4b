"""The strategy that puts down what a hand holds where none is free: in a scripted plan, without a world."""

from __future__ import annotations

import pytest
from loaded_plans import read

from planlang.designators import Object, an_object
from planlang.failures import HandleNotReachable, HandsFull, ObjectLost, PlanFailure
from planlang.language.loading import load_plan
from planlang.testing import PlanRun, Script, run_plan

KITCHEN = "http://example.org/kitchen.owl#"
CUP, CAN = an_object("Cup", KITCHEN + "cup1"), an_object("Can", KITCHEN + "can1")
PLAN = """
from functools import partial

from planlang import Recovery, action, an_object, fetch_again, perform, plan, put_down_first
from planlang.failures import HandleNotReachable, HandsFull, ObjectLost

KITCHEN = "http://example.org/kitchen.owl#"
DRAWER = an_object("Drawer", KITCHEN + "drawer1")
CUP, CAN = an_object("Cup", KITCHEN + "cup1"), an_object("Can", KITCHEN + "can1")


@plan
async def serve():
    await perform(action("ClosingAGripper", object_acted_on=CUP))
    await perform(action("ClosingAGripper", object_acted_on=CAN))
    first = Recovery((HandsFull, HandleNotReachable), put_down_first(DRAWER), retries=1)
    await perform(action("OpeningAContainerArtifact", object_acted_on=DRAWER), recoveries=[first])
"""
LATER = """    again = partial(perform, action("PickingUpAnObject", object_acted_on={0}))
    await perform(action("{1}", object_acted_on={0}), recoveries=[Recovery(ObjectLost, fetch_again({0}, again))])"""
IN_THE_HAND = ("DeliveringAnObject", "PuttingDownAnObject", "LoweringAnObject", "HandingOverAnObject")
PUT = '    await perform(action("OpeningAGripper", object_acted_on={}))'

ASIDE = "SettingAsideAnObject(object_acted_on={}, out_of_the_way_of=drawer1)"


def opened(failure: PlanFailure, *later: str, then: tuple[PlanFailure, ...] = ()) -> PlanRun:
    """Run a plan whose opening of a drawer fails at first, with further steps after it."""
    failures = [failure, *then]
    module = load_plan(read(PLAN.replace("retries=1", f"retries={len(failures)}"), *later))
    script = Script().on("OpeningAContainerArtifact", fails=lambda: failures.pop(0), times=len(failures))
    return run_plan(module.serve, script=script.performs("PickingUpAnObject", "TransportingAnObject", *IN_THE_HAND))


def full(*held: Object) -> HandsFull:
    return HandsFull(what="handle1", held={f"hand{number}": one for number, one in enumerate(held)})


def aside(run: PlanRun) -> list[str]:
    told = (str(event.get("action")) for event in run.trace.events)
    return list(dict.fromkeys(one for one in told if "SettingAside" in one))


@pytest.mark.parametrize(("later", "down"), [(("CUP", "CAN"), "can1"), (("CAN", "CUP"), "cup1"), (("CAN",), "cup1")])
def test_what_the_remaining_steps_need_last_is_put_down_and_the_body_runs_again(
    later: tuple[str, ...], down: str
) -> None:
    run = opened(full(CUP, CAN), *map(PUT.format, later))
    assert run.failure is None
    assert aside(run) == [ASIDE.format(down)]
    assert run.attempts("OpeningAContainerArtifact") == 2


def test_of_things_that_no_step_needs_the_one_held_for_longest_is_put_down() -> None:
    assert aside(opened(full(CAN, CUP))) == [ASIDE.format("cup1")]


def test_what_no_hand_is_known_to_hold_is_put_down_after_the_others() -> None:
    tray = an_object("Tray", KITCHEN + "tray1")
    assert aside(opened(full(tray, CUP))) == [ASIDE.format("cup1")]


def test_a_failure_with_another_reason_propagates() -> None:
    run = opened(HandleNotReachable(what="drawer1"))
    assert isinstance(run.failure, HandleNotReachable)
    assert aside(run) == []


def taken_up(run: PlanRun) -> list[str]:
    told = (str(event.get("action")) for event in run.trace.events)
    return list(dict.fromkeys(one for one in told if one.startswith("PickingUp")))


TAKEN = "PickingUpAnObject(object_acted_on={})"


@pytest.mark.parametrize("kind", IN_THE_HAND)
def test_a_step_that_needs_in_the_hand_what_was_put_down_takes_it_up_first(kind: str) -> None:
    run = opened(full(CUP, CAN), LATER.format("CUP", kind), LATER.format("CAN", kind))
    assert run.failure is None
    assert aside(run) == [ASIDE.format("can1")]
    assert taken_up(run) == [TAKEN.format("can1")], "the other one is still in its hand"
    assert run.attempts("PickingUpAnObject") == 1


def test_both_things_that_were_put_down_are_taken_up_each_before_its_step() -> None:
    later = (LATER.format(one, "DeliveringAnObject") for one in ("CUP", "CAN"))
    run = opened(full(CUP, CAN), *later, then=(full(CUP),))
    assert run.failure is None
    assert aside(run) == [ASIDE.format("can1"), ASIDE.format("cup1")]
    assert taken_up(run) == [TAKEN.format("cup1"), TAKEN.format("can1")]


def test_a_step_that_fetches_what_was_put_down_by_itself_is_not_preceded_by_another_grasp() -> None:
    run = opened(full(CUP, CAN), LATER.format("CAN", "TransportingAnObject"))
    assert run.failure is None
    assert taken_up(run) == []


def test_what_was_put_down_and_no_step_grasps_again_is_the_reason_of_the_failure() -> None:
    deliver = '    await perform(action("DeliveringAnObject", object_acted_on=CAN))'
    run = opened(full(CUP, CAN), PUT.format("CUP"), deliver)
    assert isinstance(run.failure, ObjectLost)
    assert str(run.failure) == "can1 was set aside on the way, and is in no hand"
