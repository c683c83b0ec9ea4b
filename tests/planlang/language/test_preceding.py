"""Actions that come before steps of a plan, by the path of the step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from planlang import Recovery, action, at_location, perform
from planlang.designators import Action, a_location, an_object
from planlang.failures import GraspMissed
from planlang.language.preceding import preceded
from planlang.runs import RunTree
from planlang.testing import PlanRun, Script, run_plan

CUP = an_object("Cup", "http://example.org/kitchen.owl#cup1")
FIRST = action("LookingAtSomething", object_acted_on=CUP)


def run(by: Mapping[str, Sequence[Action]], script: Script | None = None) -> PlanRun[Any]:
    """Run a plan with two like steps and a location scope, with actions before some of these."""

    async def at_the_cup() -> None:
        await perform(action("Reaching"), "grasp", recoveries=[Recovery(GraspMissed, retries=1)])

    async def top() -> None:
        with preceded(by):
            await perform(action("Reaching"))
            await perform(action("Reaching"))
            await at_location(a_location(in_reach_of=CUP), at_the_cup)

    return run_plan(top, script=script or Script())


def steps(done: PlanRun[Any]) -> list[str]:
    """Paths of the actions and location scopes, in order of their start."""
    return [one.path for one in RunTree(done.trace.events).numbered.values() if one.kind in ("perform", "at_location")]


def test_an_action_comes_before_the_step_with_the_path() -> None:
    assert steps(run({"top/Reaching#2": (FIRST,)}))[:3] == ["top/Reaching", "top/LookingAtSomething", "top/Reaching#2"]


def test_an_action_comes_before_a_location_scope_and_not_inside() -> None:
    found = steps(run({"top/at_location": (FIRST, FIRST)}))
    assert found[2:5] == ["top/LookingAtSomething", "top/LookingAtSomething#2", "top/at_location"]


def test_an_action_comes_before_the_first_attempt_only() -> None:
    inside = "top/at_location/at_the_cup/with_failure_handling/grasp"
    script = Script().on("grasp", fails=GraspMissed, times=1)
    found = [one.rpartition("/")[2] for one in steps(run({inside: (FIRST,)}, script))]
    assert [one for one in found if "grasp" in one or "Look" in one] == ["LookingAtSomething", "grasp", "grasp#2"]


def test_without_the_step_nothing_comes_first() -> None:
    assert not any("LookingAtSomething" in one for one in steps(run({"top/Grasping": (FIRST,)})))
