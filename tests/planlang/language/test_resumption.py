"""Resuming a run from its trace: what has completed is not done again, and everything else is as if never cut."""

from __future__ import annotations

import io
import os
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from cut_runs import completed, cut, without_mark
from hypothesis import settings
from hypothesis import strategies as st

from planlang import *
from planlang.failures import GraspMissed, Timeout
from planlang.runs import Past, RecordedRun
from planlang.testing import replay, run_plan

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

    return await with_failure_handling(body, Recovery(GraspMissed, retries=2))


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


def test_a_call_in_a_thread_of_a_step_that_was_not_completed_is_made_again() -> None:
    calls: list[str] = []

    async def calling() -> str:
        await in_thread(calls.append, "called")
        await sleep(5.0)
        return "b"

    @plan
    async def top() -> Any:
        return await partial_order({"a": partial(sleep, 1.0), "b": calling}, [])

    whole = run_plan(top, resumable=True)
    past = 1 + next(i for i, e in enumerate(whole.trace.events) if e["event"] == "completed")
    assert run_plan(top, resume=cut(whole, past)).value == whole.value
    assert calls == ["called", "called"]


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

    async def ignoring(body: Callable[[], Awaitable[Any]]) -> Any:
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
