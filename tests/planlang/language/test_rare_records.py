"""Resuming and replaying where the record tells something rare: a lost value, an interrupt, an open step."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from functools import partial
from typing import Any

import pytest

from planlang import *
from planlang.failures import GraspMissed, ObjectNotFound
from planlang.kernel.primitives import record
from planlang.runs import Different, Past, RecordedRun, restore
from planlang.testing import PlanRun, Script, replay, run_plan
from tests.support.cut_runs import completed, cut


def resumed_everywhere(top: Any, whole: PlanRun[Any]) -> Iterator[PlanRun[Any]]:
    """The run resumed after each of its steps, told to be as the whole one."""
    for records in completed(whole):
        again = run_plan(top, resume=cut(whole, records))
        assert again.value == whole.value
        assert replay(top, again).equal
        yield again


def test_a_step_left_open_begins_again_when_the_run_goes_on_and_is_repeated_so() -> None:
    begun: list[str] = []

    async def slow() -> str:
        begun.append("slow")
        await with_failure_handling(partial(sleep, 2))
        return "slow"

    @plan
    async def top() -> Any:
        return await partial_order({"slow": slow, "quick": partial(sleep, 1)}, [])

    whole = run_plan(top, resumable=True)
    begun.clear()
    again = run_plan(top, resume=cut(whole, completed(whole)[0]))
    assert again.value == {"slow": "slow", "quick": None}
    assert begun == ["slow"]
    assert replay(top, again).equal


def test_a_construct_that_ended_in_a_programming_error_runs_again_before_what_is_taken_over() -> None:
    async def wrong() -> None:
        await with_failure_handling(partial(sleep, 1))
        raise KeyError("wrong")

    @plan
    async def top() -> str:
        try:
            await par(wrong)
        except KeyError:
            await seq(partial(sleep, 1))
        return "on"

    assert list(resumed_everywhere(top, run_plan(top, resumable=True)))


def test_numbers_that_a_step_draws_in_the_plans_own_task_are_not_drawn_again() -> None:
    async def draws() -> float:
        return rng().random()

    @plan
    async def top() -> Any:
        first = await with_failure_handling(draws)
        await seq(partial(sleep, 1))
        return first, rng().random()

    assert len(list(resumed_everywhere(top, run_plan(top, resumable=True)))) == 3


def test_plans_inside_of_the_top_level_plan_are_steps_and_inside_of_branches_are_not() -> None:
    @plan
    async def inner() -> str:
        await sleep(1)
        return "inner"

    async def top() -> Any:
        return await outer()

    @plan
    async def outer() -> Any:
        return await inner(), await par(inner), await inner()

    whole = run_plan(top, resumable=True)
    assert whole.value == ("inner", ("inner",), "inner")
    assert len(list(resumed_everywhere(top, whole))) == 3


def test_a_fluent_made_and_set_inside_of_a_step_is_its_own_affair() -> None:
    async def step() -> bool:
        async def body() -> bool:
            lamp = Fluent(False)
            lamp.set(True)
            return lamp.value

        return await with_failure_handling(body)

    @plan
    async def top() -> Any:
        return await seq(step, step)

    whole = run_plan(top, resumable=True)
    assert not [event for event in whole.trace.events if "lost" in event or "fluents" in event]
    assert list(resumed_everywhere(top, whole))


def test_a_fluent_that_shares_its_name_stops_resumption_before_the_step_that_sets_it() -> None:
    doors = [Fluent(False, "a door with a twin"), Fluent(False, "a door with a twin")]

    async def opens() -> None:
        doors[0].set(True)

    @plan
    async def top() -> None:
        await seq(opens)

    lost = [event["lost"] for event in run_plan(top, resumable=True).trace.events if "lost" in event]
    assert lost
    assert all("not the only one of that name" in told for told in lost)


def test_a_world_fluent_that_raises_or_has_no_json_is_told_again() -> None:
    def broken() -> bool:
        if now() < 1:
            return False
        raise OSError("no camera")

    @plan
    async def top() -> Any:
        shown = Fluent(read=object, name="something")
        assert shown.value is not None
        try:
            await wait_for(Fluent(read=broken, name="seen"))
        except OSError as error:
            return str(error)

    whole = run_plan(top, resumable=True)
    assert whole.value == "no camera"
    assert replay(top, whole).equal


def test_what_a_goal_reads_of_the_world_is_told_again() -> None:
    there: list[int] = []

    async def brings() -> None:
        await sleep(1)
        there.append(1)

    @plan
    async def top() -> None:
        await achieve(Fluent(read=lambda: bool(there), name="there"), brings)

    whole = run_plan(top, resumable=True)
    there.clear()
    assert replay(top, whole).equal
    assert there == [1]


def test_what_a_process_module_reads_marks_and_passes_on_is_its_own_affair() -> None:
    async def grasps(belief: Any, asked: Any) -> None:
        record("closing", by="hand")
        await wait_for(Fluent(read=lambda: now() >= 1))
        await perform(action("LookingForSomething"))

    script = Script().on("Reaching", does=grasps).on("LookingForSomething", fails=ObjectNotFound)

    @plan
    async def top() -> str:
        try:
            await perform(action("Reaching"))
        except PlanFailure as failure:
            return str(failure)
        return "grasped"

    whole = run_plan(top, script=script, resumable=True)
    assert replay(top, whole).equal


def test_a_result_that_was_lost_is_handed_on_also_where_the_record_ends_behind_it() -> None:
    script = Script().on("Reaching", returns=object())

    @plan
    async def top() -> None:
        await in_thread(object)
        await perform(action("Reaching"))

    whole = run_plan(top, script=script, resumable=True)
    performed = next(n for n, event in enumerate(whole.trace.events, 1) if event["event"] == "performed")
    for records in (performed, len(whole.trace.events)):
        assert replay(top, cut(whole, records)).equal


def test_an_interrupt_is_repeated_where_it_came() -> None:
    def read() -> bool:
        if now() >= 1:
            signal.raise_signal(signal.SIGINT)
        return False

    @plan
    async def top() -> None:
        try:
            await wait_for(Fluent(read=read, name="never"))
        finally:
            record("left")

    trace = Trace()
    with pytest.raises(KeyboardInterrupt):
        run(top, host=VirtualHost(), trace=trace, resumable=True)
    found = replay(top, RecordedRun.of(trace.events))
    assert found.equal, found


def test_what_is_read_in_the_drain_is_not_told() -> None:
    @plan
    async def top() -> None:
        try:
            await wait_for(Fluent(False))
        finally:
            assert Fluent(read=lambda: 5, name="five").value == 5

    trace = Trace()
    with pytest.raises(DeadlockError):
        run(top, host=VirtualHost(), trace=trace, resumable=True)
    assert not [event for event in trace.events if event["event"] == "world"]


def test_a_plan_that_asks_for_more_than_it_did_differs() -> None:
    more: list[str] = []

    @plan
    async def top() -> None:
        if "call" in more:
            await in_thread(sum, ())
        if "read" in more:
            assert Fluent(read=lambda: 1, name="one").value
        await sleep(1)

    whole = run_plan(top, resumable=True)
    for kind in ("call", "read"):
        more[:] = [kind]
        assert not replay(top, whole).equal


def test_a_header_without_rate_is_told() -> None:
    @plan
    async def top() -> None:
        await sleep(1)

    for missing, told in (("rate", "header has no rate"), ("seed", "rate and seed")):
        events = [dict(event) for event in run_plan(top, resumable=True).trace.events]
        del events[0][missing]
        with pytest.raises(ValueError, match=told):
            replay(top, RecordedRun.of(events))


def test_a_world_fluent_that_was_not_read_before_cannot_be_read_before_the_run_goes_on() -> None:
    reads: list[str] = []

    @plan
    async def top() -> None:
        if reads:
            assert Fluent(read=lambda: 1, name="one").value
        await seq(partial(sleep, 1))

    whole = run_plan(top, resumable=True)
    reads.append("now")
    with pytest.raises(PlanStructureError, match="was not read"):
        run_plan(top, resume=cut(whole, completed(whole)[0]))


@pytest.mark.parametrize("damage", ["value", "missing"])
def test_an_answer_of_the_past_that_is_damaged_or_missing_is_told(damage: str) -> None:
    @plan
    async def top() -> None:
        await in_thread(lambda: 7)
        await seq(partial(sleep, 1))

    whole = run_plan(top, resumable=True)
    events = [dict(event) for event in whole.trace.events[: completed(whole)[0]]]
    answer = next(event for event in events if event["event"] == "answer" and event["asked"].startswith("call"))
    if damage == "value":
        answer["value"] = {"$": "Popen"}
    else:
        events.remove(answer)
    with pytest.raises(Different, match="DamagedTrace"):
        run_plan(top, resume=RecordedRun.of(events))


def test_an_executive_that_cannot_restore_says_so() -> None:
    @plan
    async def top() -> None:
        await seq(partial(sleep, 1))

    whole = run_plan(top, resumable=True)
    assert not restore(object(), Past(cut(whole, completed(whole)[0])))
    assert restore(object(), Past(cut(whole, 2)))


def test_a_cause_of_a_class_of_the_plans_own_is_told_by_name() -> None:
    class Jammed(Exception):
        pass

    async def fails() -> None:
        raise GraspMissed(what="cup") from Jammed("finger")

    @plan
    async def top() -> str:
        try:
            await with_failure_handling(fails, Recovery(ObjectNotFound))
        except GraspMissed as failure:
            await seq(partial(sleep, 1))
            return f"{type(failure.__cause__).__name__}: {failure.__cause__}"
        return "nothing"

    whole = run_plan(top, resumable=True)
    assert whole.value == "Jammed: finger"
    assert list(resumed_everywhere(top, whole))


def test_a_record_behind_the_end_of_the_plan_is_not_repeated() -> None:
    @plan
    async def top() -> None:
        await sleep(1)

    events = run_plan(top, resumable=True).trace.events
    found = replay(top, RecordedRun.of([*events, events[-1]]))
    assert found.difference is not None
    assert (found.difference.line, found.difference.found) == (len(events) + 1, "nothing: the plan has ended")


def test_each_number_of_gauss_is_taken_over_also_where_it_takes_no_draw() -> None:
    async def draws() -> float:
        return rng().gauss(0, 1)

    @plan
    async def top() -> Any:
        found = [await with_failure_handling(draws) for _ in range(4)]
        return [*found, rng().random()]

    assert len(list(resumed_everywhere(top, run_plan(top, resumable=True)))) == 4
