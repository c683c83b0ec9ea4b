"""Replaying a run: the plan decides again by what it was told, and the first difference is found."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import hypothesis
import pytest
from cut_runs import at_every_cut, difference
from hypothesis import settings
from hypothesis import strategies as st

from planlang import *
from planlang.failures import GraspMissed, ManipulationPoseUnreachable, ObjectNotFound
from planlang.runs import RecordedRun
from planlang.runs.recorded_run import DamagedTrace
from planlang.testing import Script, replay, run_plan

Branch = Callable[[], Awaitable[Any]]
CUP = an_object("Cup")


async def performing(cls: str, name: str) -> Any:
    return await perform(action(cls), name=name)


async def guarded(body: Branch, seconds: float) -> Any:
    return await unwind_protect(body, partial(sleep, seconds))


async def recovering(body: Branch) -> Any:
    return await with_failure_handling(body, Recovery(PlanFailure, retries=2))


LEAVES = st.one_of(
    st.builds(
        lambda cls, name: partial(performing, cls, name),
        st.sampled_from(["Perceiving", "Reaching", "OpeningAGripper"]),
        st.sampled_from(["one", "two"]),
    ),
    st.builds(lambda seconds: partial(sleep, seconds), st.sampled_from([0.0, 0.5, 1.0])),
)
BODIES: st.SearchStrategy[Branch] = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.builds(lambda parts: partial(par, *parts), st.lists(inner, min_size=1, max_size=3)),
        st.builds(lambda parts: partial(pursue, *parts), st.lists(inner, min_size=1, max_size=3)),
        st.builds(lambda parts: partial(try_all, *parts), st.lists(inner, min_size=1, max_size=3)),
        st.builds(lambda parts: partial(seq, *parts), st.lists(inner, min_size=1, max_size=3)),
        st.builds(lambda s, part: partial(timeout, s, part), st.sampled_from([0.5, 1.0, 2.5]), inner),
        st.builds(lambda part, s: partial(guarded, part, s), inner, st.sampled_from([0.0, 0.5])),
        st.builds(lambda part: partial(recovering, part), inner),
    ),
    max_leaves=8,
)
SCRIPTS = st.builds(
    lambda times, after: (
        Script()
        .on("Reaching", fails=ManipulationPoseUnreachable, times=times, after=after)
        .on("one", fails=ObjectNotFound, times=1, after=0.5)
        .on("OpeningAGripper", returns=(1, 2.5), after=after)
    ),
    st.integers(1, 3),
    st.sampled_from([0.0, 0.5, 1.0]),
)


@hypothesis.given(body=BODIES, script=SCRIPTS, schedule=st.sampled_from([None, None, 0, 1]), data=st.data())
@settings(max_examples=80, deadline=None)
def test_random_plans_are_repeated_wherever_their_record_ends(
    body: Branch, script: Script, schedule: int | None, data: st.DataObject
) -> None:
    async def top() -> Any:
        try:
            return await body()
        except PlanFailure as failure:
            return failure

    run = run_plan(top, script=script, schedule=schedule, resumable=True, allow_unused=True)
    whole = replay(top, run)
    assert whole.equal, whole.difference and (whole.difference.recorded, whole.difference.found)
    assert (whole.lines, whole.of, whole.outcome) == (len(run.trace.events), len(run.trace.events), "succeeded")
    records = data.draw(st.integers(1, len(run.trace.events)), label="records")
    part = replay(top, RecordedRun.of(run.trace.events[:records]))
    assert part.equal, part.difference and (part.difference.recorded, part.difference.found)


def test_location_scopes_goals_and_recoveries_are_told_what_the_executive_answered() -> None:
    script = (
        Script()
        .on("Reaching", fails=ManipulationPoseUnreachable, times=2, after=1.5)
        .on("ClosingAGripper", fails=GraspMissed, times=1)
    )

    async def grasp() -> None:
        await perform(action("Reaching", to_location=CUP))
        await perform(action("ClosingAGripper", object_acted_on=CUP))

    @plan
    async def top() -> None:
        body = partial(achieve, holding(CUP), grasp)
        await at_location(
            a_location(in_reach_of=CUP), partial(with_failure_handling, body, Recovery(GraspMissed, retries=2))
        )
        await achieve(holding(CUP), grasp)

    run = run_plan(top, script=script, resumable=True)
    assert run.failure is None
    assert at_every_cut(top, run) == []


def test_world_fluents_policies_threads_and_suspensions_are_told_again_and_nothing_outside_is_asked() -> None:
    asked: list[str] = []

    async def reach() -> None:
        await perform(action("Reaching"))

    async def holding_back() -> None:
        await sleep(0.5)
        suspend(task("reach"))
        await sleep(2)
        wake_up(task("reach"))

    def is_open() -> bool:
        asked.append("door")
        return now() > 1.0

    def distance() -> float:
        asked.append("distance")
        return 3.0 - now()

    def number() -> int:
        asked.append("number")
        return 42

    @plan
    async def top() -> Any:
        await wait_for(Fluent(read=is_open, name="the door"))
        told = await in_thread(number)
        await par(partial(tag, "reach", reach), holding_back)
        near: Fluent[float] = Fluent(read=distance, name="distance")
        try:
            await with_policies([Policy("far", near < -2.0)], partial(sleep, 10))
        except PlanFailure as failure:
            return told, str(failure), rng().random(), near.value

    run = run_plan(top, resumable=True)
    assert run.value[0] == 42
    assert set(asked) == {"door", "distance", "number"}
    asked.clear()
    assert at_every_cut(top, run) == []
    assert asked == []


def test_a_call_in_a_thread_that_failed_fails_again() -> None:
    def broken() -> None:
        raise OSError("no such port")

    @plan
    async def top() -> str:
        try:
            await in_thread(broken)
        except OSError as error:
            await tag(str(error), partial(sleep, 1))
        return "done"

    assert replay(top, run_plan(top, resumable=True)).equal


def test_a_plan_that_decides_otherwise_differs_at_the_line_of_its_first_other_record() -> None:
    names = ["reach"]

    @plan
    async def top() -> None:
        await perform(action("Perceiving"))
        await perform(action("Reaching"), name=names[0])
        await perform(action("Perceiving"))

    run = run_plan(top, resumable=True)
    names[0] = "stretch"
    found = replay(top, run)
    assert found.difference is not None
    recorded, now_found = difference(top, run)
    assert (recorded["event"], recorded["path"]) == ("started", "top/reach")
    assert (now_found["event"], now_found["path"]) == ("started", "top/stretch")
    assert found.difference.line is not None
    assert run.trace.events[found.difference.line - 1]["name"] == "reach"
    assert (found.equal, found.lines) == (False, found.difference.line - 1)


@pytest.mark.parametrize("seconds", [0.5, 2.0, None])
def test_a_plan_that_waits_longer_shorter_or_for_ever_differs(seconds: float | None) -> None:
    wait: list[float | None] = [1.0]

    @plan
    async def top() -> None:
        if wait[0] is None:
            await wait_for(Fluent(False))
        else:
            await sleep(wait[0])
        await seq(partial(sleep, 1))

    run = run_plan(top, resumable=True)
    wait[0] = seconds
    recorded, found = difference(top, run)
    assert (recorded["step"], recorded["path"]) == (240, "top/seq")
    if seconds == 0.5:
        assert (found["step"], found["path"]) == (120, "top/seq")
    else:
        assert str(found).startswith("nothing")


def test_a_plan_that_ends_early_or_performs_something_else_differs() -> None:
    what: list[str | None] = ["Reaching"]

    @plan
    async def top() -> None:
        if what[0] is not None:
            await perform(action(what[0]))

    run = run_plan(top, resumable=True)
    what[0] = None
    recorded, found = difference(top, run)
    assert (recorded["event"], found["event"]) == ("started", "ended")
    what[0] = "Perceiving"
    recorded, found = difference(top, run)
    assert (recorded["path"], found["path"]) == ("top/Reaching", "top/Perceiving")


def test_a_result_that_does_not_survive_json_is_handed_on_as_it_was_told() -> None:
    @plan
    async def top() -> Any:
        return await seq(partial(perform, action("Reaching")))

    run = run_plan(top, script=Script().on("Reaching", returns={1, 2}), resumable=True)
    assert run.value == ({1, 2},)
    assert replay(top, run).equal


def test_a_run_that_deadlocked_or_crashed_is_repeated_to_its_end() -> None:
    @plan
    async def stuck() -> None:
        await perform(action("Reaching"))
        await wait_for(Fluent(False, "what never comes"))

    @plan
    async def crashing() -> None:
        await perform(action("Reaching"))
        raise ZeroDivisionError("seventeen")

    for top in (stuck, crashing):
        trace = attempt_of(top)
        assert replay(top, trace).equal


def attempt_of(top: Branch) -> RecordedRun:
    from planlang.testing.running import attempt

    return RecordedRun.of(attempt(top, resumable=True).trace.events)


def test_only_a_trace_that_tells_what_the_plan_was_told_can_be_replayed() -> None:
    @plan
    async def top() -> None:
        await sleep(1)

    with pytest.raises(ValueError, match="resumable=True"):
        replay(top, run_plan(top))


def test_a_watch_whose_number_is_none_is_told_with_its_line() -> None:
    @plan
    async def top() -> None:
        await sleep(1)

    events = run_plan(top, resumable=True).trace.events
    (first,) = (place for place, one in enumerate(events) if one.get("node") == 1 and one["event"] == "started")
    watch = {"step": 0, "event": "world", "node": 1, "name": "watch", "number": [], "value": False}
    with pytest.raises(ValueError, match=f"line {first + 2}: number"):
        replay(top, RecordedRun.of([*events[: first + 1], watch, *events[first + 1 :]]))


async def looks_first(belief: Any, asked: Any) -> str:
    await perform(action("LookingForSomething", object_acted_on=CUP))
    return "seen"


@pytest.mark.parametrize("limit", [0.5, 1.5, 2.5, 9.0])
def test_what_process_modules_perform_themselves_takes_its_time_and_resources_again(limit: float) -> None:
    script = Script().on("Reaching", does=looks_first).on("LookingAtSomething", after=0.5)

    async def reaching() -> Any:
        return await perform(action("Reaching"))

    async def looking() -> None:
        for _ in range(4):
            await perform(action("LookingAtSomething"))  # which needs the head, too

    @plan
    async def top() -> Any:
        try:
            return await budget(partial(timeout, limit, partial(par, reaching, looking)), seconds=2.25)
        except PlanFailure as failure:
            return str(failure)

    run = run_plan(top, script=script, resumable=True)
    assert at_every_cut(top, run) == []


@pytest.mark.long
def test_retries_and_displaced_bases_are_repeated() -> None:
    from planlang.testing.scripted import ScriptedExecutive

    class Tucking(ScriptedExecutive):
        def before_retry(self) -> Any:
            yield action("Reaching", to_location=CUP)

    script = Script().on("Grasp", fails=ManipulationPoseUnreachable, times=2).places("Cup", (1, 0, 0), (2, 0, 0))

    async def inner() -> None:
        await perform(action("Perceiving"))

    async def body() -> None:
        await at_location(a_location(in_reach_of=an_object("Table")), inner)
        await perform(action("Perceiving"), name="back again")
        await perform(action("Reaching"), name="Grasp")

    @plan
    async def top() -> str:
        try:
            await at_location(a_location(in_reach_of=CUP), body)
        except PlanFailure as failure:
            return str(failure)
        return "done"

    executive = Tucking(script)
    run = run_plan(top, executive=executive, resumable=True)
    assert run.attempts("Grasp") == 2
    assert at_every_cut(top, run) == []


def test_what_a_process_module_holds_for_a_while_is_held_again_whether_it_ends_or_is_cut_short() -> None:
    from planlang.testing.scripted import ScriptedExecutive

    class Careful:
        name, actions, failures = "careful", ("Reaching",), ()

        def resources(self, _: object) -> tuple[str, ...]:
            return ("arm",)

        async def execute(self, _: object) -> float:
            await sleep(0.5)
            async with using("tool"):
                await sleep(1)
            async with using("tool", "light"), using("camera"):
                await sleep(1)
            await sleep(0.5)
            return now()

    async def other() -> None:
        async with using("tool"):
            await sleep(3)

    @plan
    async def top(limit: float) -> str:
        reaching = partial(perform, action("Reaching"))
        try:
            await par(reaching, partial(reaching, name="second"), partial(sleep, 0.7))
            await timeout(limit, partial(par, reaching, other))
        except PlanFailure as failure:
            return str(failure)
        return "done"

    for limit in (100, 1.2, 0.2, 3.5, 4.5):  # the last ones while it waits for the tool, and while it holds it
        executive = ScriptedExecutive(Script())
        executive.modules = [Careful()]
        run = run_plan(partial(top, limit), executive=executive, resumable=True)
        assert at_every_cut(partial(top, limit), run) == []


def test_answers_that_were_tampered_with_are_told_with_their_line() -> None:
    @plan
    async def top() -> None:
        await wait_for(Fluent(read=lambda: now() > 1, name="late"))
        await perform(action("Reaching"))

    run = run_plan(top, resumable=True)
    for event in ("world", "answer", "performed"):
        place = next(n for n, one in enumerate(run.trace.events) if one["event"] == event)
        events = list(run.trace.events)
        events[place] = {**run.trace.events[place], "value": {"$": "Popen"}}
        found = replay(top, RecordedRun.of(events))
        assert found.difference is not None, event
        assert found.difference.line == place + 1
        assert f"line {place + 1} is damaged" in str(found)
        events[place] = {**run.trace.events[place], "failure": {"type": "os.system"}}
        with pytest.raises(DamagedTrace, match="failure has to be an object") as damaged:
            RecordedRun.of(events)
        assert damaged.value.line == place + 1
    assert str(replay(top, run)) == f"equal to the end: {len(run.trace.events)} lines"
    part = replay(top, RecordedRun.of(run.trace.events[:9]))
    assert str(part) == "equal to the end: 9 lines, and the trace ends before the plan"


async def lose() -> None:
    raise GraspMissed


async def top_without_executive() -> str:
    try:
        await par(lose)
    except GraspMissed:
        return "lost"
    return "won"


def test_a_run_without_executive_is_repeated_also_where_it_fails() -> None:
    trace = Trace()
    run(top_without_executive, host=VirtualHost(), trace=trace, resumable=True)
    recorded = RecordedRun.of(trace.events)
    assert replay(top_without_executive, recorded).equal


def test_a_difference_says_what_is_recorded_and_what_was_found() -> None:
    trace = Trace()
    with pytest.raises(GraspMissed):
        run(lambda: par(lose), host=VirtualHost(), trace=trace, resumable=True)
    found = str(replay(lambda: seq(lose), RecordedRun.of(trace.events)).difference)
    lines = found.splitlines()
    assert lines[0] == "line 3 is not repeated"
    assert lines[1].startswith("  recorded  step 0: lambda/par started")
    assert lines[2].startswith("  found     step 0: lambda/seq started")


def moved(value: Any, by: float) -> Any:
    """The same record with its floating-point numbers moved, in texts too."""
    match value:
        case float():
            return value + by
        case str():
            return value.replace("0.375", repr(0.375 + by))
        case dict():
            return {key: moved(one, by) for key, one in value.items()}
        case list():
            return [moved(one, by) for one in value]
    return value


@pytest.mark.parametrize(("by", "equal"), [(1e-12, True), (-1e-12, True), (1e-6, False)])
def test_numbers_that_another_processor_ends_with_other_digits_are_equal(by: float, equal: bool) -> None:
    async def drive() -> Any:
        await perform(action("Translation-LocationChange", x=0.375, y=-1.25))
        return {"x": [0.375, float("inf")]}

    recorded = run_plan(drive, resumable=True).trace.events
    elsewhere = [moved(record, by) if record["event"] in ("started", "ended") else record for record in recorded]
    assert replay(drive, RecordedRun.of(elsewhere)).equal is equal


def test_a_step_that_failed_as_stated_fails_again_and_a_damaged_record_of_it_differs() -> None:
    async def reach() -> None:
        await perform(action("Reaching"))

    ended = run_plan(reach, faults=["step.Reaching:fails=GraspMissed"], resumable=True)
    assert replay(reach, ended).equal
    (fault,) = (one for one in ended.trace.events if one["event"] == "fault")
    fault["fault"] = "step.Reaching:fails=Nothing"
    assert not replay(reach, ended).equal
