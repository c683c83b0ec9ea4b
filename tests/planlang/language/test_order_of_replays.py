"""The order in a replay: of what process modules wake by the records, of all else by the plan itself."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import pytest
from cut_runs import at_every_cut, difference

from planlang import *
from planlang.failures import ObjectNotFound
from planlang.testing import Script, run_plan


async def perceiving() -> None:
    await perform(action("Perceiving"))


def test_a_branch_that_waits_on_as_a_request_ends_is_repeated_before_the_next_request_of_the_module() -> None:
    """What a branch does without a record, here a sleep of 0 s, may come before a record of another one."""
    waiting_on = partial(unwind_protect, partial(sleep, 0.5), partial(sleep, 0))

    async def top() -> Any:
        try:
            return await par(perceiving, perceiving, waiting_on)
        except PlanFailure as failure:
            return failure

    run = run_plan(top, script=Script().on("Perceiving", fails=ObjectNotFound, times=1, after=0.5), resumable=True)
    at_the_end = [(one["event"], one["name"]) for one in run.trace.events if one["step"] == 120]
    assert at_the_end.index(("ended", "unwind_protect")) < at_the_end.index(("acquired", "perception"))
    assert at_every_cut(top, run) == []


async def pausing(body: Callable[[], Awaitable[Any]], times: int) -> Any:
    for _ in range(times):
        await sleep(0)
    return await body()


@pytest.mark.parametrize("zeros", range(6))
@pytest.mark.parametrize("begins", [0, 3])
def test_branches_that_a_request_wakes_and_those_that_they_wake_are_repeated_in_their_order(
    zeros: int, begins: int
) -> None:
    async def other() -> None:
        await sleep(0.5)
        await pausing(partial(sleep, 0), zeros)

    @plan
    async def top() -> None:
        seen = Fluent(False, "seen")

        async def looking() -> None:
            await sleep(0.25)
            async with using("head"):  # when the request has ended
                await sleep(0)
                seen.set(True)
                await sleep(0)

        await par(
            partial(pausing, perceiving, 1),
            looking,
            partial(wait_for, seen),
            partial(pausing, other, begins),
        )

    run = run_plan(top, script=Script().on("Perceiving", after=0.5), resumable=True)
    assert at_every_cut(top, run) == []


@pytest.mark.parametrize("seconds", [0.5, 1.0])
def test_the_order_of_branches_is_compared_as_a_request_ends_and_after_what_it_has_woken(seconds: float) -> None:
    zeros = {"early": 0, "late": 1}

    async def ends(name: str, wait: float) -> None:
        await sleep(wait)
        await tag(name, partial(pausing, partial(sleep, 0), zeros[name]))

    async def looking() -> None:
        await sleep(0.25)
        async with using("head"):  # when the request has ended, at 0.5 s
            pass
        await ends("early", seconds - 0.5)

    async def top() -> None:
        early = looking if seconds > 0.5 else partial(ends, "early", seconds)
        await par(perceiving, early, partial(ends, "late", seconds))

    run = run_plan(top, script=Script().on("Perceiving", after=0.5), resumable=True)
    assert at_every_cut(top, run) == []
    zeros |= {"early": 1, "late": 0}
    recorded, found = difference(top, run)
    assert recorded["step"] == found["step"] == seconds * 240
    assert (recorded["event"], found["event"]) == ("ended", "ended")
    assert (recorded["path"].rpartition("/")[2], found["path"].rpartition("/")[2]) == ("early", "late")
