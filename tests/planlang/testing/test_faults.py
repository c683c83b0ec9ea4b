"""Injected faults: any step fails by name, attempt and time; its cleanup runs, and nothing is left half done."""

from __future__ import annotations

import gc
import warnings
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import hypothesis
import pytest
from hypothesis import settings
from hypothesis import strategies as st

from planlang import *
from planlang import plan as a_plan
from planlang.failures import GraspMissed, GraspSlipped, ObjectLost
from planlang.testing import Fault, PlanRun, Script, explore, run_plan
from tests.support.examples import examples

log: list[str] = []


@plan
async def carry() -> float:
    async def work() -> float:
        await par(arm=lambda: sleep(2), base=lambda: sleep(3))
        return now()

    async def put_back() -> None:
        await sleep(0.5)
        log.append(f"put back at {now():g}")

    return await unwind_protect(work, put_back)


async def main() -> float:
    return await with_failure_handling(carry, Recovery(ObjectLost, retries=3))


@pytest.fixture(autouse=True)
def empty_log() -> None:
    log.clear()


def test_a_step_fails_as_it_begins() -> None:
    run = run_plan(main, faults=[Fault("carry", GraspMissed)])
    assert isinstance(run.failure, GraspMissed)
    assert run.failed_with("carry", GraspMissed)
    assert run.seconds == 0
    assert log == []
    assert run.failure.where is not None
    assert run.failure.where.path.endswith("carry")


def test_a_step_fails_at_the_attempt_that_was_named() -> None:
    run = run_plan(main, faults=[Fault("carry", ObjectLost, attempt=1), Fault("carry", GraspMissed, attempt=2)])
    assert isinstance(run.failure, GraspMissed)
    assert [step.status for step in run.steps("carry")] == ["failed", "failed"]


def test_a_step_fails_some_time_after_it_began_with_its_children_evaporated_and_its_cleanup_done() -> None:
    run = run_plan(main, faults=[Fault("carry", ObjectLost, attempt=1, after=2.5)])
    assert run.value == 2.5 + 0.5 + 3.0
    assert log == ["put back at 3", "put back at 6.5"]
    assert run.evaporated("carry/par/base")
    first, second = run.steps("carry")
    assert (first.status, first.end, second.start) == ("failed", 3.0, 3.0)


def test_a_step_fails_at_a_plan_time_if_it_runs_then() -> None:
    async def twice() -> None:
        await seq(one=lambda: sleep(1), two=lambda: sleep(1))

    run = run_plan(partial(twice), faults=[Fault("seq", GraspSlipped, at=1.5)])
    assert isinstance(run.failure, GraspSlipped)
    assert run.seconds == 1.5
    late = run_plan(partial(twice), faults=[Fault("seq", GraspSlipped, at=5)])
    assert late.failure is None
    assert late.unused == ("fault GraspSlipped in seq at 5 s",)
    before = run_plan(main, faults=[Fault("carry", ObjectLost, at=2.0)])
    assert before.attempts("carry") == 2


def test_a_performed_step_is_told_by_its_name_or_its_class() -> None:
    reach = partial(perform, action("Reaching"), name="ReachForBottle")
    for name in ("ReachForBottle", "Reaching", "perform_twice/ReachForBottle"):

        async def perform_twice() -> None:
            await reach()
            await reach()

        run = run_plan(perform_twice, faults=[Fault(name, GraspMissed, attempt=2, after=0.5)])
        assert isinstance(run.failure, GraspMissed), name
        assert run.seconds == 1.5
        assert [step.status for step in run.steps("ReachForBottle")] == ["succeeded", "failed"]


def test_tags_branches_and_constructs_can_fail_too() -> None:
    async def work() -> None:
        await par(
            a=lambda: tag("watch", partial(sleep, 2)), b=lambda: retry_after_suspension(partial(sleep, 2)), c=carry
        )

    for step in ("watch", "a", "b", "retry_after_suspension", "par", "work", "par/a"):
        for after in (None, 1.0):
            run = run_plan(work, faults=[Fault(step, ObjectLost, after=after)])
            assert isinstance(run.failure, ObjectLost), (step, after)
            assert run.failed_with(step, ObjectLost)
            assert all(found.end is not None for found in run.steps())


def test_a_shielded_part_is_broken_off_too_for_a_fault_is_the_steps_own() -> None:
    async def guarded() -> None:
        with shield(within=10):
            await sleep(4)

    run = run_plan(guarded, faults=[Fault("guarded", ObjectLost, after=1)])
    assert isinstance(run.failure, ObjectLost)
    assert run.seconds == 1


def test_a_fault_may_be_a_programming_error_which_no_recovery_catches() -> None:
    with pytest.raises(ZeroDivisionError):
        run_plan(main, faults=[Fault("carry", ZeroDivisionError)])


def test_faults_of_a_script_are_those_of_the_first_attempt_unless_it_says_otherwise() -> None:
    assert run_plan(main, script=Script().fault("carry", ObjectLost)).attempts("carry") == 2
    always = run_plan(main, script=Script().fault("carry", ObjectLost, attempt=None))
    assert always.attempts("carry") == 4
    assert isinstance(always.failure, ObjectLost)
    assert run_plan(main, script=Script().fault("carry", ObjectLost, at=4)).failure is None


def test_equal_faults_give_equal_traces() -> None:
    faults = [Fault("carry", lambda: PlanFailure("lost"), after=1.25), Fault("arm", ObjectLost, attempt=None, after=1)]
    assert run_plan(main, faults=faults).trace.text() == run_plan(main, faults=faults).trace.text()


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
    return await with_failure_handling(body, Recovery(PlanFailure, retries=1, otherwise=Return("gave up")))


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


@settings(max_examples=examples(50), deadline=None)
@hypothesis.given(over(LEAVES))
def test_branches_that_share_nothing_have_one_outcome_under_random_schedules_and_priorities(plan: Branch) -> None:
    async def main() -> object:
        return await plan()

    explore(main, schedules=8)


@settings(max_examples=examples(100), deadline=None)
@hypothesis.given(over(st.one_of(LEAVES, st.just(acting))), FAULTS)
def test_whatever_fails_every_step_ends_inside_its_parent_and_nothing_is_left(
    plan: Branch, faults: list[Fault]
) -> None:
    async def main() -> object:
        return await plan()

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run = run_plan(main, script=Script(takes=0.15), faults=faults, allow_unused=True)
        again = run_plan(main, script=Script(takes=0.15), faults=faults, allow_unused=True)
        gc.collect(0)
    check_tree(run)
    assert again.trace.text() == run.trace.text()
    assert run.unused == again.unused
