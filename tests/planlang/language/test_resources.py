"""Resources: one holder at a time, granted in order of asking, without deadlock."""

from __future__ import annotations

from functools import partial
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from virtual_time import go

from planlang import Trace, par, pursue, sleep, using
from planlang.runs import with_paths


def test_resources_are_in_the_trace_when_granted_and_released_on_evaporation_too() -> None:
    async def holds() -> None:
        async with using("left_arm", "base"):
            await sleep(9)

    trace = Trace()
    go(partial(pursue, holds, partial(sleep, 1)), trace=trace)
    told = [(e["step"], e["event"], e["path"], e["resources"]) for e in with_paths(trace.events) if "resources" in e]
    assert told == [
        (0, "acquired", "pursue/pursue/holds", ["left_arm", "base"]),
        (240, "released", "pursue/pursue/holds", ["left_arm", "base"]),
    ]


@settings(max_examples=60, deadline=None)
@given(
    users=st.lists(
        st.tuples(st.integers(0, 3), st.integers(1, 3), st.lists(st.sampled_from("abc"), min_size=1, max_size=3)),
        min_size=1,
        max_size=6,
    ),
    schedule=st.one_of(st.none(), st.integers(0, 99)),
)
def test_a_resource_has_one_holder_and_requests_never_deadlock(users: Any, schedule: int | None) -> None:
    held: set[str] = set()

    async def user(start: int, long: int, names: list[str]) -> None:
        await sleep(start)
        async with using(*names):
            assert not held & set(names)
            held.update(names)
            await sleep(long)
            held.difference_update(names)

    go(partial(par, *(partial(user, *one) for one in users)), schedule=schedule)
    assert held == set()
