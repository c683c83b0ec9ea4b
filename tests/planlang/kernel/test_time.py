"""Time is a count of world steps; nothing else tells it."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import SimulationHost, VirtualHost, checkpoint, now, par, rng, run, sleep


class CountingWorld:
    """A world that counts its steps."""

    def __init__(self, rate: int = 240) -> None:
        self.rate = rate
        self.steps = 0

    def step(self) -> None:
        self.steps += 1


def test_sleep_takes_the_exact_number_of_steps() -> None:
    world = CountingWorld()

    async def plan() -> None:
        for _ in range(100):
            await sleep(0.1)

    run(plan, host=SimulationHost(world))
    assert world.steps == 2400


def test_sleep_rounds_up_but_not_by_the_noise_of_floating_point() -> None:
    async def plan() -> list[float]:
        times = []
        for seconds in (0.3, 1 / 240, 1.0001 / 240, 0.1 + 0.2):
            before = now()
            await sleep(seconds)
            times.append(round((now() - before) * 240))
        return times

    assert go(plan) == [72, 1, 2, 72]


@pytest.mark.parametrize("seconds", [-1.0, math.nan, -1e-9, math.inf, 1e308])
def test_a_negative_infinite_or_undefined_duration_is_a_value_error(seconds: float) -> None:
    with pytest.raises(ValueError, match="duration"):
        go(partial(sleep, seconds))


def test_time_stands_still_while_tasks_run() -> None:
    world = CountingWorld()

    async def plan() -> None:
        for _ in range(1000):
            await checkpoint()
        await sleep(0)
        assert world.steps == 0
        await par(*[partial(sleep, 0.5)] * 50)

    run(plan, host=SimulationHost(world))
    assert world.steps == 120


def test_a_virtual_host_and_a_simulated_world_give_the_same_times() -> None:
    async def plan() -> list[float]:
        times = []

        async def worker(pause: float) -> None:
            for _ in range(5):
                await sleep(pause)
                times.append(now())

        await par(partial(worker, 0.25), partial(worker, 0.1))
        return times

    assert go(plan) == run(plan, host=SimulationHost(CountingWorld()))


def test_random_numbers_are_a_function_of_seed_and_task_path() -> None:
    async def draw() -> float:
        return rng().random()

    async def two() -> Any:
        return await par(a=draw, b=draw)

    first, second = go(two, seed=1)
    assert first != second
    assert go(two, seed=1) == [first, second]
    assert go(two, seed=1, schedule=5) == [first, second]
    assert go(two, seed=2) != [first, second]


def test_one_task_draws_one_stream() -> None:
    async def plan() -> tuple[float, float]:
        return rng().random(), rng().random()

    first, second = go(plan)
    assert first != second


def test_adding_a_branch_does_not_shift_the_numbers_of_another() -> None:
    drawn: dict[str, float] = {}

    async def draw(name: str) -> None:
        drawn[name] = rng().random()

    async def plan(names: str) -> None:
        await par(**{name: partial(draw, name) for name in names})

    go(partial(plan, "ab"), seed=3)
    before = dict(drawn)
    go(partial(plan, "cab"), seed=3)
    assert (drawn["a"], drawn["b"]) == (before["a"], before["b"])


@pytest.mark.parametrize("rate", [0, -1, 2.5, True])
def test_a_rate_is_a_positive_integer(rate: Any) -> None:
    with pytest.raises(ValueError, match="rate"):
        VirtualHost(rate)
