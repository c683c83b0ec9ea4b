"""Actions that a process module performs inside of the one that it was asked for."""

from __future__ import annotations

import contextlib
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import pytest

from planlang import *
from planlang.failures import NavigationFailure, NavigationGoalNotReached
from planlang.language.performing import is_inner
from planlang.language.recovery import Recovery
from planlang.runs import with_paths
from planlang.testing import Script, replay, run_plan

DRIVE = action("Translation-LocationChange", x=5.0)
LOOK = action("LookingForSomething")
OPEN = action("OpeningADoor")


async def opens(asked: Action) -> str:
    """Open a door: drive there, then pull for a second."""
    await sleep(0.5)
    await perform(DRIVE)
    await sleep(0.5)
    return "open"


def go(plan: Callable[[], Awaitable[Any]], executive: Any) -> tuple[Any, Trace]:
    trace = Trace()
    return run(plan, host=VirtualHost(), executive=executive, trace=trace), trace


def test_an_inner_action_is_a_record_below_the_one_around_it_and_takes_its_resources(
    executive: Any, module: Any
) -> None:
    executive.extra.append(module("door", ("OpeningADoor",), opens, needs=("base", "right_arm")))
    value, trace = go(partial(perform, OPEN), executive)
    assert (value, executive.log) == ("open", ["at 5"])
    performed = [one["path"] for one in with_paths(trace.events) if one["event"] == "request"]
    outer, inner = performed
    assert outer.endswith("OpeningADoor/door")
    assert inner == f"{outer}/Translation-LocationChange/navigation"


class Told(Trace):
    """A trace that keeps which performed actions are inside of another module's."""

    inner: dict[str, bool]

    def write(self, step: int, event: str, node: Any = None, /, **details: object) -> None:
        super().write(step, event, node, **details)
        if event == "started" and node.kind == "perform":
            self.inner = {**getattr(self, "inner", {}), node.name: is_inner(node)}


def test_who_hears_of_an_action_can_tell_that_it_is_inside_of_another_one(executive: Any, module: Any) -> None:
    executive.extra.append(module("door", ("OpeningADoor",), opens))
    told = Told()
    run(partial(perform, OPEN), host=VirtualHost(), executive=executive, trace=told)
    assert told.inner == {"OpeningADoor": False, "Translation-LocationChange": True}


@pytest.mark.parametrize("others", [1, 3])
def test_an_inner_drive_does_not_wait_for_drives_that_wait_for_the_action_around_it(
    executive: Any, module: Any, others: int
) -> None:
    executive.extra.append(module("door", ("OpeningADoor",), opens, needs=("base",)))

    async def later() -> None:
        await sleep(0.25)
        await perform(action("Translation-LocationChange", x=9.0))

    go(lambda: par(partial(perform, OPEN), *[later] * others), executive)
    assert executive.log == ["at 5", *["at 9"] * others]


def test_a_request_behind_one_that_waits_for_the_action_around_an_inner_drive_keeps_its_turn(
    executive: Any, module: Any
) -> None:
    log: list[str] = []

    async def waves(asked: Action) -> None:
        log.append("waved")

    executive.extra.append(module("door", ("OpeningADoor",), opens, needs=("base",)))
    executive.extra.append(module("arm", ("Waving",), waves, needs=("left_arm",)))

    async def both() -> None:
        await sleep(0.25)
        async with using("base", "left_arm"):
            log.append("both")

    async def wave() -> None:
        await sleep(0.3)
        await perform(action("Waving"))

    go(lambda: par(partial(perform, OPEN), both, wave), executive)
    assert log == ["both", "waved"], "first come, first served"


def test_a_module_that_has_driven_itself_is_not_driven_back_by_its_own_look(executive: Any, module: Any) -> None:
    async def looks(asked: Action) -> None:
        await perform(DRIVE)
        await perform(LOOK)

    async def seen(asked: Action) -> None:
        executive.log.append("looked")

    executive.extra.append(module("stirring", ("Stirring",), looks, needs=("base",)))
    executive.extra.append(module("perception", ("LookingForSomething",), seen, needs=("head",)))

    async def lost() -> None:
        raise NavigationGoalNotReached

    async def body() -> None:
        with contextlib.suppress(PlanFailure):
            await at_location(a_location(in_reach_of=an_object("Cup")), lost, attempts=1)
        await perform(action("Stirring"))

    go(lambda: at_location(a_location(in_reach_of=an_object("Cup")), body), executive)
    assert executive.log == ["at 1", "at 1", "at 5", "looked"]


def test_an_action_that_is_suspended_during_an_inner_one_begins_again_as_a_whole(executive: Any, module: Any) -> None:
    executive.extra.append(module("door", ("OpeningADoor",), opens, needs=("base",)))

    async def stop() -> None:
        await sleep(0.75)  # the base drives
        async with task_suspended(task("door")):
            await sleep(1.0)

    go(lambda: par(partial(tag, "door", partial(perform, OPEN)), stop), executive)
    assert executive.log == ["at 5"], "the first drive was cut short"


def test_no_recovery_of_the_plan_is_applied_to_an_inner_action_but_those_that_the_module_gives(
    executive: Any, module: Any
) -> None:
    tried: list[str] = []

    async def drives(asked: Action) -> None:
        tried.append("drive")
        raise NavigationGoalNotReached

    async def retries(failure: PlanFailure) -> object:
        tried.append("recovery")
        return RETRY

    async def opens_with_patience(asked: Action) -> None:
        await perform(DRIVE, recoveries=[Recovery(NavigationFailure, retries=2)])

    executive.navigation.does = drives
    executive.extra.append(module("door", ("OpeningADoor",), opens))
    executive.extra.append(module("gate", ("OpeningAGate",), opens_with_patience))
    recovery = Recovery(NavigationFailure, retries)
    with pytest.raises(NavigationGoalNotReached):
        go(partial(with_failure_handling, partial(perform, OPEN), recovery), executive)
    assert tried == ["drive", "recovery", "drive"], "the recovery is around the whole action"
    tried.clear()
    with pytest.raises(NavigationGoalNotReached):
        go(partial(perform, action("OpeningAGate")), executive)
    assert tried == ["drive"] * 3


@plan
async def through_the_door() -> None:
    await perform(OPEN)
    await perform(DRIVE)


SCRIPT = Script().on("OpeningADoor", does=lambda belief, asked: perform(DRIVE))


def test_inner_actions_are_no_attempts_of_the_plan_unless_they_are_asked_for() -> None:
    run = run_plan(through_the_door, script=SCRIPT)
    assert run.attempts("Translation-LocationChange") == 1
    assert run.attempts("Translation-LocationChange", inner=True) == 2
    assert [step.inner for step in run.steps("Translation-LocationChange")] == [True, False]


def test_inner_actions_are_no_steps_behind_which_a_run_resumes_and_replay_equal() -> None:
    whole = run_plan(through_the_door, script=SCRIPT, resumable=True)
    names = [one["name"] for one in whole.trace.events if one["event"] == "completed"]
    assert names == ["OpeningADoor", "Translation-LocationChange"]
    assert replay(through_the_door, whole).equal
    for number in range(3, len(whole.trace.events) - 1):
        cut = Trace([])
        cut.events[:] = whole.trace.events[:number]
        again = run_plan(through_the_door, script=SCRIPT, resume=cut)
        assert [one for one in again.trace.events if one["event"] != "resumed"] == whole.trace.events


def test_requests_inside_of_requests_that_lend_them_the_same_resource_are_replayed(executive: Any, module: Any) -> None:
    async def tidies(asked: Action) -> None:
        await perform(OPEN)

    executive.extra.append(module("door", ("OpeningADoor",), opens, needs=("base", "right_arm")))
    executive.extra.append(module("tidying", ("Tidying",), tidies, needs=("base", "right_arm")))

    async def tidy() -> None:
        await perform(action("Tidying"))

    ended = run_plan(tidy, executive=executive, resumable=True)
    assert replay(tidy, ended).equal
