"""Resuming a run from its trace: what has completed is not done again, and everything else is as if never cut."""

from __future__ import annotations

import enum
import io
import os
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from hypothesis import settings
from hypothesis import strategies as st

from planlang import *
from planlang.failures import BudgetExceeded, GraspMissed, ManipulationPoseUnreachable, Timeout
from planlang.runs import Different, Past, RecordedRun
from planlang.testing import PlanRun, Script, replay, run_plan

Branch = Callable[[], Awaitable[Any]]


def cut(run: PlanRun[Any], records: int) -> RecordedRun:
    """What is left of a run that was killed after so many records."""
    return RecordedRun.of(run.trace.events[:records])


def completed(run: PlanRun[Any]) -> list[int]:
    """After how many records each step had completed."""
    return [number for number, event in enumerate(run.trace.events, 1) if event["event"] == "completed"]


def without_mark(run: PlanRun[Any]) -> list[dict[str, Any]]:
    """The trace without the record that says where it was resumed."""
    return [event for event in run.trace.events if event["event"] != "resumed"]


# Random plans: the steps of the top-level plan, each of which leaves a mark when it is done


async def acting(done: list[str], name: str, seconds: float) -> Any:
    await perform(action("Perceiving"), name=name)
    await sleep(seconds)
    done.append(name)
    return name, seconds


async def drawing(done: list[str], name: str, seconds: float) -> float:
    await sleep(seconds)
    done.append(name)
    return rng().random()


async def missing(done: list[str], name: str, seconds: float) -> None:
    await sleep(seconds)
    done.append(name)
    raise GraspMissed(what=name)


async def together(done: list[str], name: str, seconds: float) -> Any:
    return await par(
        partial(acting, done, f"{name} left", seconds), second=partial(drawing, done, f"{name} right", 0.3)
    )


async def in_turn(done: list[str], name: str, seconds: float) -> Any:
    first, second = partial(drawing, done, f"{name} first", seconds), partial(acting, done, f"{name} then", 0.1)
    return await seq(first, then=second)


async def recovered(done: list[str], name: str, seconds: float) -> Any:
    times = []

    async def body() -> int:
        times.append(name)
        if len(times) < 2:
            await missing(done, f"{name} once", seconds)
        return len(times)

    return await with_failure_handling(body, Recovery(GraspMissed, attempts=2))


async def caught(done: list[str], name: str, seconds: float) -> str:
    try:
        await timeout(5, partial(missing, done, name, seconds))
    except PlanFailure as failure:
        return str(failure)
    return "nothing"


async def ticking(done: list[str], name: str, seconds: float) -> str:
    visits = []

    async def turn() -> str:
        await sleep(seconds)
        visits.append(await drawing(done, f"{name} turn", 0.1))
        return "again" if len(visits) < 2 and done.count(f"{name} turn") < 3 else "enough"

    async def end() -> str:
        return "over"

    states = {"turn": turn, "end": end}
    return str(await state_machine(states, {("turn", "again"): "turn", ("turn", "enough"): "end"}, "turn", "end"))


KINDS = (acting, drawing, together, in_turn, recovered, caught)
STEPS = st.lists(st.tuples(st.sampled_from(KINDS), st.sampled_from([0.0, 0.1, 0.25, 1.0])), min_size=1, max_size=5)


def plan_of(steps: list[tuple[Any, float]], done: list[str]) -> Any:
    @plan
    async def top() -> list[Any]:
        results: list[Any] = []
        for number, (kind, seconds) in enumerate(steps):
            results.append(await seq(partial(kind, done, f"step {number}", seconds)))
            results.append((now(), rng().random()))
        return results

    return top


@hypothesis.given(steps=STEPS, data=st.data())
@settings(max_examples=60, deadline=None)
def test_a_run_cut_anywhere_and_resumed_is_as_if_it_had_not_been_cut(steps: Any, data: st.DataObject) -> None:
    done: list[str] = []
    whole = run_plan(plan_of(steps, done), resumable=True)
    once = list(done)
    records = data.draw(st.integers(1, len(whole.trace.events) - 1), label="records")
    before = [number for number in completed(whole) if number <= records]
    done.clear()
    again = run_plan(plan_of(steps, done), resume=cut(whole, records))
    assert again.value == whole.value
    assert without_mark(again) == whole.trace.events
    assert once[len(once) - len(done) :] == done, "what is done again are the last effects, in their order"
    if before:
        at = whole.trace.events[before[-1] - 1]["step"]
        assert [event["step"] for event in again.trace.events if event["event"] == "resumed"] == [at]


@hypothesis.given(steps=STEPS, data=st.data())
@settings(max_examples=25, deadline=None)
def test_a_resumed_run_can_be_cut_and_resumed_again_and_replayed(steps: Any, data: st.DataObject) -> None:
    whole = run_plan(plan_of(steps, []), resumable=True)
    run = whole
    for _ in range(2):
        records = data.draw(st.integers(1, len(run.trace.events) - 1), label="records")
        run = run_plan(plan_of(steps, []), resume=cut(run, records))
    assert run.value == whole.value
    assert without_mark(run) == whole.trace.events
    told = replay(plan_of(steps, []), run)
    assert told.equal, told.difference and (told.difference.recorded, told.difference.found)


@hypothesis.given(steps=STEPS)
@settings(max_examples=25, deadline=None)
def test_each_step_that_completed_has_its_effect_exactly_once(steps: Any) -> None:
    done: list[str] = []
    whole = run_plan(plan_of(steps, done), resumable=True)
    once = list(done)
    for records in completed(whole):
        done.clear()
        run_plan(plan_of(steps, done), resume=cut(whole, records))
        # killed in the moment of completion, the effects before and after make the whole, none twice
        assert len(done) < len(once) or not steps
        assert once[len(once) - len(done) :] == done


@hypothesis.given(
    edges=st.sets(st.sampled_from([("a", "c"), ("a", "d"), ("b", "d"), ("c", "d"), ("b", "c")])),
    seconds=st.tuples(*[st.sampled_from([0.0, 0.5, 1.0, 2.0])] * 4),
    limit=st.sampled_from([None, 1, 2]),
    data=st.data(),
)
@settings(max_examples=60, deadline=None)
def test_completed_steps_of_a_partial_order_are_not_run_again_and_open_ones_are(
    edges: set[tuple[str, str]], seconds: tuple[float, ...], limit: int | None, data: st.DataObject
) -> None:
    done: list[str] = []

    async def step(name: str, time: float) -> str:
        await sleep(time)
        await perform(action("Perceiving"), name=f"look {name}")
        done.append(name)
        return name * 2

    @plan
    async def top() -> Any:
        steps = {name: partial(step, name, time) for name, time in zip("abcd", seconds, strict=True)}
        return await partial_order(steps, sorted(edges), limit)

    whole = run_plan(top, resumable=True)
    assert whole.value == {name: name * 2 for name in "abcd"}
    records = data.draw(st.integers(1, len(whole.trace.events) - 1), label="records")
    past = [e["name"] for e in whole.trace.events[:records] if e["event"] == "completed"]
    done.clear()
    again = run_plan(top, resume=cut(whole, records))
    assert again.value == whole.value
    assert sorted(done) == sorted(set("abcd") - set(past) if "partial_order" not in past else set())
    told = replay(top, again)
    assert told.equal, told.difference and (told.difference.recorded, told.difference.found)


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
        with_retries = partial(with_failure_handling, missing, Recovery(GraspMissed, attempts=2))
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
    assert again.value == [True]
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
            a_location(in_reach_of=cup), partial(with_failure_handling, grasp, Recovery(GraspMissed, attempts=2))
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
    with pytest.raises(
        ValueError, match="trace is that of another run: seed was 0 and is 1; schedule was None and is 3"
    ):
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
    with pytest.raises(Different, match="does not repeat what is recorded") as raised:
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
    with pytest.raises(Different, match="does not repeat what is recorded in line"):
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
    with pytest.raises(PlanStructureError, match="a door that is taken away, which there is not"):
        run_plan(top, resume=cut(whole, completed(whole)[0]))


# Every construct may be a step


async def opening(done: list[str], door: Fluent[bool]) -> bool:
    await sleep(0.5)
    done.append("opened")
    door.set(True)
    return True


async def noticing(done: list[str]) -> Return[str]:
    done.append("noticed")
    return Return("seen")


CONSTRUCTS: dict[str, Callable[[list[str], Fluent[bool]], Awaitable[Any]]] = {
    "achieve": lambda done, door: achieve(door, partial(opening, done, door)),
    "budget": lambda done, door: budget(partial(opening, done, door), seconds=5),
    "race": lambda done, door: race(partial(opening, done, door)),
    "retry_after_suspension": lambda done, door: retry_after_suspension(partial(opening, done, door)),
    "tag": lambda done, door: tag("opening", partial(opening, done, door)),
    "timeout": lambda done, door: timeout(5, partial(opening, done, door)),
    "try_all": lambda done, door: try_all(partial(opening, done, door)),
    "try_in_order": lambda done, door: try_in_order(partial(opening, done, door)),
    "unwind_protect": lambda done, door: seq(partial(unwind_protect, partial(opening, done, door), partial(sleep, 0))),
    "whenever": lambda done, door: whenever(~door, partial(noticing, done)),
    "with_failure_handling": lambda done, door: with_failure_handling(
        partial(opening, done, door), Recovery(PlanFailure)
    ),
    "with_policies": lambda done, door: with_policies([Policy("calm")], partial(opening, done, door)),
}


@pytest.mark.parametrize("name", sorted(CONSTRUCTS))
def test_a_construct_that_completed_as_a_step_returns_what_it_did_and_does_nothing(name: str) -> None:
    done: list[str] = []

    def top() -> Any:
        door = Fluent(False, "the door is open")

        @plan
        async def going() -> Any:
            result = await CONSTRUCTS[name](done, door)
            await sleep(1)
            return result

        return going

    whole = run_plan(top(), resumable=True)
    assert len(done) == 1
    *_, records = completed(whole)
    again = run_plan(top(), resume=cut(whole, records))
    assert (again.value, len(done)) == (whole.value, 1)
    assert without_mark(again) == whole.trace.events


@pytest.mark.parametrize("seconds", [(0.5, 0.0, 0.0, 0.5), (0.5, 0.0, 2.0, 0.5), (0.5, 1.0, 0.0, 0.5)])
def test_open_steps_begin_again_as_written_whenever_the_completed_ones_end(seconds: tuple[float, ...]) -> None:
    async def step(name: str, time: float) -> str:
        await sleep(time)
        await perform(action("Perceiving"), name=f"look {name}")
        return name

    @plan
    async def top() -> Any:
        steps = {name: partial(step, name, time) for name, time in zip("abcd", seconds, strict=True)}
        return await partial_order(steps, [])

    whole = run_plan(top, resumable=True)
    for records in completed(whole):
        again = run_plan(top, resume=cut(whole, records))
        assert again.value == whole.value
        told = replay(top, again)
        assert told.equal, told.difference and (told.difference.recorded, told.difference.found)


def test_a_resumed_run_whose_trace_cannot_be_written_any_further_ends_with_that_error() -> None:
    async def top() -> None:
        await sleep(1)
        await seq(partial(sleep, 1), partial(sleep, 1))

    class Full(io.StringIO):
        def write(self, text: str) -> int:
            if "resumed" in text:
                raise OSError(28, "No space left on device")
            return super().write(text)

    before = run_plan(top, resumable=True)
    past = Past(cut(before, completed(before)[0]))
    with pytest.raises(OSError, match="No space left") as full:
        run(top, host=VirtualHost(240), trace=Trace(Full()), resume=past)
    assert "the run was ended" in full.value.__notes__[0]


def test_the_trace_is_on_the_disk_when_a_step_has_completed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda file: synced.append(os.fstat(file).st_size))

    @plan
    async def top() -> None:
        await seq(partial(sleep, 1), partial(sleep, 1))
        await par(partial(sleep, 1))

    with Trace.at(tmp_path / "run.jsonl") as trace:
        run(top, host=VirtualHost(), trace=trace, resumable=True)
    lines = (tmp_path / "run.jsonl").read_text().splitlines(keepends=True)
    ends = [number for number, line in enumerate(lines, 1) if '"event": "completed"' in line]
    assert synced == [sum(map(len, lines[:number])) for number in ends]
    assert len(synced) == 4


def test_a_trace_that_goes_to_a_pipe_needs_no_disk(tmp_path: Path) -> None:
    @plan
    async def top() -> None:
        await seq(partial(sleep, 1))

    with Trace.at("/dev/null") as trace:
        run(top, host=VirtualHost(), trace=trace, resumable=True)


def test_a_step_that_ends_in_a_shield_while_its_plan_is_evaporated_has_not_completed() -> None:
    @plan
    async def top() -> None:
        await seq(partial(sleep, 0.5), name="before")
        with shield():
            await par(partial(sleep, 2))

    trace = Trace()
    with pytest.raises(Timeout):
        run(partial(timeout, 1, top), host=VirtualHost(), trace=trace, resumable=True)
    completed = [event["name"] for event in trace.events if event["event"] == "completed"]
    assert completed == ["sleep", "before"]


def test_a_stream_that_the_plan_has_seeded_is_told_as_lost() -> None:
    @plan
    async def top() -> None:
        await ignoring(seeds)
        await seq(partial(sleep, 1))

    async def ignoring(body: Branch) -> Any:
        return await with_failure_handling(body)

    async def seeds() -> float:
        rng().seed(3)
        return rng().random()

    trace = Trace()
    run(top, host=VirtualHost(), trace=trace, resumable=True)
    lost = [event["lost"] for event in trace.events if "lost" in event]
    assert "a stream of random numbers that was seeded by the plan" in lost[0]


def test_draws_that_lie_behind_those_of_the_plan_cannot_be_taken_over() -> None:
    @plan
    async def top() -> None:
        rng().random()
        await with_failure_handling(partial(draws_again))
        await seq(partial(sleep, 1))

    async def draws_again() -> float:
        return rng().random()

    trace = Trace()
    run(top, host=VirtualHost(), trace=trace, resumable=True)
    for event in trace.events:
        if "draws" in event:
            event["draws"] = 1
    past = Past(RecordedRun.of(trace.events))
    with pytest.raises(PlanStructureError, match="cannot go back to 1 draws"):
        run(top, host=VirtualHost(), resume=past)
