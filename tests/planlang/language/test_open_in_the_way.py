"""The strategy that opens what is in the way: in a scripted plan, without a world."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from planlang import (
    Recovery,
    fetch_again,
    give_turn,
    holding,
    open_what_is_in_the_way,
    par,
    perform,
    step_back_and_repeat,
    using,
    with_failure_handling,
)
from planlang.designators import Condition, Object, action, an_object
from planlang.failures import (
    BehindClosedDoor,
    ContainerStuck,
    HandleNotReachable,
    HandsFull,
    LocationUnresolvable,
    ObjectLost,
    ObjectUndeliverable,
    ObjectUnreachable,
    PlanFailure,
)
from planlang.testing import PlanRun, Script, run_plan

CUP, DOOR = an_object("Cup", "http://example.org/#cup1"), an_object("Door", "http://example.org/#door1")
OPENS = Recovery(ObjectUnreachable, open_what_is_in_the_way(CUP), retries=2)


def fetching(*failures: PlanFailure | None) -> Callable[[], object]:
    """A plan that fetches the cup, with one failure after another until there is none."""
    left = list(failures)

    async def fetch() -> None:
        if left and (failure := left.pop(0)) is not None:
            raise failure
        await perform(action("ClosingAGripper", object_acted_on=CUP))

    async def plan() -> None:
        await with_failure_handling(fetch, OPENS)

    return plan


def behind_the_door() -> ObjectUnreachable:
    """The failure of a scope about a thing behind a closed door."""
    failure = ObjectUnreachable(what="cup1")
    failure.__cause__ = BehindClosedDoor(what="cup1", door=DOOR)
    return failure


def test_the_door_is_opened_and_the_body_runs_again() -> None:
    run = run_plan(fetching(behind_the_door()))
    assert run.happened_before("OpeningAContainerArtifact", "ClosingAGripper")
    assert run.belief.holds(Condition("open", (DOOR,)))
    assert run.belief.holding == ["cup1"]


def test_all_doors_on_the_way_are_opened_one_after_the_other() -> None:
    further = an_object("Door", "http://example.org/#door2")
    failure = ObjectUnreachable(what="cup1")
    failure.__cause__ = BehindClosedDoor(what="cup1", door=DOOR, further=(further,))
    assert str(failure.__cause__).endswith("cup1 is behind door1 and door2, which are closed")
    run = run_plan(fetching(failure))
    assert run.belief.holds(Condition("open", (DOOR,)))
    assert run.belief.holds(Condition("open", (further,)))
    assert run.attempts("OpeningAContainerArtifact") == 2


def test_furniture_behind_a_door_between_rooms_is_opened_after_that() -> None:
    room = an_object("Door", "http://example.org/#room_door")

    def behind() -> PlanFailure:
        return BehindClosedDoor(what="door1", door=room)

    script = Script().on("OpeningAContainerArtifact", fails=behind, times=1)
    run = run_plan(fetching(behind_the_door()), script=script)
    assert run.failure is None
    assert run.attempts("OpeningAContainerArtifact") == 3
    assert run.belief.holds(Condition("open", (room,)))
    assert run.belief.holds(Condition("open", (DOOR,)))


def test_doors_that_are_each_behind_the_other_are_opened_once_each_and_the_failure_propagates() -> None:
    other = an_object("Door", "http://example.org/#door2")
    opened = []

    def behind_the_other() -> PlanFailure:
        opened.append(DOOR)
        return BehindClosedDoor(what="handle", door=other if len(opened) % 2 else DOOR)

    run = run_plan(fetching(behind_the_door()), script=Script().on("OpeningAContainerArtifact", fails=behind_the_other))
    assert isinstance(run.failure, BehindClosedDoor)
    assert len(opened) == 2


def delivering_through_a_door(**held: Object) -> PlanRun:
    """Run a plan that delivers the cup through a door, while hands hold the cup and maybe more."""
    undeliverable = ObjectUndeliverable(what="cup1")
    undeliverable.__cause__ = BehindClosedDoor(what="table1", door=DOOR)
    left = [undeliverable]

    async def grasp() -> None:
        await perform(action("ClosingAGripper", object_acted_on=CUP))

    async def deliver() -> None:
        if left:
            raise left.pop()
        await perform(action("OpeningAGripper", object_acted_on=CUP))

    async def at_the_table() -> None:
        await with_failure_handling(deliver, Recovery(ObjectUndeliverable, open_what_is_in_the_way(CUP)))

    async def plan() -> None:
        for one in held.values():
            await perform(action("ClosingAGripper", object_acted_on=one))
        await with_failure_handling(at_the_table, Recovery(ObjectLost, fetch_again(CUP, grasp)))

    full = HandsFull(what="handle", held=held)
    return run_plan(plan, script=Script().on("OpeningAContainerArtifact", fails=lambda: full, times=1))


def test_what_the_only_hand_puts_down_to_open_a_door_is_taken_up_again_before_it_is_delivered() -> None:
    run = delivering_through_a_door(arm=CUP)
    assert run.failure is None
    assert run.attempts("SettingAsideAnObject") == 1
    assert run.attempts("ClosingAGripper") == 2
    assert run.happened_before("OpeningAContainerArtifact", "OpeningAGripper")


def test_what_the_other_hand_puts_down_to_open_a_door_leaves_the_thing_to_deliver_in_its_hand() -> None:
    run = delivering_through_a_door(left=an_object("Can", "http://example.org/#can1"), right=CUP)
    assert run.failure is None
    assert run.attempts("SettingAsideAnObject") == 1
    assert run.attempts("ClosingAGripper") == 2, "each of both things once"


def test_what_is_out_of_reach_for_another_reason_stays_so() -> None:
    run = run_plan(fetching(ObjectUnreachable(what="cup1")))
    assert isinstance(run.failure, ObjectUnreachable)
    assert run.attempts("OpeningAContainerArtifact") == 0


def test_a_door_that_is_stuck_is_the_reason_of_the_failure() -> None:
    stuck = Script().on("OpeningAContainerArtifact", fails=ContainerStuck)
    run = run_plan(fetching(behind_the_door()), script=stuck)
    assert isinstance(run.failure, ContainerStuck)
    assert [type(link) for link in run.failure.chain()][1:] == [ObjectUnreachable, BehindClosedDoor]


def out_of_reach(figures: str) -> HandleNotReachable:
    """The failure of a search for a way to a handle."""
    failure = HandleNotReachable(what="door1")
    failure.__cause__ = LocationUnresolvable(designator="the handle", figures=figures)
    return failure


@pytest.mark.parametrize(
    ("failures", "attempts"),
    [
        ([out_of_reach("too low")] * 4, 2),
        ([out_of_reach("a chair is in the way"), out_of_reach("too low"), out_of_reach("too low")], 3),
        ([HandleNotReachable(what="door1")] * 4, 4),
    ],
)
def test_a_search_that_finds_the_same_once_more_is_not_repeated(failures: list[PlanFailure], attempts: int) -> None:
    tried = []

    async def opening() -> None:
        tried.append(failures[len(tried)])
        raise tried[-1]

    async def plan() -> None:
        again = Recovery(HandleNotReachable, step_back_and_repeat(DOOR), retries=3)
        await with_failure_handling(opening, again)

    assert isinstance(run_plan(plan).failure, HandleNotReachable)
    assert len(tried) == attempts


def test_a_step_that_goes_first_steps_back_from_a_handle_as_any_other() -> None:
    behind = [behind_the_door()]

    async def bring_can() -> None:
        async with using("base", in_turns=True):
            await give_turn()

    async def bring_cup() -> None:
        async with using("base", in_turns=True):
            await with_failure_handling(bring, OPENS)

    async def bring() -> None:
        if behind:
            raise behind.pop()

    async def plan() -> None:
        await par(bring_can, bring_cup)

    run = run_plan(plan, script=Script().on("OpeningAContainerArtifact", fails=HandleNotReachable, times=1))
    assert run.failure is None
    assert (run.attempts("OpeningAContainerArtifact"), run.attempts("SteppingBack")) == (2, 1)


@pytest.mark.parametrize("is_put_down", [True, False])
def test_what_a_waiting_step_holds_is_put_down_where_no_hand_is_free_for_a_handle(is_put_down: bool) -> None:
    can = an_object("DrinkingCan", "http://example.org/#can1")
    behind = [behind_the_door()]

    def no_hand() -> PlanFailure:
        return HandsFull(what="handle1", held={"right": CUP, "left": can})

    async def fetch_can() -> None:
        await perform(action("ClosingAGripper", object_acted_on=can), until=holding(can))

    async def bring_can() -> None:
        async with using("base", in_turns=True):
            await fetch_can()
            if await give_turn():
                await fetch_can()

    async def bring_cup() -> None:
        async with using("base", in_turns=True):
            await perform(action("ClosingAGripper", object_acted_on=CUP))
            await with_failure_handling(bring, OPENS)

    async def bring() -> None:
        if behind:
            raise behind.pop()

    async def plan() -> None:
        await par(bring_can, bring_cup)

    script = Script().on("OpeningAContainerArtifact", fails=no_hand, times=1 if is_put_down else None)
    if not is_put_down:
        script.on("SettingAsideAnObject", fails=ContainerStuck)
    run = run_plan(plan, script=script)
    aside = [event["action"] for event in run.trace.events if "SettingAside" in str(event.get("action"))]
    assert str(aside[0]).startswith("SettingAsideAnObject(object_acted_on=can1,"), "which has been held for longer"
    assert isinstance(run.failure, HandsFull) != is_put_down
    assert sorted(run.belief.holding) == ["can1", "cup1"]
    assert run.attempts("ClosingAGripper") == (3 if is_put_down else 2)


def test_the_failure_says_what_is_behind_which_door() -> None:
    said = str(BehindClosedDoor(designator="in_reach_of(cup1)", what="cup1", door=DOOR))
    assert said == "no place found for in_reach_of(cup1): cup1 is behind door1, which is closed"


FIRST = action("ClosingAContainerArtifact", object_acted_on=DOOR)


@pytest.mark.parametrize("can_do", [True, False])
@pytest.mark.parametrize(("strategy", "steps"), [(open_what_is_in_the_way, 0), (step_back_and_repeat, 1)])
def test_what_the_search_found_to_make_a_way_is_done_first(
    strategy: Callable[[Object], Any], steps: int, can_do: bool
) -> None:
    left = [PlanFailure("out of reach")]

    async def body() -> None:
        if left:
            raise left.pop() from LocationUnresolvable(designator="in_reach_of(cup1)", first=FIRST)

    async def plan() -> None:
        await with_failure_handling(body, Recovery(PlanFailure, strategy(CUP)))

    script = Script() if can_do else Script().on("ClosingAContainerArtifact", fails=ContainerStuck)
    run = run_plan(plan, script=script)
    assert run.attempts("ClosingAContainerArtifact") == 1
    assert run.attempts("SteppingBack") == (0 if can_do else steps)
    assert (run.failure is None) == (can_do or steps == 1)
