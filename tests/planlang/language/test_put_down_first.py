"""The strategy that puts down what a hand holds where none is free: in a scripted plan, without a world."""

from __future__ import annotations

import pytest
from loaded_plans import read

from planlang.designators import Object, an_object
from planlang.failures import HandleNotReachable, HandsFull, PlanFailure
from planlang.language.loading import load_plan
from planlang.testing import PlanRun, Script, run_plan

KITCHEN = "http://example.org/kitchen.owl#"
CUP, CAN = an_object("Cup", KITCHEN + "cup1"), an_object("Can", KITCHEN + "can1")
PLAN = """
from planlang import Recovery, action, an_object, perform, plan, put_down_first
from planlang.failures import HandleNotReachable, HandsFull

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
PUT = '    await perform(action("OpeningAGripper", object_acted_on={}))'

ASIDE = "SettingAsideAnObject(object_acted_on={}, out_of_the_way_of=drawer1)"


def opened(failure: PlanFailure, *later: str) -> PlanRun:
    """Run a plan whose opening of a drawer fails once, with further steps after it."""
    module = load_plan(read(PLAN, *later))
    return run_plan(module.serve, script=Script().on("OpeningAContainerArtifact", fails=lambda: failure, times=1))


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
