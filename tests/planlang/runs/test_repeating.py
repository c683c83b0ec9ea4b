"""A run that was cut off is run again up to its last record, and goes on from there, as if it had not been cut off."""

from __future__ import annotations

import os
import signal
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from planlang import (
    Action,
    PlanFailure,
    Trace,
    VirtualHost,
    action,
    in_thread,
    par,
    perform,
    plan,
    rng,
    run,
    seq,
    sleep,
    unwind_protect,
)
from planlang.kernel import compute_in_thread
from planlang.language.process_module import ModuleOnce
from planlang.runs import DamagedTrace, Different, RecordedRun, Repetition
from planlang.runs.repeating import RepeatedTrace
from planlang.runs.trace import Earlier
from planlang.testing import replay
from planlang.testing.script import Script
from planlang.testing.scripted import ScriptedExecutive

OUTSIDE: list[str] = []
"""What was done outside of runs."""


class Ordering:
    """A process module that orders things, which must not happen twice."""

    name, actions, failures, once = "ordering", ("Ordering",), (PlanFailure,), True

    def resources(self, what: Action) -> tuple[str, ...]:
        """It needs nothing."""
        return ()

    async def execute(self, what: Action) -> int:
        """Order, which takes a while; without a number of pieces it fails."""
        await sleep(0.5)
        OUTSIDE.append("ordered")
        await in_thread(OUTSIDE.append, "paid")
        await sleep(0.5)
        pieces = what.get("amount")
        if pieces is None:
            raise PlanFailure("how many?")
        return int(str(pieces))


def executive() -> ScriptedExecutive:
    """A scripted robot that can order, too."""
    made = ScriptedExecutive(Script())
    made.modules = (*made.modules, ModuleOnce(Ordering()))  # type: ignore[assignment]
    return made


def read_port() -> float:
    """Ask something outside."""
    OUTSIDE.append("read")
    return len(OUTSIDE) / 7


def refuse() -> None:
    """Fail outside."""
    OUTSIDE.append("refused")
    raise PlanFailure("the port is closed")


@plan
async def serve() -> Any:
    """Do something of each kind."""
    found = [await in_thread(read_port), rng().random()]

    async def wash() -> float:
        await perform(action("Perceiving"), name="look")
        return await compute_in_thread(lambda: sum(found))

    async def order() -> Any:
        try:
            await perform(action("Ordering"))
        except PlanFailure:
            return await perform(action("Ordering", amount=3))

    found += await par(wash, order)
    try:
        await in_thread(refuse)
    except PlanFailure as failure:
        found.append(str(failure))
    await seq(partial(sleep, 1.0), partial(perform, action("Reaching")))
    return found


def recorded(body: Callable[[], Awaitable[Any]], trace: Trace) -> Any:
    """Run a plan with a scripted robot."""
    return run(body, host=VirtualHost(), executive=executive(), trace=trace, resumable=True, seed=7)


def repeated(
    body: Callable[[], Awaitable[Any]], records: Sequence[dict[str, Any]], more: Trace | None = None
) -> tuple[Any, list[dict[str, Any]]]:
    """Run a plan again behind some records; return its result and all records."""
    written = Trace() if more is None else more

    def go_on(earlier: Earlier) -> Trace:
        written.take_over((line.record for line in earlier.kept), earlier.nodes)
        return written

    result = recorded(body, RepeatedTrace(Repetition(RecordedRun.of(records)), go_on))
    return result, written.events


@pytest.fixture(scope="module")
def whole() -> tuple[Any, list[dict[str, Any]]]:
    """What the plan returned, and its records as they come back from a file."""
    OUTSIDE.clear()
    trace = Trace()
    result = recorded(serve, trace)
    return result, [line.record for line in RecordedRun.of(trace.events).lines]  # type: ignore[misc]


def test_a_run_cut_off_after_any_record_ends_as_if_it_had_not_been(whole: tuple[Any, list[dict[str, Any]]]) -> None:
    result, records = whole
    for cut in range(1, len(records)):
        OUTSIDE.clear()
        again, found = repeated(serve, records[:cut])
        assert again == result
        assert [one for one in found if one["event"] != "resumed"] == records
        (mark,) = (place for place, one in enumerate(found) if one["event"] == "resumed")
        assert mark == cut
        OUTSIDE.clear()
        assert repeated(serve, found[: cut + 1])[0] == result, "once more"


def test_what_happened_once_is_replayed(whole: tuple[Any, list[dict[str, Any]]]) -> None:
    _, records = whole
    assert replay(serve, RecordedRun.of(records)).equal


def test_what_was_under_way_outside_is_told(whole: tuple[Any, list[dict[str, Any]]]) -> None:
    _, records = whole
    for event in ("called", "outside"):
        place = next(place for place, one in enumerate(records) if one["event"] == event)
        under_way = Repetition(RecordedRun.of(records[: place + 1])).in_flight
        assert [line.number for line in under_way] == [place + 1]
    assert Repetition(RecordedRun.of(records)).in_flight == []


def test_what_had_returned_outside_is_not_asked_again(whole: tuple[Any, list[dict[str, Any]]]) -> None:
    _, records = whole
    OUTSIDE.clear()
    repeated(serve, records[:-1])
    assert OUTSIDE == []
    repeated(serve, records[:1])
    assert sorted(OUTSIDE) == sorted(["read", "refused", *2 * ["ordered", "paid"]])


def test_a_record_that_is_not_repeated_ends_the_run_before_anything_is_written(
    whole: tuple[Any, list[dict[str, Any]]],
) -> None:
    _, records = whole
    place = next(place for place, one in enumerate(records) if one["event"] == "completed")
    changed = [*records[:place], {**records[place], "step": records[place]["step"] + 1}]
    written = Trace()
    with pytest.raises(Different, match=rf"line {place + 1} is not repeated\n  recorded .*\n  found "):
        repeated(serve, changed, written)
    assert written.events == []


def test_a_run_that_does_something_else_asks_nothing_outside() -> None:
    async def report() -> None:
        await in_thread(OUTSIDE.append, "cleaned up")

    async def work(*steps: Any) -> None:
        for step in steps:
            await step()

    reach, order = partial(perform, action("Reaching")), partial(perform, action("Ordering", amount=1))
    trace = Trace()
    recorded(partial(work, reach, reach, reach), trace)
    for other in (partial(in_thread, read_port), order):
        OUTSIDE.clear()
        with pytest.raises(Different):
            repeated(partial(work, reach, other), trace.events[:-3])
        with pytest.raises(Different):
            repeated(partial(unwind_protect, partial(work, reach, other), report), trace.events[:-3])
        assert OUTSIDE == []


def test_a_plan_that_ends_before_its_records_do_is_another_one() -> None:
    trace = Trace()

    async def sleeper(times: int) -> None:
        for _ in range(times):
            await perform(action("Reaching"))

    recorded(partial(sleeper, 2), trace)
    part = trace.events[:-2]
    with pytest.raises(Different, match="is not repeated"):
        repeated(partial(sleeper, 1), part)


def test_records_behind_the_end_of_a_run_are_not_repeated(whole: tuple[Any, list[dict[str, Any]]]) -> None:
    _, records = whole
    more = {"step": records[-1]["step"], "event": "belief", "revision": 99}
    with pytest.raises(Different, match="nothing: the plan has ended"):
        repeated(serve, [*records, more])


def test_a_trace_that_does_not_go_on_is_closed_without_a_file(whole: tuple[Any, list[dict[str, Any]]]) -> None:
    _, records = whole

    def go_on(earlier: Earlier) -> Trace:
        raise AssertionError(earlier)

    trace = RepeatedTrace(Repetition(RecordedRun.of([*records, records[-1]])), go_on)
    with pytest.raises(Different):
        recorded(serve, trace)
    trace.close()


def test_listeners_hear_of_what_is_repeated_too(whole: tuple[Any, list[dict[str, Any]]]) -> None:
    _, records = whole
    heard: list[str] = []
    written = Trace()

    def go_on(earlier: Earlier) -> Trace:
        written.take_over((line.record for line in earlier.kept), earlier.nodes)
        return written

    trace = RepeatedTrace(Repetition(RecordedRun.of(records[:20])), go_on)
    trace.listeners = (lambda record, _: heard.append(record["event"]),)
    recorded(serve, trace)
    assert [one for one in heard if one != "resumed"] == [one["event"] for one in records[1:]]


def test_what_came_after_ctrl_c_is_not_repeated(whole: tuple[Any, list[dict[str, Any]]]) -> None:
    _, records = whole
    step = records[20]["step"]
    told = [*records[:20], {"step": step, "event": "interrupted"}, {"step": step, "event": "drained"}]
    _, found = repeated(serve, told)
    assert [one for one in found if one["event"] != "resumed"] == records


def test_ctrl_c_amid_the_repetition_leaves_everything_as_it_was() -> None:
    again: list[bool] = []

    @plan
    async def serve_slowly() -> None:
        await perform(action("Reaching"))
        if again:
            os.kill(os.getpid(), signal.SIGINT)
        await perform(action("Reaching"))
        await perform(action("Reaching"))

    trace = Trace()
    recorded(serve_slowly, trace)
    again.append(True)
    written = Trace()
    with pytest.raises(KeyboardInterrupt):
        repeated(serve_slowly, trace.events[:-2], written)
    assert written.events == []


def test_a_result_from_outside_that_does_not_survive_is_found_before_the_run() -> None:
    trace = Trace()

    async def odd() -> None:
        await in_thread(object)

    recorded(odd, trace)
    line = Repetition(RecordedRun.of(trace.events)).lost
    assert line is not None
    assert "object" in line.record["lost"]


def test_an_answer_that_cannot_be_read_is_damage(whole: tuple[Any, list[dict[str, Any]]]) -> None:
    _, records = whole
    place = next(place for place, one in enumerate(records) if str(one.get("asked")).startswith("call"))
    with pytest.raises(DamagedTrace):
        Repetition(RecordedRun.of([*records[:place], {**records[place], "value": {"$": "Nothing"}}]))


def test_where_steps_were_taken_over_without_running_the_run_cannot_be_repeated(
    whole: tuple[Any, list[dict[str, Any]]],
) -> None:
    _, records = whole
    mark = {"step": records[5]["step"], "event": "resumed"}
    assert Repetition(RecordedRun.of([*records[:5], mark])).skipped is not None
    assert Repetition(RecordedRun.of([*records[:5], {**mark, "repeated": 5}])).skipped is None


def test_a_trace_that_goes_on_is_written_to_its_file(whole: tuple[Any, list[dict[str, Any]]], tmp_path: Path) -> None:
    _, records = whole
    repetition = Repetition(RecordedRun.of(records[:9]))
    trace = RepeatedTrace(repetition, lambda earlier: Trace.at(tmp_path / "run.jsonl", earlier=earlier))
    recorded(serve, trace)
    trace.close()
    found = [line.record for line in RecordedRun.read(tmp_path / "run.jsonl").lines]
    assert [one for one in found if one["event"] != "resumed"] == records
