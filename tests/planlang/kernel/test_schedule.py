"""Choices among tasks that can run: from a number, from a list, from somebody else's source; and what breaks in."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from random import Random

import pytest

from planlang import Trace, VirtualHost, checkpoint, par, plan, run
from planlang.failures import PlanFailure
from planlang.kernel import Task
from planlang.kernel.schedule import CountedRandom
from planlang.kernel.tree import Node
from planlang.runs import with_paths


def order_of(schedule: object) -> tuple[list[str], Trace]:
    log: list[str] = []

    async def say(word: str) -> None:
        await checkpoint()
        log.append(word)

    async def main() -> None:
        await par(a=lambda: say("a"), b=lambda: say("b"), c=lambda: say("c"))

    trace = Trace()
    run(main, host=VirtualHost(), schedule=schedule, trace=trace)  # type: ignore[arg-type]
    return log, trace


def test_a_list_of_choices_says_which_of_the_ready_tasks_runs_next_and_then_first_comes_first() -> None:
    assert order_of(None)[0] == order_of([])[0] == order_of([0, 0])[0] == ["a", "b", "c"]
    assert order_of([2])[0] == ["c", "a", "b"]
    assert order_of([2, 1])[0] == ["c", "b", "a"]


def test_a_choice_beyond_the_last_task_is_the_last_task() -> None:
    assert order_of([99])[0] == order_of([2])[0]


def test_the_trace_says_by_which_choices_it_can_be_repeated() -> None:
    assert order_of([2, 1])[1].events[0]["schedule"] == [2, 1]
    assert order_of(7)[1].events[0]["schedule"] == 7
    assert order_of(None)[1].events[0]["schedule"] is None


@pytest.mark.parametrize("schedule", [[-1], [True], ["a"], [0.5]])
def test_what_is_no_list_of_places_is_refused(schedule: list[object]) -> None:
    with pytest.raises(ValueError, match="whole numbers from 0"):
        order_of(schedule)


class Last:
    """Always the one that came last."""

    asked = 0

    def choose(self, ready: Sequence[Task]) -> int:
        assert len(ready) > 1
        self.asked += 1
        return len(ready) - 1

    def __str__(self) -> str:
        return "the last"


def test_a_source_is_asked_only_where_there_is_a_choice() -> None:
    source = Last()
    log, trace = order_of(source)
    assert log == ["c", "b", "a"]
    assert source.asked
    assert trace.events[0]["schedule"] == "the last"


@plan
async def inner() -> None:
    await checkpoint()


async def outer() -> None:
    await checkpoint()
    await inner()
    await par(branch=checkpoint)


@pytest.mark.parametrize("step", ["outer", "inner", "par", "branch"])
def test_what_is_raised_when_a_node_begins_is_what_the_node_fails_with(step: str) -> None:
    def fail(node: Node) -> None:
        if node.name == step:
            raise PlanFailure(f"injected into {step}")

    trace = Trace()
    with pytest.raises(PlanFailure, match=f"injected into {step}") as raised:
        run(outer, host=VirtualHost(), trace=trace, on_start=fail)
    assert raised.value.where is not None
    assert raised.value.where.path.split("/")[-1] == step
    ended = {event["path"]: event["status"] for event in with_paths(trace.events) if event["event"] == "ended"}
    started = [event["path"] for event in with_paths(trace.events) if event["event"] == "started"]
    assert sorted(ended) == sorted(started)
    assert {path for path, status in ended.items() if status == "failed"} == {
        path for path in ended if f"{raised.value.where.path}/".startswith(f"{path}/")
    }


def draw_a_bit_of_everything(stream: Random) -> list[object]:
    return [
        stream.random(),
        stream.randrange(10**12),
        stream.gauss(0, 1),
        stream.sample(range(99), 5),
        stream.choice("ab"),
    ]


def test_a_counted_stream_gives_the_numbers_of_pythons_and_can_be_brought_to_where_it_was() -> None:
    counted, pythons = CountedRandom("7 plan"), Random("7 plan")
    assert draw_a_bit_of_everything(counted) == draw_a_bit_of_everything(pythons)
    kinds = set()
    for _ in range(2):  # with a second number of gauss ready, and without
        kinds.add(type(counted.draws))
        again = CountedRandom("7 plan")
        again.go_to(counted.draws)
        assert again.getstate() == counted.getstate()
        assert counted.gauss(0, 1) == again.gauss(0, 1)
    assert kinds == {list, int}


def test_many_draws_are_made_again_in_little_memory() -> None:
    counted = CountedRandom("many")
    counted.getrandbits(32 * 250_000)
    again = CountedRandom("many")
    again.go_to(250_000)
    assert again.random() == counted.random()


@pytest.mark.parametrize("draws", [-1, True, "many", None, 10**12, [1], [1, 2], [True, 0.5], [1, 0.5, 2]])
def test_what_is_no_count_of_draws_is_refused(draws: object) -> None:
    with pytest.raises(ValueError, match="number of its draws"):
        CountedRandom("7").go_to(draws)


def test_a_stream_does_not_go_back_and_one_that_the_plan_has_seeded_is_not_counted() -> None:
    counted = CountedRandom("7")
    counted.random()
    with pytest.raises(ValueError, match="cannot go back to 1 draws"):
        counted.go_to(1)
    for reseeded in (partial(counted.seed, 3), partial(counted.setstate, Random(3).getstate())):
        reseeded()
        assert (counted.random(), counted.getrandbits(8)) != (0, 0)
        with pytest.raises(ValueError, match="seeded by the plan"):
            _ = counted.draws
