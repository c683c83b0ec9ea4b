"""Facts of CRAM's own tests of process modules, P1-P8 and P13-P15; and resources. The others: test_requests."""

from __future__ import annotations

from functools import partial
from typing import Any

import hypothesis
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from virtual_time import go

from planlang import *
from planlang.failures import ActionUnresolvable, GraspMissed, ManipulationFailure, ObjectNotFound
from planlang.runs import with_paths
from tests.support.examples import examples
from tests.support.refusals import failing

REACH = action("Reaching")


@pytest.fixture
def arm(executive: Any, module: Any) -> Any:
    """An arm that takes a second for each motion and notes what it does."""

    async def move(wanted: Action) -> str:
        executive.log.append(f"begins {wanted.get('speed') or ''}".strip() + f" {now():g}")
        try:
            await sleep(1)
        except BaseException:
            executive.log.append(f"stops {now():g}")
            raise
        return "moved"

    scripted = module("arm", ("Reaching",), move, (ManipulationFailure,), ("right_arm",))
    executive.extra.append(scripted)
    return scripted


def test_p1_a_request_returns_what_the_module_returns(executive: Any, arm: Any) -> None:
    assert go(partial(perform, REACH), executive) == "moved"


def test_p2_a_module_works_on_one_request_at_a_time_first_come_first_served(executive: Any, arm: Any) -> None:
    async def plan() -> None:
        await par(*[partial(perform, action("Reaching", speed=speed)) for speed in ("a", "b", "c")])

    go(plan, executive)
    assert executive.log == ["begins a 0", "begins b 1", "begins c 2"]


def test_p3_two_modules_without_common_resources_work_side_by_side(executive: Any, arm: Any, module: Any) -> None:
    async def look(wanted: Action) -> None:
        await sleep(1)

    executive.extra.append(module("head", ("LookingForSomething",), look, (), ("head",)))

    async def plan() -> float:
        await par(partial(perform, REACH), partial(perform, action("LookingForSomething")))
        return now()

    assert go(plan, executive) == 1.0


def test_p4_two_modules_with_a_common_resource_take_turns(executive: Any, arm: Any, module: Any) -> None:
    async def lift(wanted: Action) -> None:
        await sleep(1)

    executive.extra.append(module("lift", ("Lifting",), lift, (), ("torso", "right_arm")))

    async def plan() -> float:
        await par(partial(perform, REACH), partial(perform, action("Lifting")))
        return now()

    assert go(plan, executive) == 2.0


def test_p5_the_failure_reaches_the_caller_as_the_same_object(executive: Any, module: Any) -> None:
    failure = GraspMissed(arm="right")

    async def closes(wanted: Action) -> None:
        raise failure

    executive.extra.append(module("gripper", ("ClosingAGripper",), closes, (GraspMissed,)))
    with pytest.raises(GraspMissed) as caught:
        go(partial(par, partial(perform, action("ClosingAGripper"))), executive)
    assert caught.value is failure


def test_p6_a_failure_that_the_module_does_not_declare_is_a_programming_error(executive: Any, module: Any) -> None:
    async def closes(wanted: Action) -> None:
        raise ObjectNotFound

    executive.extra.append(module("gripper", ("ClosingAGripper",), closes, (GraspMissed,)))
    with pytest.raises(PlanStructureError, match=r"gripper raised ObjectNotFound.*declared: GraspMissed"):
        go(partial(perform, action("ClosingAGripper")), executive)


def test_p7_evaporating_the_caller_stops_the_work_and_frees_the_module_after_its_cleanup(
    executive: Any, module: Any
) -> None:
    async def brake() -> None:
        await sleep(0.5)
        executive.log.append(f"stopped {now():g}")

    async def drive(wanted: Action) -> None:
        executive.log.append(f"begins {now():g}")
        await unwind_protect(partial(sleep, 10), brake)

    executive.extra.append(module("arm", ("Reaching",), drive))

    async def plan() -> None:
        await pursue(partial(perform, REACH), partial(sleep, 1))
        await pursue(partial(perform, REACH), partial(sleep, 1))

    go(plan, executive)
    assert executive.log == ["begins 0", "stopped 1.5", "begins 1.5", "stopped 3"]


def test_p8_an_evaporated_caller_that_waits_for_its_turn_leaves_the_queue(executive: Any, arm: Any) -> None:
    async def plan() -> float:
        await par(partial(perform, REACH), partial(pursue, partial(perform, REACH), partial(sleep, 0.5)))
        await perform(REACH)
        return now()

    assert go(plan, executive) == 2.0


def test_p13_suspending_the_caller_stops_the_work_and_makes_the_request_again(executive: Any, arm: Any) -> None:
    async def plan() -> None:
        handle = task("reach")

        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(handle):
                await sleep(2)

        await par(partial(tag, "reach", partial(perform, REACH)), control)

    go(plan, executive)
    assert executive.log == ["begins 0", "stops 0.5", "begins 2.5"]


def test_p14_while_a_caller_is_suspended_the_request_of_another_may_run(executive: Any, arm: Any) -> None:
    async def plan() -> None:
        handle = task("first")

        async def second() -> None:
            await sleep(0.1)
            await perform(action("Reaching", speed="second"))

        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(handle):
                await sleep(0.2)
            await sleep(0)

        await par(
            partial(tag, "first", partial(perform, action("Reaching", speed="first"))),
            second,
            control,
        )

    go(plan, executive)
    assert executive.log == ["begins first 0", "stops 0.5", "begins second 0.5", "begins first 1.5"]


def test_p15_the_module_of_the_nearest_ancestor_wins(executive: Any, module: Any) -> None:
    def says(word: str) -> Any:
        async def speak(wanted: Action) -> str:
            return word

        return speak

    executive.parents["ReachingForACup"] = ("Reaching", "Movement")
    executive.extra += [module("any", ("Movement",), says("general")), module("arm", ("Reaching",), says("special"))]
    assert go(partial(perform, action("ReachingForACup")), executive) == "special"
    assert go(partial(perform, action("Movement")), executive) == "general"


def test_an_action_that_nothing_performs_is_a_plan_failure_with_its_text(executive: Any) -> None:
    with failing(ActionUnresolvable, designator="Cooking(what=soup)"):
        go(partial(perform, action("Cooking", what="soup")), executive)


def test_performing_without_an_executive_says_how_to_run_the_plan() -> None:
    with pytest.raises(PlanStructureError, match="executive="):
        go(partial(perform, REACH))


def test_perform_prefers_a_module_and_otherwise_runs_the_branch(executive: Any, arm: Any) -> None:
    async def recipe() -> str:
        return "by the recipe"

    assert go(partial(perform, REACH, otherwise=recipe), executive) == "moved"
    assert go(partial(perform, action("Cooking"), otherwise=recipe), executive) == "by the recipe"
    assert go(partial(perform, REACH, otherwise=recipe)) == "by the recipe"


def test_a_request_is_named_in_the_tree_and_told_in_the_trace(executive: Any, arm: Any) -> None:
    async def serve() -> None:
        await perform(REACH, name="reach for the cup")
        await perform(REACH)

    trace = Trace()
    go(serve, executive, trace=trace)
    requests = [(e["path"], e["module"]) for e in with_paths(trace.events) if e["event"] == "request"]
    assert requests == [("serve/reach for the cup/arm", "arm"), ("serve/Reaching/arm", "arm")]


def test_resources_are_granted_in_order_of_asking_all_at_once() -> None:
    log: list[str] = []

    async def user(name: str, resources: tuple[str, ...], start: float) -> None:
        await sleep(start)
        async with using(*resources):
            log.append(f"{name} {now():g}")
            await sleep(1)

    async def plan() -> None:
        await par(
            partial(user, "left", ("left",), 0),
            partial(user, "both", ("left", "right"), 0.1),
            partial(user, "right", ("right",), 0.2),
        )

    go(plan)
    assert log == ["left 0", "both 1", "right 2"]


def test_resources_asked_for_in_different_textual_orders_do_not_deadlock() -> None:
    async def user(*resources: str) -> None:
        for _ in range(3):
            async with using(*resources):
                await sleep(0.1)

    go(partial(par, partial(user, "a", "b"), partial(user, "b", "a"), partial(user, "b", "c", "a")))


def test_resources_are_released_on_evaporation() -> None:
    async def holds() -> None:
        async with using("arm"):
            await sleep(10)

    async def plan() -> float:
        await pursue(holds, partial(sleep, 1))
        async with using("arm"):
            return now()

    assert go(plan) == 1.0


def test_who_holds_a_resource_may_ask_for_it_again_and_branches_inside_take_turns() -> None:
    log: list[str] = []

    async def step(name: str) -> None:
        async with using("base"):
            log.append(f"{name} {now():g}")
            await sleep(1)

    async def plan() -> None:
        async with using("base"):
            await par(partial(step, "a"), partial(step, "b"))

    go(plan)
    assert log == ["a 0", "b 1"]


def test_a_deadlock_over_nested_resources_is_reported_by_name() -> None:
    async def user(first: str, second: str) -> None:
        async with using(first):
            await sleep(1)
            async with using(second):
                pass

    with pytest.raises(DeadlockError, match=r"user waits for right \(held by par/par/user#2\) at test_performing"):
        go(partial(par, partial(user, "left", "right"), partial(user, "right", "left")))


def test_a_held_task_gets_no_turn_until_it_wakes_up() -> None:
    log: list[str] = []

    async def user(name: str) -> None:
        async with using("arm"):
            log.append(f"{name} {now():g}")
            await sleep(1)

    async def plan() -> None:
        handle = task("second")

        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(handle):
                await sleep(5)

        async def third() -> None:
            await sleep(0.25)  # after the second has asked
            await user("third")

        await par(partial(user, "first"), partial(tag, "second", partial(user, "second")), third, control)

    go(plan)
    assert log == ["first 0", "third 1", "second 5.5"]


def test_an_executive_may_write_where_there_is_no_trace(executive: Any) -> None:
    async def top() -> str:
        executive.write("seen", {"what": "cup"})
        return "written"

    assert go(top, executive) == "written"
    trace = Trace()
    go(top, executive, trace=trace)
    assert [event["what"] for event in trace.events if event["event"] == "seen"] == ["cup"]


def test_resources_are_in_the_trace_when_granted_and_released_on_evaporation_too() -> None:
    async def holds() -> None:
        async with using("left_arm", "base"):
            await sleep(9)

    trace = Trace()
    go(partial(pursue, holds, partial(sleep, 1)), trace=trace)
    told = [(e["step"], e["event"], e["path"], e["resources"]) for e in with_paths(trace.events) if "resources" in e]
    assert told == [
        (0, "acquired", "pursue/pursue/holds", ["left_arm", "base"]),
        (240, "released", "pursue/pursue/holds", ["left_arm", "base"]),
    ]


@settings(max_examples=examples(60), deadline=None)
@hypothesis.given(
    users=st.lists(
        st.tuples(st.integers(0, 3), st.integers(1, 3), st.lists(st.sampled_from("abc"), min_size=1, max_size=3)),
        min_size=1,
        max_size=6,
    ),
    schedule=st.one_of(st.none(), st.integers(0, 99)),
)
def test_a_resource_has_one_holder_and_requests_never_deadlock(users: Any, schedule: int | None) -> None:
    held: set[str] = set()

    async def user(start: int, long: int, names: list[str]) -> None:
        await sleep(start)
        async with using(*names):
            assert not held & set(names)
            held.update(names)
            await sleep(long)
            held.difference_update(names)

    go(partial(par, *(partial(user, *one) for one in users)), schedule=schedule)
    assert held == set()
