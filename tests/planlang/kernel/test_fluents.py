"""Facts of CRAM's own tests of fluents, F1-F19, and the rules of waiting, expressions and world fluents."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *


async def set_later(fluent: Fluent[Any], value: Any, after: float = 1.0) -> None:
    await sleep(after)
    fluent.set(value)


async def time_of(signal: Any, timeout: float | None = None) -> tuple[Any, float]:
    return await wait_for(signal, timeout), now()


def test_f1_waiting_for_a_false_fluent_blocks_until_it_is_true() -> None:
    async def plan() -> Any:
        fluent = Fluent(0)
        return (await par(partial(time_of, fluent), partial(set_later, fluent, 7)))[0]

    assert go(plan) == (7, 1.0)


def test_f2_waiting_for_a_true_fluent_returns_its_value_at_once() -> None:
    assert go(partial(time_of, Fluent("yes"))) == ("yes", 0.0)


def test_f3_ten_waiters_are_released_by_one_pulse() -> None:
    async def plan() -> list[Any]:
        fluent = Fluent(False)

        async def pulse() -> None:
            await sleep(1)
            fluent.pulse()

        return list(await par(pulse, *[partial(time_of, fluent.pulsed()) for _ in range(10)]))

    assert go(plan)[1:] == [(True, 1.0)] * 10


def test_f4_a_wait_with_a_timeout_returns_none_when_it_is_over() -> None:
    assert go(partial(time_of, Fluent(False), 0.5)) == (None, 0.5)


def test_f5_a_value_set_in_the_step_of_the_timeout_is_in_time_under_every_schedule() -> None:
    async def plan() -> Any:
        fluent = Fluent(False)
        return (await par(partial(time_of, fluent, 1.0), partial(set_later, fluent, True)))[0]

    assert [go(plan, schedule=k) for k in (None, 0, 1, 2)] == [(True, 1.0)] * 4


def test_f6_a_wait_is_latched_by_the_first_true_value() -> None:
    async def plan() -> Any:
        fluent = Fluent(0)

        async def flicker() -> None:
            await sleep(1)
            fluent.set(5)
            fluent.set(0)

        return (await par(partial(time_of, fluent), flicker))[0]

    assert go(plan) == (5, 1.0)


def test_f7_a_pulse_without_a_true_value_does_not_end_a_wait() -> None:
    async def plan() -> Any:
        fluent = Fluent(0)

        async def pulse() -> None:
            await sleep(1)
            fluent.pulse()
            await sleep(1)
            fluent.set(3)

        return (await par(partial(time_of, fluent), pulse))[0]

    assert go(plan) == (3, 2.0)


async def count_runs(signal: Any, log: list[float], stop_after: int | None = None) -> None:
    async def body() -> Any:
        log.append(now())
        return Return(None) if len(log) == stop_after else None

    await whenever(signal, body)


def test_f8_whenever_runs_the_body_for_an_initially_true_fluent() -> None:
    log: list[float] = []
    go(partial(count_runs, Fluent(True), log, 1))
    assert log == [0.0]


def test_f9_whenever_runs_again_in_the_next_step_while_the_fluent_stays_true() -> None:
    log: list[float] = []
    go(partial(count_runs, Fluent(True), log, 3))
    assert log == [0.0, 1 / 240, 2 / 240]


def test_f10_whenever_does_not_run_the_body_for_a_false_fluent_nor_on_pulses_while_it_is_false() -> None:
    log: list[float] = []

    async def plan() -> None:
        fluent = Fluent(False)

        async def pulses() -> None:
            for _ in range(5):
                await sleep(0.1)
                fluent.pulse()

        await par(partial(count_runs, fluent, log), pulses)

    with pytest.raises(DeadlockError):
        go(plan)
    assert log == []


def test_f11_whenever_runs_exactly_five_times_for_one_change_and_four_pulses_if_none_is_missed() -> None:
    log: list[float] = []

    async def plan() -> None:
        fluent = Fluent(0)

        async def changes() -> None:
            await sleep(0.1)
            fluent.set(1)
            for _ in range(4):
                fluent.pulse()

        await par(partial(count_runs, fluent.pulsed(missed="always"), log), changes)

    with pytest.raises(DeadlockError):
        go(plan)
    assert len(log) == 5


def test_f12_return_leaves_whenever_with_a_value() -> None:
    async def body() -> Return[str]:
        return Return("left")

    assert go(partial(whenever, Fluent(True), body)) == "left"


def test_f13_twenty_five_consumers_each_see_all_fifty_pulses_if_none_is_missed() -> None:
    async def plan() -> list[Any]:
        fluent = Fluent(0)

        async def consumer() -> int:
            pulses = fluent.pulsed(missed="always")
            seen = 0
            while seen < 50:
                await wait_for(pulses)
                seen += 1
                if seen % 7 == 0:
                    await sleep(0.01)
            return seen

        async def producer() -> None:
            await checkpoint()
            for _ in range(50):
                fluent.pulse()
                await checkpoint()

        return list(await par(producer, *[consumer] * 25))

    assert go(plan)[1:] == [50] * 25


def test_f14_fifty_consumers_see_the_last_of_a_hundred_values_if_missed_ones_count_once() -> None:
    async def plan() -> list[Any]:
        fluent = Fluent(-1)

        async def consumer() -> int:
            pulses = fluent.pulsed(missed="once")
            while fluent.value != 99:
                await wait_for(pulses)
                await sleep(0.01)
            return fluent.value

        async def producer() -> None:
            for value in range(100):
                await sleep(1 / 240)
                fluent.set(value)

        return list(await par(producer, *[consumer] * 50))

    assert go(plan)[1:] == [99] * 50


def test_f15_with_missed_never_a_pulse_before_the_wait_is_not_seen() -> None:
    async def plan() -> Any:
        fluent = Fluent(0)
        pulses = fluent.pulsed(missed="never")
        fluent.pulse()
        return await wait_for(pulses, 0.5)

    assert go(plan) is None


@pytest.mark.parametrize("schedule", [None, 1, 2])
def test_f16_two_tasks_changing_two_inputs_of_a_sum_never_deadlock(schedule: int | None) -> None:
    async def plan() -> Any:
        a, b = Fluent(0), Fluent(0)

        async def count(fluent: Fluent[int]) -> None:
            for value in range(1, 101):
                fluent.set(value)
                await checkpoint()

        return (await par(partial(wait_for, a + b == 200), partial(count, a), partial(count, b)))[0]

    assert go(plan, schedule=schedule) is True


def test_f17_the_same_fluent_twice_in_one_expression_is_never_seen_half_changed() -> None:
    async def plan() -> Any:
        fluent = Fluent(1)
        torn = (fluent + fluent) != fluent * 2

        async def change() -> None:
            for value in range(50):
                await sleep(1 / 240)
                fluent.set(value)

        return (await par(partial(wait_for, torn, 2.0), change))[0]

    assert go(plan) is None


def test_f18_expressions_are_lazy_and_show_the_current_values() -> None:
    a, b = Fluent(2), Fluent(3)
    expressions = [
        a + b,
        a - b,
        a * b,
        b / a,
        10 - a,
        -a,
        abs(a - b),
        a < b,
        a == 2,
        a != 2,
        (a > 1) & (b > 5),
        ~(a > 1),
    ]
    assert [e.value for e in expressions] == [5, -1, 6, 1.5, 8, -2, 1, True, True, False, False, False]
    b.set(7)
    assert [e.value for e in expressions] == [9, -5, 14, 3.5, 8, -2, 5, True, True, False, True, False]
    assert ((a > 5) | b).value == 7


def test_f19_what_an_expression_raises_is_raised_in_the_waiter() -> None:
    async def plan() -> None:
        divisor = Fluent(1)

        async def waits() -> None:
            with pytest.raises(ZeroDivisionError):
                await wait_for(1 / divisor > 5)

        await par(waits, partial(set_later, divisor, 0))

    go(plan)


def test_the_truth_of_a_fluent_is_a_type_error_that_names_value() -> None:
    with pytest.raises(TypeError, match=r"\.value"):
        assert Fluent(1)
    with pytest.raises(TypeError, match=r"\.value"):
        assert Fluent(1) == 1


def test_fluents_are_hashed_by_identity() -> None:
    a, b = Fluent(1), Fluent(1)
    assert len({a: None, b: None}) == 2
    assert a in {a: None}


def test_an_equal_value_is_no_change_and_no_pulse() -> None:
    fluent = Fluent(1)
    fluent.set(1)
    assert (fluent.changes, fluent.pulses) == (0, 0)


def test_changed_is_consumed_only_when_a_wait_ends() -> None:
    async def plan() -> list[Any]:
        fluent = Fluent(0)
        changed = fluent.changed()
        seen: list[Any] = [changed.value]
        fluent.set(1)
        seen += [changed.value, changed.value, await wait_for(changed), changed.value]
        return seen

    assert go(plan) == [False, True, True, True, False]


def test_what_came_true_while_held_is_looked_at_again_after_waking_up() -> None:
    async def plan() -> Any:
        fluent = Fluent(False)
        handle = task("waiter")

        async def control() -> None:
            async with task_suspended(handle):
                fluent.set(True)
                await sleep(1)
                fluent.set(False)
            await sleep(1)
            fluent.set(True)

        return (await par(partial(tag, "waiter", partial(time_of, fluent)), control))[0]

    assert go(plan) == (True, 2.0)


class Falling:
    """A world in which something falls by 1/128 per step."""

    rate = 240

    def __init__(self) -> None:
        self.height = 1.0
        self.steps = 0
        self.reads = 0

    def step(self) -> None:
        self.height -= 1 / 128
        self.steps += 1

    def read(self) -> float:
        self.reads += 1
        return self.height


def test_a_world_fluent_is_sampled_once_per_step_however_many_wait() -> None:
    world = Falling()
    height: Fluent[float] = Fluent(read=world.read, name="height")

    async def plan() -> None:
        await par(*[partial(wait_for, height < 0.5)] * 10)

    run(plan, host=SimulationHost(world))
    assert world.steps == 65
    assert world.reads == 66


def test_a_world_fluent_nobody_waits_for_is_not_sampled() -> None:
    world = Falling()
    height: Fluent[float] = Fluent(read=world.read)

    async def plan() -> float:
        await wait_for(height < 0.99)
        await sleep(1)
        return height.value

    assert run(plan, host=SimulationHost(world)) == pytest.approx(1 - 242 / 128)
    assert world.reads == 4


def test_a_world_fluent_shows_one_value_for_a_whole_step() -> None:
    truth = [1]
    fluent: Fluent[int] = Fluent(read=lambda: truth[0])

    async def plan() -> list[int]:
        seen = [fluent.value]
        truth[0] = 2
        await checkpoint()
        seen += [fluent.value, fluent.read()]
        await sleep(1 / 240)
        seen.append(fluent.value)
        return seen

    assert go(plan) == [1, 1, 2, 2]


def test_an_error_in_reading_the_world_is_raised_in_the_waiter() -> None:
    calls = [0]

    def read() -> bool:
        calls[0] += 1
        if calls[0] == 3:
            raise OSError("sensor lost")
        return False

    with pytest.raises(OSError, match="sensor lost"):
        go(partial(wait_for, Fluent(read=read)))


def test_a_world_fluent_cannot_be_set() -> None:
    with pytest.raises(TypeError, match="read from the world"):
        Fluent(read=lambda: 1, name="height").set(3)


def test_virtual_time_goes_step_by_step_while_anyone_waits_for_a_world_fluent() -> None:
    async def plan() -> float:
        await wait_for(Fluent(read=lambda: now() >= 0.7))
        return now()

    assert go(plan) == 0.7


def test_missed_is_one_of_three_words() -> None:
    with pytest.raises(ValueError, match="'never', 'once', 'always'"):
        Fluent(1).pulsed(missed="sometimes")


def test_expressions_read_as_they_were_written() -> None:
    speed, load = Fluent(1, "speed"), Fluent(2, "load")
    assert str(~(speed > 3) & (abs(-load) == 1)) == "(~(speed > 3) & (abs(-load) == 1))"
