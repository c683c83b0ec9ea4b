"""State that a resumed run takes over from the completed steps, and the traces that cannot be resumed."""

from __future__ import annotations

import enum
from contextlib import suppress
from functools import partial
from typing import Any

import pytest
from cut_runs import completed, cut, without_mark

from planlang import *
from planlang.failures import BudgetExceeded, GraspMissed, ManipulationPoseUnreachable
from planlang.runs import Different
from planlang.testing import Script, replay, run_plan

# What steps leave behind


def test_plan_time_goes_on_where_it_stood_and_budgets_have_what_was_left() -> None:
    async def slow() -> float:
        await perform(action("Perceiving"))
        await sleep(2.0)
        return now()

    @plan
    async def top() -> None:
        await slow()
        await seq(slow)
        await sleep(1.0)
        await seq(slow)

    async def bounded() -> None:
        await budget(top, seconds=9.5)

    whole = run_plan(bounded, resumable=True)
    assert isinstance(whole.failure, BudgetExceeded)
    for records in completed(whole):
        again = run_plan(bounded, resume=cut(whole, records))
        assert isinstance(again.failure, BudgetExceeded)
        assert again.failure.spent == whole.failure.spent == {"Perceiving": 3.0}
        assert again.seconds == whole.seconds == 9.5


def test_attempts_that_were_used_stay_used() -> None:
    async def missing() -> None:
        raise GraspMissed(what="cup")

    async def trying() -> None:
        with_retries = partial(with_failure_handling, missing, Recovery(GraspMissed, retries=2))
        try:
            await seq(with_retries)
        except GraspMissed:
            await sleep(1)

    @plan
    async def top() -> None:
        await trying()
        await trying()

    async def bounded() -> None:
        await budget(top, attempts=3)

    whole = run_plan(bounded, resumable=True)
    assert isinstance(whole.failure, BudgetExceeded)
    assert whole.failure.used == {"with_failure_handling": 3}
    again = run_plan(bounded, resume=cut(whole, completed(whole)[0]))
    assert isinstance(again.failure, BudgetExceeded)
    assert again.failure.used == whole.failure.used


def test_a_fluent_that_a_completed_step_has_set_has_its_value_again() -> None:
    opened = []

    def top(door: Fluent[bool]) -> Any:
        async def open_door() -> None:
            await sleep(1)
            opened.append(True)
            door.set(True)

        async def go_through() -> bool | None:
            return await wait_for(door, 5)

        @plan
        async def going() -> Any:
            await seq(open_door)
            return await seq(go_through)

        return going

    whole = run_plan(top(Fluent(False, "the door is open")), resumable=True)
    again = run_plan(top(Fluent(False, "the door is open")), resume=cut(whole, completed(whole)[0]))
    assert again.value == (True,)
    assert len(opened) == 1


def test_steps_that_completed_at_one_time_are_taken_over_in_the_order_in_which_they_completed() -> None:
    mark = Fluent(0, "mark of the last one")

    async def first() -> None:
        await sleep(1)
        await sleep(0)
        mark.set(1)

    async def second() -> None:
        await sleep(1)
        mark.set(2)

    @plan
    async def top() -> int:
        await partial_order({"first": first, "second": second}, [])
        await sleep(1)
        return mark.value

    whole = run_plan(top, resumable=True)
    assert whole.value == 1
    mark.set(0)
    assert run_plan(top, resume=cut(whole, completed(whole)[1])).value == 1


def test_a_step_that_was_cut_short_has_not_completed_whatever_it_returns() -> None:
    async def fails() -> None:
        await sleep(1)
        raise GraspMissed

    async def swallows() -> str:
        with suppress(BaseException):
            await sleep(9)
        return "half done"

    @plan
    async def top() -> None:
        with suppress(GraspMissed):
            await partial_order({"swallows": swallows, "fails": fails}, [])

    run = run_plan(top, resumable=True)
    assert [e["name"] for e in run.trace.events if e["event"] == "completed"] == ["fails", "partial_order"]


def test_a_fluent_without_a_name_that_a_step_sets_stops_resumption_before_that_step() -> None:
    door = Fluent(False)

    async def open_door() -> None:
        door.set(True)

    async def idle() -> None:
        await sleep(1)

    @plan
    async def top() -> None:
        await seq(idle)
        await seq(open_door)
        await seq(idle)

    whole = run_plan(top, resumable=True)
    lost = [event["lost"] for event in whole.trace.events if "lost" in event]
    assert lost[0].endswith("does not survive JSON: a fluent without a name, which is from outside of the step")
    again = run_plan(top, resume=cut(whole, len(whole.trace.events) - 2))
    (mark,) = (event for event in again.trace.events if event["event"] == "resumed")
    assert mark["step"] == 240


def test_a_result_that_does_not_survive_json_is_told_and_stops_resumption_before_its_step() -> None:
    done = []

    async def plain() -> int:
        done.append("plain")
        await sleep(1)
        return 1

    async def odd() -> object:
        done.append("odd")
        await sleep(1)
        return object()

    @plan
    async def top() -> None:
        await seq(plain)
        await seq(odd)
        await seq(plain)

    whole = run_plan(top, resumable=True)
    assert [(e["name"], e["lost"]) for e in whole.trace.events if e["event"] == "completed" and "lost" in e] == [
        ("odd", "its result, or what it left behind, does not survive JSON: builtins.object"),
        ("seq#2", "its result, or what it left behind, does not survive JSON: builtins.object"),
    ]
    done.clear()
    run_plan(top, resume=cut(whole, len(whole.trace.events) - 2))
    assert done == ["odd", "plain"]


def test_a_failure_that_the_plan_has_handled_is_raised_again_and_not_run_into_again() -> None:
    done = []

    async def failing() -> None:
        done.append("failing")
        await sleep(1)
        raise ManipulationPoseUnreachable(what="cup") from ValueError("17")

    @plan
    async def top() -> str:
        try:
            await seq(failing)
        except ManipulationPoseUnreachable as failure:
            told = f"{failure}, {failure.where}, {failure.__cause__!r}"
        await seq(partial(sleep, 1))
        return told

    whole = run_plan(top, resumable=True)
    again = run_plan(top, resume=cut(whole, completed(whole)[-1]))
    assert again.value == whole.value
    assert done == ["failing"]
    assert without_mark(again) == whole.trace.events


class Light(enum.Enum):
    RED = "red"
    GREEN = "green"


def test_completed_states_of_a_state_machine_give_their_outcomes_enum_members_too() -> None:
    done: list[str] = []

    async def watch() -> Light:
        await sleep(1)
        done.append("watch")
        return Light.GREEN if now() > 3 else Light.RED

    async def wait() -> str:
        await sleep(1)
        done.append("wait")
        return "waited"

    async def go() -> str:
        return "gone"

    @plan
    async def top() -> Any:
        cases: Any = {("watch", Light.RED): "wait", ("watch", Light.GREEN): "go", ("wait", "waited"): "watch"}
        return await state_machine({"watch": watch, "wait": wait, "go": go}, cases, "watch", "go")

    whole = run_plan(top, resumable=True)
    assert (whole.value, done) == ("gone", ["watch", "wait", "watch", "wait", "watch"])
    for number, records in enumerate(completed(whole)):
        done.clear()
        again = run_plan(top, resume=cut(whole, records))
        assert again.value == "gone"
        assert len(done) == max(0, 4 - number)
        assert without_mark(again) == whole.trace.events


def test_a_tagged_step_that_has_completed_can_be_joined() -> None:
    async def fetch() -> str:
        await sleep(1)
        return "cup"

    @plan
    async def top() -> Any:
        await tag("fetch", fetch)
        await seq(partial(sleep, 1))
        return task("fetch").status.value.value, await join(task("fetch"))

    whole = run_plan(top, resumable=True)
    again = run_plan(top, resume=cut(whole, completed(whole)[-1]))
    assert again.value == whole.value == ("succeeded", "cup")


def test_belief_and_rules_of_a_script_go_on_where_they_were() -> None:
    script = Script().on("ClosingAGripper", fails=GraspMissed, times=1).holding("spoon")
    cup = an_object("Cup")

    @plan
    async def top() -> None:
        grasp = partial(perform, action("ClosingAGripper", object_acted_on=cup))
        await at_location(
            a_location(in_reach_of=cup), partial(with_failure_handling, grasp, Recovery(GraspMissed, retries=2))
        )
        await perform(action("ClosingAGripper", object_acted_on=an_object("Fork")))

    whole = run_plan(top, script=script, resumable=True)
    for records in completed(whole):
        again = run_plan(top, script=script, resume=cut(whole, records))
        assert again.belief.holding == whole.belief.holding == ["spoon", "Cup", "Fork"]
        assert without_mark(again) == whole.trace.events


@pytest.mark.parametrize("schedule", [0, 1, 2, [1, 0, 1, 1, 0, 1]])
def test_choices_of_a_schedule_go_on_where_they_were(schedule: Any) -> None:
    order: list[int] = []

    async def mark(number: int) -> None:
        for _ in range(3):
            order.append(number)
            await sleep(0.1)

    @plan
    async def top() -> None:
        for _ in range(3):
            await par(*(partial(mark, number) for number in range(4)))

    whole = run_plan(top, schedule=schedule, resumable=True)
    all_of_it = list(order)
    for records in completed(whole):
        order.clear()
        again = run_plan(top, schedule=schedule, resume=cut(whole, records))
        assert without_mark(again) == whole.trace.events
        assert order == all_of_it[len(all_of_it) - len(order) :]


# What cannot be resumed


def test_a_trace_of_another_run_is_refused_with_the_differences() -> None:
    @plan
    async def top() -> None:
        await seq(partial(sleep, 1))

    @plan
    async def other() -> None:
        await seq(partial(sleep, 1))

    run = run_plan(top, resumable=True)
    with pytest.raises(ValueError, match="seed was 0 and is 1; schedule was None and is 3"):
        run_plan(top, seed=1, schedule=3, resume=run)
    with pytest.raises(ValueError, match="plan was 'top' and is 'other'"):
        run_plan(other, resume=run)
    with pytest.raises(ValueError, match="resumable=True"):
        run_plan(top, resume=run_plan(top))


def test_a_plan_that_does_not_repeat_its_beginning_is_told_at_the_line() -> None:
    names = ["one"]

    @plan
    async def top() -> None:
        await seq(partial(sleep, 1), name=names[0])
        await seq(partial(sleep, 1))
        await seq(partial(sleep, 1))

    whole = run_plan(top, resumable=True)
    names[0] = "two"
    with pytest.raises(Different, match="does not repeat the recorded run") as raised:
        run_plan(top, resume=cut(whole, completed(whole)[3]))
    line = raised.value.line
    assert line is not None
    assert (whole.trace.events[line - 1]["event"], whole.trace.events[line - 1]["name"]) == ("started", "one")


def test_what_the_top_level_plan_reads_and_calls_itself_is_told_again_from_the_trace() -> None:
    asked: list[str] = []

    def is_open() -> bool:
        asked.append("door")
        return now() >= 1.5

    def price() -> float:
        asked.append("price")
        return 2.5

    def broken() -> None:
        asked.append("broken")
        raise OSError("no such shop")

    async def walk() -> str:
        await sleep(1)
        await in_thread(lambda: asked.append("steps"))
        return "walked"

    @plan
    async def top() -> Any:
        door: Fluent[bool] = Fluent(read=is_open, name="the door")
        first = door.value
        await seq(walk)
        await wait_for(door)
        told = await in_thread(price)
        try:
            await in_thread(broken)
        except OSError as error:
            reason = str(error)
        await seq(walk)
        await seq(walk)
        return first, told, reason, now(), door.value

    whole = run_plan(top, resumable=True)
    assert whole.value == (False, 2.5, "no such shop", 3.5, True)
    for records in range(1, len(whole.trace.events)):
        before = [n for n in completed(whole) if n <= records]
        asked.clear()
        again = run_plan(top, resume=cut(whole, records))
        assert again.value == whole.value
        assert without_mark(again) == whole.trace.events
        known = whole.trace.events[: before[-1]] if before else []
        for call in ("price", "broken"):
            assert asked.count(call) == (0 if any(event.get("function") == call for event in known) else 1)
    assert replay(top, again).equal


def test_a_state_that_fails_and_is_left_by_that_has_completed() -> None:
    done: list[str] = []

    async def grasp() -> str:
        done.append("grasp")
        await sleep(1)
        raise GraspMissed(what="cup")

    async def look() -> str:
        done.append("look")
        await sleep(1)
        return "seen"

    @plan
    async def top() -> Any:
        cases: Any = {("grasp", GraspMissed): "look"}
        return await state_machine({"grasp": grasp, "look": look}, cases, "grasp", "look")

    whole = run_plan(top, resumable=True)
    again = run_plan(top, resume=cut(whole, completed(whole)[0]))
    assert (again.value, done) == ("seen", ["grasp", "look", "look"])
    assert without_mark(again) == whole.trace.events


def test_a_plan_that_ends_before_where_it_would_go_on_is_told() -> None:
    long = [True]

    @plan
    async def top() -> None:
        if long[0]:
            await seq(partial(sleep, 1))
        await sleep(0.5)

    whole = run_plan(top, resumable=True)
    long[0] = False
    with pytest.raises(Different, match="does not repeat line"):
        run_plan(top, resume=cut(whole, completed(whole)[-1]))


def test_a_fluent_that_is_not_there_any_more_is_told() -> None:
    kept: list[Fluent[bool]] = [Fluent(False, "a door that is taken away")]

    async def open_door() -> None:
        kept[0].set(True)

    @plan
    async def top() -> None:
        await seq(open_door)
        await seq(partial(sleep, 1))

    whole = run_plan(top, resumable=True)
    kept.clear()
    with pytest.raises(PlanStructureError, match="a door that is taken away"):
        run_plan(top, resume=cut(whole, completed(whole)[0]))
