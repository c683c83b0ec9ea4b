"""Random plans of independent branches: no schedule changes their outcome, and faults leave nothing half done."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from planlang import (
    Recovery,
    Return,
    action,
    checkpoint,
    par,
    perform,
    pursue,
    seq,
    shield,
    sleep,
    tag,
    timeout,
    try_all,
    try_in_order,
    unwind_protect,
    with_failure_handling,
)
from planlang import plan as a_plan
from planlang.failures import GraspMissed, ObjectLost, PlanFailure
from planlang.testing import Fault, PlanRun, Script, explore, run_plan

Branch = Callable[[], Awaitable[Any]]
NAMES = ("sleeping", "passing", "missing", "acting", "guarded", "par", "pursue", "seq", "try_all", "timeout", "tagged")


async def sleeping(seconds: float) -> float:
    await sleep(seconds)
    return seconds


async def passing(times: int) -> int:
    for _ in range(times):
        await checkpoint()
    return times


async def missing(seconds: float) -> None:
    await sleep(seconds)
    raise GraspMissed(what=str(seconds))


async def acting() -> object:
    return await perform(action("Perceiving"))


async def guarded(body: Branch, seconds: float) -> object:
    async def clean_up() -> None:
        with shield(within=5):
            await sleep(seconds)

    return await unwind_protect(body, clean_up)


async def tagged(body: Branch) -> object:
    @a_plan
    async def inner() -> object:
        return await tag("tagged", body)  # names of tags are those of a plan

    return await inner()


async def recovering(body: Branch) -> object:
    return await with_failure_handling(body, Recovery(PlanFailure, attempts=1, otherwise=Return("gave up")))


TIMES = st.sampled_from([0.0, 0.1, 0.2, 0.25])
LEAVES = st.one_of(
    TIMES.map(lambda s: partial(sleeping, s)),
    st.integers(0, 3).map(lambda n: partial(passing, n)),
    TIMES.map(lambda s: partial(missing, s)),
)


def spread(construct: Any, branches: list[Branch]) -> Branch:
    """The construct over these branches."""
    return partial(construct, *branches)


def over(leaves: st.SearchStrategy[Branch]) -> st.SearchStrategy[Branch]:
    """Trees of constructs over leaves."""

    def larger(inner: st.SearchStrategy[Branch]) -> st.SearchStrategy[Branch]:
        several = st.lists(inner, min_size=1, max_size=3)
        constructs: tuple[Any, ...] = (par, pursue, seq, try_all, try_in_order)
        return st.one_of(
            st.builds(spread, st.sampled_from(constructs), several),
            st.tuples(inner, TIMES).map(lambda found: partial(timeout, found[1], found[0])),
            st.tuples(inner, TIMES).map(lambda found: partial(guarded, *found)),
            inner.map(lambda found: partial(recovering, found)),
            inner.map(lambda found: partial(tagged, found)),
        )

    return st.recursive(leaves, larger, max_leaves=8)


FAULTS = st.lists(
    st.builds(
        Fault,
        st.sampled_from(NAMES),
        st.just(ObjectLost),
        attempt=st.sampled_from([None, 1, 2]),
        after=st.sampled_from([None, 0.0, 0.1, 0.15]),
        at=st.sampled_from([None, None, 0.1, 0.2]),
    ),
    max_size=3,
)


def check_tree(run: PlanRun[object]) -> None:
    """Every step has begun inside its parent and ended before it, with a status."""
    for step in run.steps():
        assert step.status in ("succeeded", "failed", "evaporated"), step
        assert step.end is not None
        assert step.parent is None or (step.parent.first < step.first and step.last < step.parent.last), step


@settings(max_examples=50, deadline=None)
@given(over(LEAVES))
def test_branches_that_share_nothing_have_one_outcome_under_random_schedules_and_priorities(plan: Branch) -> None:
    async def main() -> object:
        return await plan()

    explore(main, schedules=8)


@settings(max_examples=100, deadline=None)
@given(over(st.one_of(LEAVES, st.just(acting))), FAULTS)
def test_whatever_fails_every_step_ends_inside_its_parent_and_nothing_is_left(
    plan: Branch, faults: list[Fault]
) -> None:
    async def main() -> object:
        return await plan()

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = run_plan(main, script=Script(takes=0.15), faults=faults)
        again = run_plan(main, script=Script(takes=0.15), faults=faults)
        gc.collect(0)
    check_tree(run)
    assert again.trace.text() == run.trace.text()
    assert run.unused == again.unused
