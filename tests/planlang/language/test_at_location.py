"""at_location: places tried, failures cured by another place, nesting, displacement."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import (
    HandsFull,
    LocationUnresolvable,
    ManipulationPoseUnreachable,
    NavigationGoalNotReached,
    ObjectLost,
    ObjectNotFound,
    ObjectUndeliverable,
    ObjectUnreachable,
)
from tests.support.refusals import failing

CUP = an_object("Cup", "http://example.org/map#cup1")
BED = an_object("Bed-PieceOfFurniture")
NEAR_CUP = a_location(in_reach_of=CUP)


def test_the_body_runs_at_the_first_solution_and_its_result_is_returned(executive: Any) -> None:
    async def body() -> str:
        assert executive.base == (1.0, 0.0, 0.0)
        return "done"

    assert go(partial(at_location, NEAR_CUP, body), executive) == "done"
    assert executive.log == ["at 1"]


def test_what_shall_be_reached_joins_the_location(executive: Any) -> None:
    grasp = a_location(in_center_of=CUP)

    async def body() -> None: ...

    go(partial(at_location, NEAR_CUP, body, reaching=(grasp,)), executive)
    assert executive.asked == [NEAR_CUP & a_location(in_reach_of=grasp)]


def test_another_arm_than_that_of_the_place_is_said_of_what_it_shall_reach(executive: Any) -> None:
    right, left = a_device("RightArm"), a_device("LeftArm")
    grasp = a_location(in_center_of=CUP)

    async def body() -> None: ...

    place = NEAR_CUP & a_location(near=BED, using=right)
    go(partial(at_location, place, body, reaching=(grasp,), device=left), executive)
    assert executive.asked == [place & a_location(in_reach_of=a_location(in_center_of=CUP, using=left))]
    with pytest.raises(ValueError, match="one location names two arms"):
        go(partial(at_location, place, body, reaching=(CUP,), device=left), executive)


def test_a_failure_that_another_place_cures_tries_the_next_place(executive: Any) -> None:
    async def body() -> float:
        if executive.base[0] == 1.0:
            raise ManipulationPoseUnreachable(arm="right")
        return float(executive.base[0])

    assert go(partial(at_location, NEAR_CUP, body), executive) == 2.0
    assert executive.log == ["at 1", "at 2"]


def test_before_a_retry_the_robot_takes_the_posture_that_the_executive_names(executive: Any, module: Any) -> None:
    async def carry(wanted: Any) -> None:
        executive.log.append("carrying")

    executive.extra.append(module("arm", ("Reaching",), carry))
    executive.retry_actions = (action("Reaching"),)

    async def body() -> None:
        if executive.base[0] == 1.0:
            raise ManipulationPoseUnreachable

    go(partial(at_location, NEAR_CUP, body), executive)
    assert executive.log == ["at 1", "carrying", "at 2"]


def test_other_failures_go_outward_at_once(executive: Any) -> None:
    async def body() -> None:
        raise ObjectNotFound(what="cup1")

    with pytest.raises(ObjectNotFound):
        go(partial(at_location, NEAR_CUP, body), executive)
    assert executive.log == ["at 1"]


def test_exhausted_places_raise_object_unreachable_that_explains_itself_down_to_the_last_failure(
    executive: Any,
) -> None:
    async def body() -> None:
        raise ManipulationPoseUnreachable(what=f"cup from {executive.base[0]:g}")

    with failing(ObjectUnreachable, what="cup1") as caught:
        go(partial(at_location, NEAR_CUP, body), executive)
    unresolvable, last = list(caught.value.chain())[1:3]
    assert isinstance(unresolvable, LocationUnresolvable)
    assert isinstance(last, ManipulationPoseUnreachable)
    assert last.what == "cup from 2"


def test_attempts_bound_the_number_of_places(executive: Any) -> None:
    executive.places = [(float(x), 0.0, 0.0) for x in range(1, 9)]

    async def body() -> None:
        raise ManipulationPoseUnreachable

    with pytest.raises(ObjectUnreachable):
        go(partial(at_location, NEAR_CUP, body, attempts=3), executive)
    assert executive.log == ["at 1", "at 2", "at 3"]


def test_while_something_is_held_the_failure_is_object_undeliverable(executive: Any) -> None:
    executive.holding = ["bottle1"]

    async def body() -> None:
        raise ManipulationPoseUnreachable

    with failing(ObjectUndeliverable, what="bottle1"):
        go(partial(at_location, NEAR_CUP, body), executive)


@pytest.mark.parametrize(("in_hand", "failure"), [(False, ObjectUnreachable), (True, ObjectUndeliverable)])
def test_what_is_yet_to_be_grasped_is_unreachable_whatever_else_is_held(
    executive: Any, in_hand: bool, failure: type[Exception]
) -> None:
    executive.holding, executive.facts[str(holding(CUP))] = ["bottle1"], in_hand

    async def body() -> None:
        raise ManipulationPoseUnreachable

    with failing(failure, what="bottle1" if in_hand else "cup1"):
        go(partial(at_location, NEAR_CUP, body, reaching=(a_location(in_center_of=CUP),)), executive)


def test_where_no_hand_is_free_the_failure_says_what_cannot_be_reached_with_full_hands(executive: Any) -> None:
    executive.holding = ["bottle1"]

    def solutions(location: Any) -> Any:
        raise HandsFull(what="cup1", held={"right": CUP})

    async def body() -> None:
        pytest.fail("there is no place to run this at")

    executive.solutions = solutions
    with failing(ObjectUndeliverable, what="bottle1") as caught:
        go(partial(at_location, NEAR_CUP, body), executive)
    assert "cannot be reached with full hands" in str(caught.value)


def test_no_place_at_all_raises_object_unreachable_from_location_unresolvable(executive: Any) -> None:
    executive.places = []

    async def body() -> None:
        pytest.fail("there is no place to run this at")

    with pytest.raises(ObjectUnreachable) as caught:
        go(partial(at_location, NEAR_CUP, body), executive)
    assert isinstance(caught.value.__cause__, LocationUnresolvable)


def test_places_near_one_that_failed_are_skipped_until_the_belief_changes(executive: Any) -> None:
    executive.places = [(1.0, 0.0, 0.0), (1.04, 0.0, 0.0), (1.0, 0.0, 3.0), (2.0, 0.0, 0.0)]

    async def body() -> None:
        raise ManipulationPoseUnreachable

    with pytest.raises(ObjectUnreachable):
        go(partial(at_location, NEAR_CUP, body), executive)
    assert executive.log == ["at 1", "at 2"]

    async def seen_anew() -> None:
        executive.belief += 1
        raise ManipulationPoseUnreachable

    executive.log.clear()
    with pytest.raises(ObjectUnreachable):
        go(partial(at_location, NEAR_CUP, seen_anew, attempts=3), executive)
    assert executive.log == ["at 1", "at 1", "at 1"]


def test_a_nested_scope_moves_the_base_and_the_outer_place_is_taken_again(executive: Any) -> None:
    async def inner() -> None:
        executive.log.append("inner")

    async def outer() -> None:
        executive.places = [(5.0, 0.0, 0.0)]
        await at_location(a_location(in_reach_of=BED), inner)
        executive.log.append(f"outer at {executive.base[0]:g}")

    go(partial(at_location, NEAR_CUP, outer), executive)
    assert executive.log == ["at 1", "at 5", "inner", "at 1", "outer at 1"]


def test_after_a_failed_nested_scope_the_next_step_outside_it_goes_back_first(executive: Any, module: Any) -> None:
    async def reach(wanted: Any) -> None:
        executive.log.append(f"reach at {executive.base[0]:g}")

    executive.extra.append(module("arm", ("Reaching",), reach))

    async def inner() -> None:
        raise ObjectNotFound

    async def outer() -> None:
        executive.places = [(5.0, 0.0, 0.0)]
        try:
            await at_location(a_location(in_reach_of=BED), inner)
        except ObjectNotFound:
            await perform(action("Reaching"))

    go(partial(at_location, NEAR_CUP, outer), executive)
    assert executive.log == ["at 1", "at 5", "at 1", "reach at 1"]


def test_scopes_side_by_side_take_turns(executive: Any) -> None:
    async def body(name: str) -> None:
        executive.log.append(f"{name} begins")
        await sleep(1)
        executive.log.append(f"{name} ends")

    async def both() -> None:
        scopes = [partial(at_location, NEAR_CUP, partial(body, name)) for name in ("a", "b")]
        await par(*scopes)

    go(both, executive)
    assert executive.log == ["at 1", "a begins", "a ends", "at 1", "b begins", "b ends"]


def test_nested_scopes_side_by_side_inside_one_take_turns_too(executive: Any) -> None:
    async def body(name: str) -> None:
        executive.log.append(f"{name} begins")
        await sleep(1)
        executive.log.append(f"{name} ends")

    async def both() -> None:
        scopes = [partial(at_location, NEAR_CUP, partial(body, name)) for name in ("a", "b")]
        await par(*scopes)

    go(partial(at_location, NEAR_CUP, both), executive)
    assert [line for line in executive.log if not line.startswith("at")] == ["a begins", "a ends", "b begins", "b ends"]


def test_a_base_that_something_else_moves_is_put_back_and_the_body_runs_again(executive: Any) -> None:
    runs: list[str] = []

    async def body() -> str:
        runs.append("begun")
        await sleep(2)
        runs.append("ended")
        return "done"

    async def push() -> None:
        await sleep(1)
        executive.base = (9.0, 9.0, 0.0)

    async def both() -> Any:
        return await par(partial(at_location, NEAR_CUP, body), push)

    assert go(both, executive)[0] == "done"
    assert runs == ["begun", "begun", "ended"]
    assert executive.log == ["at 1", "at 1"]


def test_a_base_that_never_stays_is_a_navigation_failure(executive: Any) -> None:
    async def body() -> None:
        await sleep(100)

    async def push() -> None:
        while True:
            await sleep(1)
            executive.base = (9.0, 9.0, 0.0)

    async def both() -> None:
        await par(partial(at_location, NEAR_CUP, body, attempts=1), push)

    with pytest.raises(ObjectUnreachable) as caught:
        go(both, executive)
    assert isinstance(caught.value.__cause__, NavigationGoalNotReached)
    assert executive.log == ["at 1"] * 11


def test_a_base_motion_of_the_body_itself_is_no_displacement(executive: Any) -> None:
    async def body() -> None:
        await perform(action("Translation-LocationChange", x=7.0))
        await sleep(2)
        executive.log.append("done")

    go(partial(at_location, NEAR_CUP, body), executive)
    assert executive.log == ["at 1", "at 7", "done"]


def test_each_place_and_its_failure_is_in_the_trace(executive: Any) -> None:
    async def body() -> None:
        if executive.base[0] == 1.0:
            raise ManipulationPoseUnreachable(arm="right")

    trace = Trace()
    go(partial(at_location, NEAR_CUP, body), executive, trace=trace)
    told = [(e["event"], e["base"]) for e in trace.events if e["event"] in ("solution", "pose failed")]
    assert told == [("solution", [1.0, 0.0, 0.0]), ("pose failed", [1.0, 0.0, 0.0]), ("solution", [2.0, 0.0, 0.0])]


def opening(executive: Any, module: Any, log: list[str]) -> Any:
    async def let_go(wanted: Any) -> None:
        log.append("open")

    executive.extra.append(module("gripper", ("OpeningAGripper",), let_go))
    return partial(perform, action("OpeningAGripper"))


def test_a_step_that_lets_go_is_not_repeated_while_something_is_held(executive: Any, module: Any) -> None:
    log: list[str] = []
    open_gripper = opening(executive, module, log)

    async def body() -> None:
        await open_gripper()
        executive.holding.append("cup1")
        raise ManipulationPoseUnreachable(arm="right")

    with pytest.raises(ObjectUndeliverable, match="cup1 is still held") as caught:
        go(partial(at_location, NEAR_CUP, body), executive)
    assert log == ["open"]
    assert isinstance(caught.value.__cause__, ManipulationPoseUnreachable)


def test_a_step_that_lets_go_is_repeated_while_nothing_is_held(executive: Any, module: Any) -> None:
    log: list[str] = []
    open_gripper = opening(executive, module, log)

    async def body() -> None:
        await open_gripper()
        if executive.base[0] == 1.0:
            raise ManipulationPoseUnreachable(arm="right")

    go(partial(at_location, NEAR_CUP, body), executive)
    assert log == ["open", "open"]


def test_a_step_that_lets_go_runs_in_a_second_try_if_the_first_did_not_come_to_it(executive: Any, module: Any) -> None:
    log: list[str] = []
    open_gripper = opening(executive, module, log)
    executive.holding.append("cup1")

    async def body() -> None:
        if executive.base[0] == 1.0:
            raise ManipulationPoseUnreachable(arm="right")
        await open_gripper()

    go(partial(at_location, NEAR_CUP, body), executive)
    assert log == ["open"]


TABLE = an_object("Table", "http://example.org/map#table1")


async def nothing() -> None: ...


def test_a_nested_scope_that_finds_no_place_leaves_the_outer_place_alone(executive: Any) -> None:
    nowhere = a_location(in_reach_of=TABLE)
    solutions = executive.solutions
    executive.solutions = lambda location: iter(()) if location is nowhere else solutions(location)

    async def body() -> str:
        try:
            await at_location(nowhere, nothing)
        except ObjectUnreachable as failure:
            return failure.what
        return "reached"

    assert go(partial(at_location, NEAR_CUP, body), executive) == "table1"
    assert executive.log == ["at 1"]


@pytest.mark.parametrize(
    ("raised", "arrives"), [(ManipulationPoseUnreachable, ObjectUnreachable), (ObjectNotFound, ObjectNotFound)]
)
def test_a_failure_on_the_way_to_another_place_is_handled_as_one_at_it(
    executive: Any, module: Any, raised: type[PlanFailure], arrives: type[PlanFailure]
) -> None:
    async def fails(wanted: Any) -> None:
        raise raised

    executive.extra.append(module("arm", ("Tucking",), fails))
    executive.retry_actions = (action("Tucking"),)

    async def body() -> None:
        raise ManipulationPoseUnreachable

    with pytest.raises(arrives):
        go(partial(at_location, NEAR_CUP, body), executive)


def test_a_location_that_is_about_no_object_is_named_itself(executive: Any) -> None:
    executive.places = []
    with pytest.raises(ObjectUnreachable) as caught:
        go(partial(at_location, a_posture("carrying"), nothing), executive)
    assert "carrying" in str(caught.value.what)


def test_a_place_that_cannot_be_watched_fails_the_scope(executive: Any) -> None:
    def is_at(solution: Any) -> bool:
        raise ObjectLost(what="the base")

    executive.is_at = is_at
    ended: list[str] = []

    async def body() -> None:
        try:
            await sleep(5)
        finally:
            ended.append("body")

    with pytest.raises(ObjectLost):
        go(partial(at_location, NEAR_CUP, body), executive)
    assert ended == ["body"]


def test_what_must_not_be_repeated_ends_the_scope_with_its_failure_once_it_has_begun(
    executive: Any, module: Any
) -> None:
    async def stir(wanted: Any) -> None:
        executive.log.append("stirring")

    executive.extra.append(module("stirring", ("Stirring",), stir))

    async def body() -> None:
        if executive.base[0] == 1.0:
            raise ManipulationPoseUnreachable  # nothing was stirred yet: the next place is tried
        await perform(action("Stirring"), once=True)
        raise ManipulationPoseUnreachable(arm="right")

    with pytest.raises(ManipulationPoseUnreachable):
        go(partial(at_location, NEAR_CUP, body, attempts=5), executive)
    assert executive.log == ["at 1", "at 2", "stirring"]


def test_what_must_not_be_repeated_inside_a_nested_scope_ends_the_outer_one_too(executive: Any, module: Any) -> None:
    async def stir(wanted: Any) -> None:
        executive.log.append("stirring")

    executive.extra.append(module("stirring", ("Stirring",), stir))

    async def body() -> None:
        await at_location(NEAR_CUP, partial(perform, action("Stirring"), once=True))
        raise ManipulationPoseUnreachable

    with pytest.raises(ManipulationPoseUnreachable):
        go(partial(at_location, NEAR_CUP, body), executive)
    assert executive.log.count("stirring") == 1
