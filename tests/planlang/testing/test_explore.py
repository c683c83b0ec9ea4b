"""Exploration of schedules and linear extensions: what depends on them is found, shown and shrunk."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from functools import partial
from itertools import pairwise, permutations
from typing import Any

import hypothesis
import pytest
from hypothesis import strategies as st

from planlang import *
from planlang.failures import ObjectLost
from planlang.files import bundled
from planlang.kernel import Task
from planlang.ontology import load
from planlang.recipe import Actions, read_recipe
from planlang.testing import PlanRun, ScheduleDependence, all_linear_extensions, compiled, explore, run_plan
from planlang.testing.exploring import Priorities, Recorder, Shrinker, continued, trimmed


async def check_then_act() -> list[str]:
    """Both look whether the gripper is free before either takes it, but only in some orders."""
    free, log = True, list[str]()

    async def take(who: str) -> None:
        nonlocal free
        await checkpoint()
        if free:
            free = False
            log.append(who)

    await par(cup=lambda: take("cup"), bowl=lambda: take("bowl"))
    return log


async def independent() -> list[Any]:
    async def work(name: str) -> str:
        for _ in range(3):
            await checkpoint()
        await sleep(0.1)
        return name

    async def fail() -> None:
        await sleep(0.1)
        raise ObjectLost(what="cup")

    return [
        await par(partial(work, "a"), partial(work, "b")),
        await pursue(partial(work, "c"), partial(work, "d")),
        await try_all(partial(work, "e"), fail),
    ]


def test_what_shares_nothing_has_the_same_outcome_under_all_schedules() -> None:
    found = explore(independent, schedules=60)
    assert found.outcome == 'returned [["a", "b"], "c", "e"]'
    assert found.runs == 60
    assert found.different > 30
    assert "60 runs" in str(found)


def test_an_outcome_that_depends_on_the_schedule_is_shown_with_both_traces_side_by_side() -> None:
    with pytest.raises(ScheduleDependence) as raised:
        explore(check_then_act)
    report = str(raised.value).splitlines()
    assert report[0] == 'the outcome depends on the schedule: returned ["bowl"] instead of returned ["cup"]'
    assert "the shortest list of choices is [1]" in report[1]
    assert "run_plan(check_then_act, schedule=[1])" in report[1]
    assert report[2].split("  ")[0] == "first come, first served"
    assert report[2].endswith("with these choices")
    assert any(" | " in line for line in report)
    assert report[-1].count("result") == 2


def test_the_shortest_choices_repeat_what_was_found() -> None:
    with pytest.raises(ScheduleDependence) as raised:
        explore(check_then_act)
    found = raised.value
    assert found.usual.value == ["cup"]
    assert found.other.value == ["bowl"]
    again = run_plan(check_then_act, schedule=list(found.choices))
    assert again.value == ["bowl"]
    assert again.events[1:] == found.other.events[1:]


def test_an_assertion_that_some_schedule_breaks_is_told_with_its_message() -> None:
    def check(run: PlanRun[list[str]]) -> None:
        assert run.value == ["cup"], "the cup comes first"

    with pytest.raises(ScheduleDependence, match="depends on the schedule: the cup comes first"):
        explore(check_then_act, check=check)


def test_an_assertion_about_order_in_the_trace_holds_or_not() -> None:
    async def steps() -> None:
        await par(first=checkpoint, second=checkpoint)

    def ordered(run: PlanRun[None]) -> None:
        assert run.happened_before("first", "second") or run.overlapped("first", "second")

    with pytest.raises(ScheduleDependence):
        explore(steps, check=ordered)
    assert explore(independent, schedules=20, check=lambda run: run.value).runs == 20


def test_an_assertion_that_always_fails_is_not_about_schedules() -> None:
    def never(run: PlanRun[Any]) -> None:
        raise AssertionError("never")

    with pytest.raises(AssertionError, match=r"^never$"):
        explore(independent, check=never)
    with pytest.raises(ZeroDivisionError):
        explore(broken)


async def broken() -> None:
    raise ZeroDivisionError


def test_failures_and_errors_are_outcomes_too() -> None:
    async def plan(error: type[Exception]) -> None:
        ready = Fluent(False)

        async def wait() -> None:
            if not ready.value:
                raise error("too early")

        async def set_() -> None:
            ready.set(True)

        await par(set_, wait)

    for error in (PlanFailure, KeyError):
        with pytest.raises(ScheduleDependence, match=f"{error.__name__}: .?too early.? instead of returned null"):
            explore(partial(plan, error))
    with pytest.raises(ScheduleDependence, match="KeyError: 'too early'"):
        explore(partial(plan, KeyError), check=lambda run: None)


def test_a_lost_wake_up_is_found_as_a_deadlock() -> None:
    async def plan() -> None:
        bell = Fluent(False)

        async def ring() -> None:
            bell.set(True)
            bell.set(False)

        await par(wait=lambda: wait_for(bell), ring=ring)

    with pytest.raises(ScheduleDependence, match="DeadlockError"):
        explore(plan)
    with pytest.raises(DeadlockError):
        run_plan(plan, schedule=[1])


def test_a_plan_that_keeps_something_between_runs_is_refused() -> None:
    count = itertools.count()

    async def plan() -> int:
        return next(count)

    with pytest.raises(ValueError, match="two runs with the same choices differ"):
        explore(plan)


def test_compiled_plans_are_explored_with_their_script() -> None:
    assert explore(compiled("serve_a_drink"), schedules=10).outcome == "returned null"


def test_seeds_of_plans_are_not_those_of_schedules() -> None:
    async def plan() -> tuple[float, ...]:
        async def draw() -> float:
            return rng().random()

        return tuple(await par(draw, draw))

    outcomes = {explore(plan, schedules=20, seed=seed).outcome for seed in (1, 2)}
    assert len(outcomes) == 2


async def deep(order: Sequence[int]) -> bool:
    """True if five tasks happened to run in one order of the 120."""
    came: list[int] = []

    async def come(number: int) -> None:
        came.append(number)

    await par(*(partial(come, number) for number in range(5)))
    return came == list(order)


def test_lists_of_choices_shrink_to_the_shortest_and_of_these_the_smallest() -> None:
    async def third_before_second() -> bool:
        came: list[int] = []

        async def come(number: int) -> None:
            for _ in range(number):
                await checkpoint()
            came.append(number)

        await par(*(partial(come, number) for number in (1, 2, 3)))
        return came.index(3) < came.index(2)

    with pytest.raises(ScheduleDependence) as raised:
        explore(third_before_second)
    best = raised.value.choices
    assert "the shortest list" in str(raised.value)
    shorter = [c for n in range(len(best)) for c in itertools.product(range(3), repeat=n)]
    same = [c for c in itertools.product(range(3), repeat=len(best)) if c < best]
    assert not any(run_plan(third_before_second, schedule=choices).value for choices in (*shorter, *same))
    assert run_plan(third_before_second, schedule=best).value


def test_shrinking_ends_with_its_runs_and_says_so() -> None:
    with pytest.raises(ScheduleDependence, match="a short list of choices"):
        explore(partial(deep, [4, 3, 2, 1, 0]), schedules=2000, shrinking_runs=3)


def test_the_shrinker_leaves_out_zeroes_and_lowers() -> None:
    def breaks(choices: tuple[int, ...]) -> tuple[bool, list[int]]:
        padded = (*choices, *(0,) * 20)[:20]
        return padded[2] >= 2 and padded[5] >= 1, [4] * 20

    shrinker = Shrinker(breaks, 10_000)
    assert shrinker.shrink([3, 1, 3, 0, 2, 2, 3, 1, 0, 3]) == (0, 0, 2, 0, 0, 1)
    assert shrinker.proven
    assert not Shrinker(breaks, 0).proven


def test_priorities_find_orders_that_few_schedules_have() -> None:
    def found(make: Any) -> int:
        return sum(bool(run_plan(partial(deep, [4, 3, 2, 1, 0]), schedule=make(n)).value) for n in range(400))

    assert found(lambda n: Priorities(n, 4)) > 0


def test_priorities_keep_to_one_task_until_they_change() -> None:
    async def long(name: str, log: list[str]) -> None:
        for _ in range(10):
            await checkpoint()
            log.append(name)

    async def plan() -> int:
        log: list[str] = []
        await par(partial(long, "a", log), partial(long, "b", log))
        return sum(one != other for one, other in itertools.pairwise(log))

    switches = [run_plan(plan, schedule=Priorities(number, 20, depth=3)).value for number in range(50)]
    assert max(switches) <= 3, "one switch at the end of a task, and one for each change of priorities"
    assert len(set(switches)) > 1
    assert run_plan(plan).value == 19


def test_a_recorder_keeps_choices_and_of_how_many_they_were() -> None:
    recorder = Recorder(Priorities(3, 4))
    run = run_plan(partial(deep, range(5)), schedule=recorder)
    assert recorder.sizes == [5, 4, 3, 2]
    assert str(recorder) == "priorities 3"
    assert run.events[0]["schedule"] == "priorities 3"
    again = run_plan(partial(deep, range(5)), schedule=recorder.choices)
    assert again.events[1:] == run.events[1:]
    assert str(Recorder()) == "first come, first served"
    assert trimmed([0, 2, 0, 0]) == (0, 2)


def test_tasks_are_told_apart_by_what_they_are_not_by_their_place() -> None:
    class Names:
        def __init__(self) -> None:
            self.seen: list[list[str]] = []

        def choose(self, ready: Sequence[Task]) -> int:
            self.seen.append([task.name for task in ready])
            return 1

    source = Names()
    run_plan(partial(deep, range(5)), schedule=source)
    assert source.seen[0] == ["come", "come#2", "come#3", "come#4", "come#5"]
    assert source.seen[1] == ["come", "come#3", "come#4", "come#5"]


def test_where_schedules_are_few_all_of_them_are_run_once() -> None:
    async def three() -> str:
        await par(checkpoint, checkpoint, checkpoint)
        return "done"

    async def alone() -> str:
        await checkpoint()
        return "done"

    found = explore(three, schedules=200)
    assert found.complete
    assert found.runs == found.different == 90, "6! / (2! 2! 2!) ways for three tasks to take two turns each"
    assert str(found) == 'returned "done", under all 90 schedules'
    assert (explore(alone).runs, explore(alone).complete) == (1, True)
    assert not explore(three, schedules=35).complete
    assert not explore(three, schedules=50).complete, "it looked as if they were few enough"
    assert not explore(independent, schedules=5).complete


def test_all_lists_of_choices_are_met_once() -> None:
    queue: list[tuple[int, ...]] = [()]
    for choices in queue:
        queue.extend(continued(choices, [2, 3, 2]))
    assert sorted(queue) == sorted({trimmed(full) for full in itertools.product(range(2), range(3), range(2))})
    assert len(queue) == 12


def test_a_check_that_asks_for_the_value_of_a_failed_run_is_broken_by_it() -> None:
    async def plan() -> None:
        if await check_then_act() == ["bowl"]:
            raise ObjectLost(what="cup")

    with pytest.raises(ScheduleDependence, match="ObjectLost"):
        explore(plan, check=lambda run: run.value)

    def silent(run: PlanRun[None]) -> None:
        if run.failure is not None:
            raise AssertionError

    with pytest.raises(ScheduleDependence, match="an assertion failed"):
        explore(plan, check=silent)


async def two_takers() -> list[str]:
    """Whoever finds the gripper free waits a turn before taking it; usually it is being prepared by then."""
    gripper: str | None = None
    log: list[str] = []

    async def prepare() -> None:
        nonlocal gripper
        await checkpoint()
        gripper = "prepared"
        await sleep(1)
        gripper = None

    async def take(who: str) -> None:
        nonlocal gripper
        await checkpoint()
        await checkpoint()
        if gripper is None:
            await checkpoint()
            gripper = who
            log.append(who)
            await sleep(0.1)
            gripper = None

    await par(prepare, cup=lambda: take("cup"), bowl=lambda: take("bowl"))
    return log


def test_a_race_that_first_come_first_served_never_shows_is_found_and_repeated() -> None:
    def exclusive(run: PlanRun[list[str]]) -> None:
        assert len(run.value) <= 1, f"two hold the gripper: {run.value}"

    assert {tuple(run_plan(two_takers).value) for _ in range(20)} == {()}
    with pytest.raises(ScheduleDependence, match="two hold the gripper") as raised:
        explore(two_takers, check=exclusive)
    choices = raised.value.choices
    assert sorted(run_plan(two_takers, schedule=choices).value) == ["bowl", "cup"]
    for shorter in (choices[:-1], choices[1:], (*choices[:-1], choices[-1] - 1)):
        assert len(run_plan(two_takers, schedule=shorter).value) <= 1


def respects(order: tuple[str, ...], pairs: list[tuple[str, str]]) -> bool:
    return all(order.index(a) < order.index(b) for a, b in pairs)


@hypothesis.given(st.integers(0, 6), st.data())
def test_they_are_the_permutations_that_respect_the_orderings(size: int, data: st.DataObject) -> None:
    names = [f"s{n}" for n in range(size)]
    possible = [(a, b) for number, a in enumerate(names) for b in names[number + 1 :]]
    pairs = data.draw(st.lists(st.sampled_from(possible), max_size=8)) if possible else []
    found = all_linear_extensions(names, pairs)
    assert list(found) == [order for order in permutations(names) if respects(order, pairs)]
    assert found.complete
    assert found.total == len(found)


def test_large_orders_are_sampled_without_repetition_and_the_same_each_time() -> None:
    names = [f"s{n}" for n in range(10)]
    pairs = [("s3", "s1"), ("s1", "s0")]
    found = all_linear_extensions(names, pairs, limit=50)
    assert not found.complete
    assert found.total == 3_628_800 // 6
    assert len(found) == len(set(found)) == 50
    assert all(respects(order, pairs) for order in found)
    assert found == all_linear_extensions(names, pairs, limit=50)
    assert found != all_linear_extensions(names, pairs, limit=50, seed=1)


def test_orders_that_can_be_counted_are_drawn_uniformly() -> None:
    # a before b beside a chain c < d < e: ten orders, of which choosing step by step prefers some
    drawn: Counter[tuple[str, ...]] = Counter()
    for seed in range(2000):
        drawn.update(all_linear_extensions("abcde", ["ab", "cd", "de"], limit=1, seed=seed))  # type: ignore[list-item]
    assert len(drawn) == 10
    assert min(drawn.values()) > 140
    assert max(drawn.values()) < 260


def test_orders_that_cannot_be_counted_are_sampled_all_the_same() -> None:
    names = [f"s{n}" for n in range(40)]
    pairs = [(f"s{n}", f"s{n + 20}") for n in range(20)]
    found = all_linear_extensions(names, pairs, limit=30)
    assert found.total is None
    assert len(found) == 30
    assert all(respects(order, pairs) for order in found)


def test_chains_of_many_steps_are_no_problem() -> None:
    names = [f"s{n}" for n in range(800)]
    found = all_linear_extensions(names, list(pairwise(names)))
    assert found == (tuple(names),)


@pytest.mark.parametrize("pairs", [[("a", "b"), ("b", "a")], [("a", "a")]])
def test_a_cycle_is_refused(pairs: list[tuple[str, str]]) -> None:
    with pytest.raises(ValueError, match="cycle"):
        all_linear_extensions(["a", "b"], pairs)
    with pytest.raises(ValueError, match="cycle"):
        all_linear_extensions([*"ab", *(f"s{n}" for n in range(30))], pairs)


def test_unknown_and_doubled_steps_are_refused() -> None:
    with pytest.raises(ValueError, match=r"ordering \(a, c\): no step 'c'; steps: a, b"):
        all_linear_extensions(["a", "b"], [("a", "c")])
    with pytest.raises(ValueError, match="same name"):
        all_linear_extensions(["a", "a"])


def test_a_recipe_gives_the_orders_of_its_steps() -> None:
    reading = read_recipe(Actions(load(bundled("recipes") / "serve_a_drink.omn")), None)
    assert reading.recipes is not None
    for recipe in reading.recipes.recipes.values():
        found = all_linear_extensions(recipe)
        assert found.complete
        for order in found:
            assert sorted(order) == sorted(step.name for step in recipe.steps)
    assert all_linear_extensions(reading.recipes) == all_linear_extensions(reading.recipes.main)


def test_every_order_is_one_in_which_a_partial_order_can_run() -> None:
    names, pairs = ["reach", "grasp", "look", "lift"], [("reach", "grasp"), ("grasp", "lift"), ("look", "lift")]
    for order in all_linear_extensions(names, pairs):

        async def one_by_one(order: tuple[str, ...] = order) -> None:
            steps: dict[str, Any] = dict.fromkeys(order, checkpoint)
            await seq(**steps)

        run = run_plan(one_by_one)
        assert all(run.happened_before(a, b) for a, b in pairs)
    limited = run_plan(partial(partial_order, dict.fromkeys(names, checkpoint), pairs, limit=1))
    began = sorted((step for name in names for step in limited.steps(name)), key=lambda step: step.first)
    assert tuple(step.name for step in began) in all_linear_extensions(names, pairs)
