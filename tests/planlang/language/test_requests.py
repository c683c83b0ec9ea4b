"""Asynchronous requests: CRAM's P9-P12 and P16, and what belongs to a request that nobody waits for."""

from __future__ import annotations

from functools import partial
from typing import Any

import hypothesis
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from virtual_time import go

from planlang import *
from planlang.failures import ActionUnresolvable, BranchEvaporated, GraspMissed, GraspSlipped, Timeout
from planlang.runs import with_paths
from tests.support.examples import examples

FAILURES = {"missed": GraspMissed, "slipped": GraspSlipped, "broken": KeyError}


@pytest.fixture
def robot(executive: Any, module: Any) -> Any:
    """Two arms; a motion takes ``takes`` seconds and fails with ``fails``."""

    async def move(wanted: Action) -> str:
        executive.log.append(f"{wanted.type} begins {now():g}")
        try:
            await sleep(float(str(wanted.get("takes") or 1)))
        except BaseException:
            executive.log.append(f"{wanted.type} stops {now():g}")
            raise
        fails = wanted.get("fails")
        if fails is not None:
            raise FAILURES[str(fails)](str(wanted.get("takes")))
        return f"{wanted.type} moved"

    for arm in ("Left", "Right"):
        executive.extra.append(module(arm, (arm,), move, (PlanFailure,), (f"{arm} arm",)))
    return executive


async def left(**details: Any) -> Request:
    return await perform_async(action("Left", **details))


async def right(**details: Any) -> Request:
    return await perform_async(action("Right", **details))


def test_p9_an_asynchronous_request_returns_at_once_and_monitor_gives_its_result(robot: Any) -> None:
    async def body() -> tuple[float, str, float]:
        request = await left(takes=2)
        asked = now()
        return asked, await monitor(request), now()

    assert go(partial(with_requests, body), robot) == (0, "Left moved", 2)


def test_p10_requests_finish_one_by_one_and_monitoring_one_does_not_wait_for_another(robot: Any) -> None:
    async def body() -> list[float]:
        slow, fast = await left(takes=5), await right(takes=1)
        times = []
        for request in (fast, slow):
            await monitor(request)
            times.append(now())
        return times

    assert go(partial(with_requests, body), robot) == [1, 5]


def test_p11_requests_fail_one_by_one_without_effect_on_each_other_or_the_body(robot: Any) -> None:
    async def body() -> list[str]:
        bad, good = await left(takes=1, fails="missed"), await right(takes=3)
        await sleep(2)
        seen = [bad.status.value.value, good.status.value.value]
        seen.append(await monitor(good))
        with pytest.raises(GraspMissed):
            await monitor(bad)
        return seen

    assert go(partial(with_requests, body), robot) == ["failed", "running", "Right moved"]


def test_p12_monitor_raises_only_the_failure_of_its_own_request_as_the_same_object(robot: Any) -> None:
    async def body() -> None:
        first, second = await left(fails="missed"), await right(fails="slipped")
        with pytest.raises(GraspSlipped) as caught:
            await monitor(second)
        assert caught.value is second.failure
        with pytest.raises(GraspMissed):
            await monitor(first)
        with pytest.raises(GraspMissed):
            await monitor(first)

    go(partial(with_requests, body), robot)


def test_p16_a_module_asked_under_two_action_classes_works_on_one_request_at_a_time(
    executive: Any, module: Any
) -> None:
    async def work(wanted: Action) -> None:
        executive.log.append(f"{wanted.type} {now():g}")
        await sleep(1)

    executive.extra.append(module("hands", ("Opening", "Closing"), work))

    async def body() -> None:
        for kind in ("Opening", "Closing", "Opening"):
            await perform_async(action(kind))

    go(partial(with_requests, body), executive)
    assert executive.log == ["Opening 0", "Closing 1", "Opening 2"]


def test_requests_of_one_module_are_served_first_come_first_served_synchronous_ones_too(robot: Any) -> None:
    async def body() -> float:
        await left(takes=1)
        await left(takes=1)
        await perform(action("Left", takes=1))
        return now()

    for schedule in (None, *range(20)):
        assert go(partial(with_requests, body), robot, schedule=schedule) == 3


def test_what_is_left_when_the_body_succeeds_is_waited_for(robot: Any) -> None:
    async def plan() -> float:
        await with_requests(partial(left, takes=3))
        return now()

    assert go(plan, robot) == 3


def test_a_failure_that_nobody_monitored_is_raised_at_the_end_with_later_ones_as_siblings(robot: Any) -> None:
    async def body() -> None:
        await left(takes=2, fails="missed")
        await right(takes=1, fails="slipped")

    with pytest.raises(GraspMissed) as caught:
        go(partial(with_requests, body), robot)
    assert [type(failure) for _, failure in caught.value.siblings] == [GraspSlipped]


def test_what_is_left_when_the_body_fails_is_cancelled_and_its_failure_is_raised(robot: Any) -> None:
    async def body() -> None:
        bad = await left(takes=1, fails="missed")
        await right(takes=9)
        await monitor(bad)

    with pytest.raises(GraspMissed):
        go(partial(with_requests, body), robot)
    assert robot.log[-1] == "Right stops 1"


def test_evaporating_the_caller_cancels_its_requests(robot: Any) -> None:
    async def body() -> None:
        await left(takes=9)
        await sleep(9)

    go(partial(pursue, partial(with_requests, body), partial(sleep, 1)), robot)
    assert robot.log == ["Left begins 0", "Left stops 1"]


def test_suspending_the_caller_cancels_its_requests_and_makes_them_again(robot: Any) -> None:
    async def plan() -> float:
        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(task("caller")):
                await sleep(2)

        await par(partial(tag, "caller", partial(with_requests, left)), control)
        return now()

    assert go(plan, robot) == 3.5
    assert robot.log == ["Left begins 0", "Left stops 0.5", "Left begins 2.5"]


def test_a_request_is_a_handle_that_can_be_evaporated_and_joined(robot: Any) -> None:
    async def body() -> str:
        one, other = await left(takes=9), await right(takes=2)
        await sleep(1)
        evaporate(one)
        with pytest.raises(BranchEvaporated):
            await monitor(one)
        assert one.status.value is Status.EVAPORATED
        return str(await join(other))

    assert go(partial(with_requests, body), robot) == "Right moved"
    assert robot.log[2] == "Left stops 1"


def test_monitoring_in_a_timeout_leaves_the_request_alone(robot: Any) -> None:
    async def body() -> str:
        request = await left(takes=3)
        with pytest.raises(Timeout):
            await timeout(1, partial(monitor, request))
        return str(await monitor(request))

    assert go(partial(with_requests, body), robot) == "Left moved"


def test_a_programming_error_in_a_request_ends_everything_as_itself(robot: Any) -> None:
    async def body() -> None:
        await left(takes=1, fails="broken")
        await right(takes=9)
        await sleep(9)

    with pytest.raises(KeyError):
        go(partial(with_requests, body), robot)
    assert robot.log[-1] == "Right stops 1"


def test_an_action_that_nothing_performs_fails_when_monitored(executive: Any) -> None:
    async def body() -> None:
        request = await perform_async(action("Cooking"))
        with pytest.raises(ActionUnresolvable):
            await monitor(request)

    go(partial(with_requests, body), executive)


@pytest.mark.parametrize("inside", [False, True])
def test_a_request_outside_of_its_block_is_refused_with_the_right_form(robot: Any, inside: bool) -> None:
    async def body() -> None:
        await par(left, right)

    with pytest.raises(PlanStructureError, match=r"with_requests(.|\n)*wrong(.|\n)*right(.|\n)*with_requests"):
        go(partial(with_requests, body) if inside else left, robot)


def test_a_request_in_a_cleanup_is_refused_with_the_right_form(robot: Any) -> None:
    guarded = partial(with_requests, partial(unwind_protect, partial(sleep, 9), left))
    with pytest.raises(PlanStructureError, match=r"cleanup(.|\n)*wrong(.|\n)*right: await perform\("):
        go(partial(pursue, guarded, partial(sleep, 1)), robot)


def test_monitor_takes_a_request(robot: Any) -> None:
    async def body() -> None:
        with pytest.raises(TypeError, match=r"has to be a request(.|\n)*wrong(.|\n)*right"):
            await monitor("Left")  # type: ignore[arg-type]

    go(partial(with_requests, body), robot)


def test_holding_a_resource_while_monitoring_a_request_for_it_is_reported_as_deadlock(robot: Any) -> None:
    async def body() -> None:
        async with using("Left arm"):
            await monitor(await left())

    with pytest.raises(DeadlockError, match="Left arm"):
        go(partial(with_requests, body), robot)


def test_requests_are_nodes_of_the_tree(robot: Any) -> None:
    async def body() -> None:
        await left()
        await perform_async(action("Right"), name="wave")

    trace = Trace()
    go(partial(with_requests, body), robot, trace=trace)
    paths = [e["path"] for e in with_paths(trace.events) if e["event"] == "request"]
    base = "with_requests/with_requests"
    assert paths == [f"{base}/request/Left/Left", f"{base}/request#2/wave/Right"]


@settings(max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@hypothesis.given(
    requests=st.lists(st.tuples(st.booleans(), st.integers(1, 4), st.booleans()), min_size=1, max_size=6),
    order=st.randoms(use_true_random=False),
    schedule=st.one_of(st.none(), st.integers(0, 99)),
)
def test_each_request_ends_as_alone_whatever_the_others_do(
    executive: Any, module: Any, requests: list[tuple[bool, int, bool]], order: Any, schedule: int | None
) -> None:
    """Random requests to two modules, monitored in random order; each ends when its module's queue says."""

    async def move(wanted: Action) -> str:
        await sleep(float(str(wanted.get("takes"))))
        if wanted.get("fails"):
            raise GraspMissed
        return "moved"

    robot = type(executive)()
    robot.extra += [module("left", ("Left",), move), module("right", ("Right",), move)]
    free = {"Left": 0, "Right": 0}
    expected = []
    for is_left, takes, fails in requests:
        kind = "Left" if is_left else "Right"
        free[kind] += takes
        expected.append((free[kind], "GraspMissed" if fails else "moved"))
    picks = list(range(len(requests)))
    order.shuffle(picks)

    async def body() -> None:
        made = [
            await perform_async(action("Left" if is_left else "Right", takes=takes, fails=fails))
            for is_left, takes, fails in requests
        ]
        at = 0
        for pick in picks:
            try:
                outcome = await monitor(made[pick])
            except GraspMissed:
                outcome = "GraspMissed"
            at = max(at, expected[pick][0])
            assert (now(), outcome) == (at, expected[pick][1])

    go(partial(with_requests, body), robot, schedule=schedule)
