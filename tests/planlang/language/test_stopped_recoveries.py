"""Evaporation stops recoveries and alternatives, also when a cleanup fails on the way out."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from typing import Any

import pytest

from planlang import (
    RETRY,
    PlanFailure,
    Recovery,
    Return,
    VirtualHost,
    a_location,
    an_object,
    at_location,
    evaporate,
    now,
    par,
    race,
    run,
    seq,
    sleep,
    state_machine,
    tag,
    task_suspended,
    timeout,
    try_each_in_order,
    try_in_order,
    unwind_protect,
    with_failure_handling,
)
from planlang import task as task_of
from planlang.failures import GraspMissed, ManipulationPoseUnreachable, Timeout

Plan = Callable[[], Awaitable[Any]]


class Stopped:
    """A body that waits, with a cleanup that fails 0.5 s after it is evaporated; ``begun`` says when it began."""

    def __init__(self, failure: type[PlanFailure] = GraspMissed) -> None:
        self.failure = failure
        self.begun: list[float] = []
        self.cleaned: list[float] = []

    async def __call__(self, *_: Any) -> None:
        self.begun.append(now())
        await unwind_protect(partial(sleep, 100), self.clean_up)

    async def clean_up(self) -> None:
        self.cleaned.append(now())
        await sleep(0.5)
        raise self.failure()


class Handlers:
    """What a recovery, or an alternative, is that must not be used; ``used`` says when it was."""

    def __init__(self) -> None:
        self.used: list[float] = []

    async def recover(self, failure: PlanFailure) -> Any:
        self.used.append(now())
        return RETRY

    async def alternative(self, *_: Any) -> str:
        self.used.append(now())
        return "found"

    def instead(self, failure: PlanFailure) -> PlanFailure:
        self.used.append(now())
        return failure


async def handled(body: Plan, handlers: Handlers) -> Any:
    return await with_failure_handling(body, Recovery(GraspMissed, handlers.recover, attempts=3))


async def escalated(body: Plan, handlers: Handlers) -> Any:
    return await with_failure_handling(body, Recovery(GraspMissed, attempts=0, otherwise=handlers.instead))


async def given_up(body: Plan, handlers: Handlers) -> Any:
    await with_failure_handling(body, Recovery(GraspMissed, attempts=0, otherwise=Return(None)))
    handlers.used.append(now())


async def tried(body: Plan, handlers: Handlers) -> Any:
    return await try_in_order(body, handlers.alternative)


async def each_tried(body: Plan, handlers: Handlers) -> Any:
    return await try_each_in_order([body, handlers.alternative], lambda one: one())


async def states(body: Plan, handlers: Handlers) -> Any:
    cases: Any = {("first", GraspMissed): "other"}
    return await state_machine({"first": body, "other": handlers.alternative}, cases, start="first", end="other")


CONSTRUCTS = [handled, escalated, given_up, tried, each_tried, states]
AROUND: dict[str, Callable[[Plan], Plan]] = {
    "bare": lambda plan: plan,
    "in a sequence": lambda plan: partial(seq, plan),
    "handled again": lambda plan: partial(with_failure_handling, plan, Recovery(PlanFailure, attempts=2)),
    "tried again": lambda plan: partial(try_in_order, plan, plan),
}


@pytest.mark.parametrize("around", AROUND.values(), ids=AROUND.keys())
@pytest.mark.parametrize("construct", CONSTRUCTS)
def test_nothing_begins_after_a_timeout_though_a_cleanup_fails(construct: Any, around: Any) -> None:
    body, handlers = Stopped(), Handlers()
    with pytest.raises(Timeout) as raised:
        run(lambda: timeout(1, around(partial(construct, body, handlers))), host=VirtualHost())
    assert (body.begun, body.cleaned, handlers.used) == ([0.0], [1.0], [])
    assert [type(failure) for failure in raised.value.cleanup_failures] == [GraspMissed]


@pytest.mark.parametrize("outer", CONSTRUCTS)
@pytest.mark.parametrize("inner", CONSTRUCTS)
def test_nothing_begins_in_constructs_within_each_other(inner: Any, outer: Any) -> None:
    body, handlers = Stopped(), Handlers()
    nested = partial(outer, partial(inner, body, handlers), handlers)
    with pytest.raises(Timeout) as raised:
        run(lambda: timeout(1, nested), host=VirtualHost())
    assert (body.begun, handlers.used) == ([0.0], [])
    assert [type(failure) for failure in raised.value.cleanup_failures] == [GraspMissed]


def test_a_branch_that_lost_does_not_recover() -> None:
    body, handlers = Stopped(), Handlers()
    assert run(lambda: race(partial(sleep, 1), partial(handled, body, handlers)), host=VirtualHost()) == ("sleep", None)
    assert (body.begun, handlers.used) == ([0.0], [])


def test_a_location_scope_asks_for_no_further_place(executive: Any, module: Any) -> None:
    body = Stopped(ManipulationPoseUnreachable)
    with pytest.raises(Timeout):
        run(
            lambda: timeout(2, lambda: at_location(a_location(near=an_object("Cup")), body)),
            host=VirtualHost(),
            executive=executive,
        )
    assert body.begun == [0.5]
    assert executive.log == ["at 1"]


def test_a_recovery_that_swallows_its_evaporation_does_not_run_the_body_again() -> None:
    runs: list[float] = []

    async def body() -> None:
        runs.append(now())
        raise GraspMissed

    async def stubborn(failure: PlanFailure) -> Any:
        with suppress(GraspMissed):
            await Stopped()()
        return RETRY

    with pytest.raises(Timeout):
        run(
            lambda: timeout(1, lambda: with_failure_handling(body, Recovery(GraspMissed, stubborn))), host=VirtualHost()
        )
    assert runs == [0.0]


def test_a_cleanup_recovers_from_its_own_failures() -> None:
    """Inside a shield evaporation does not reach the task, so that all constructs work."""
    handlers = Handlers()
    missed = [GraspMissed(), GraspMissed()]

    async def retract() -> None:
        await sleep(0.25)
        if missed:
            raise missed.pop()

    cleanup = partial(with_failure_handling, retract, Recovery(GraspMissed, handlers.recover, attempts=2))
    with pytest.raises(Timeout) as raised:
        run(lambda: timeout(1, lambda: unwind_protect(partial(sleep, 9), cleanup)), host=VirtualHost())
    assert handlers.used == [1.25, 1.5]
    assert raised.value.cleanup_failures == ()


def test_evaporation_while_suspended_begins_nothing_either() -> None:
    body, handlers = Stopped(), Handlers()

    async def stop() -> None:
        await sleep(1)
        async with task_suspended(task_of("work")):
            await sleep(1)
            evaporate(task_of("work"))

    async def main() -> None:
        with suppress(PlanFailure):
            await par(lambda: tag("work", partial(handled, body, handlers)), stop)

    run(main, host=VirtualHost())
    assert (body.begun, handlers.used) == ([0.0], [])
