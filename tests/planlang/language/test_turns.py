"""Taking turns: a block lets another one that waits for its resources go first, and goes on before all others."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import pytest

from planlang import (
    Condition,
    Recovery,
    give_turn,
    holding,
    now,
    par,
    perform,
    sleep,
    tag,
    task,
    task_suspended,
    using,
    with_failure_handling,
)
from planlang.designators import action, an_object
from planlang.failures import GraspMissed, HandsFull, ManipulationPoseUnreachable, ObjectUndeliverable
from planlang.recoveries import put_down_and_regrasp
from planlang.runs import RecordedRun
from planlang.testing import Script, explore, replay, run_plan

Log = list[str]
CUP, PLATE = an_object("Cup", "http://example.org/#cup1"), an_object("Plate", "http://example.org/#plate1")


async def bring(log: Log, name: str, *resources: str, in_turns: bool = True) -> None:
    """Fetch something for a second, let others go first, and bring it for a second."""
    async with using(*(resources or ("base",)), in_turns=in_turns):
        log.append(f"{name} fetches at {now():g}")
        await sleep(1)
        await give_turn()
        log.append(f"{name} brings at {now():g}")
        await sleep(1)


def test_the_next_goes_first_once_and_then_the_one_that_gave_its_turn() -> None:
    log: Log = []
    assert run_plan(partial(par, *(partial(bring, log, name) for name in ("a", "b", "c")))).failure is None
    assert log == [
        *("a fetches at 0", "b fetches at 1", "c fetches at 2"),
        *("c brings at 3", "b brings at 4", "a brings at 5"),
    ]


def test_no_turn_is_given_without_a_hand_that_is_free() -> None:
    log: Log = []

    two = partial(par, partial(bring, log, "a"), partial(bring, log, "b"))
    assert run_plan(two, script=Script().holding("cup1", "cup2")).failure is None
    assert log[:2] == ["a fetches at 0", "a brings at 1"]


@pytest.mark.parametrize(
    "others",
    [(), (("b", "arm"),), (("b", "base", "arm"),)],
    ids=["nobody waits", "others need something else", "others need more that is in use"],
)
def test_a_block_goes_on_where_nobody_can_go_first(others: tuple[tuple[str, ...], ...]) -> None:
    log: Log = []

    async def arm_in_use() -> None:
        async with using("arm"):
            await sleep(3)

    assert (
        run_plan(
            partial(par, arm_in_use, partial(bring, log, "a"), *(partial(bring, log, *one) for one in others))
        ).failure
        is None
    )
    assert log[:2] == ["a fetches at 0", "a brings at 1"]


def test_a_turn_is_given_only_by_the_block_itself_that_holds_in_turns() -> None:
    log: Log = []

    async def within(inside: Callable[[], Awaitable[Any]], *, in_turns: bool) -> None:
        async with using("base", in_turns=in_turns):
            await sleep(1)
            await inside()

    async def in_a_branch() -> None:
        await par(partial(try_to_give, log), do_something_else)

    async def in_a_block() -> None:
        async with using("base"):
            await try_to_give(log)

    async def nothing() -> None:
        await try_to_give(log)

    for inside, in_turns in ((in_a_branch, True), (in_a_block, True), (nothing, False)):
        assert (
            run_plan(partial(par, partial(within, inside, in_turns=in_turns), partial(bring, log, "b"))).failure is None
        )
    assert log[::3] == ["no turn was given"] * 3
    assert run_plan(partial(try_to_give, log)).failure is None
    assert log[-1] == "no turn was given"


async def try_to_give(log: Log) -> None:
    """Try to give a turn."""
    if not await give_turn():
        log.append("no turn was given")


async def do_something_else() -> None:
    """Do something else."""
    await sleep(0.1)


def test_a_step_that_ends_while_another_has_its_turn_has_nothing_to_release() -> None:
    log: Log = []

    async def fails() -> None:
        await sleep(1.5)
        raise GraspMissed(what="cup1")

    async def plan() -> None:
        try:
            await par(partial(bring, log, "a"), partial(bring, log, "b"), fails)
        except GraspMissed:
            await bring(log, "after", "base")

    run = run_plan(plan)
    assert run.failure is None
    assert log == ["a fetches at 0", "b fetches at 1", "after fetches at 1.5", "after brings at 2.5"]
    told = [event["event"] for event in run.trace.events if event["event"] in ("acquired", "released")]
    assert told == ["acquired", "released"] * 3


def test_a_suspended_step_gets_no_turn() -> None:
    log: Log = []

    async def plan() -> None:
        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(task("second")):
                await sleep(3)

        await par(partial(bring, log, "a"), partial(tag, "second", partial(bring, log, "b")), control)

    assert run_plan(plan).failure is None
    assert log == ["a fetches at 0", "a brings at 1", "b fetches at 3.5", "b brings at 4.5"]


def fetch_two(*recoveries: Recovery, until: Condition | None = None, in_turns: bool = True) -> Awaitable[Any]:
    """Two steps: one fetches a cup, the other needs the hand that holds it until the cup is brought."""
    free = {"hands": 1}
    why = None if until is None else ManipulationPoseUnreachable(what="plate1")

    async def fetch_cup() -> None:
        async with using("base", in_turns=True):
            free["hands"] -= 1
            await sleep(1)
            await give_turn()
            free["hands"] += 1

    async def take_plate() -> None:
        if not free["hands"]:
            raise why or HandsFull(designator="plate1", what="plate1", held={"arm": CUP})
        await perform(action("GraspingSomething", object_acted_on=PLATE))

    async def fetch_plate() -> None:
        async with using("base", in_turns=in_turns):
            taking = action("http://example.org/#Taking", object_acted_on=PLATE)
            await perform(taking, otherwise=take_plate, until=until, recoveries=recoveries)

    return par(fetch_cup, fetch_plate)


@pytest.mark.parametrize("in_turns", [True, False])
@pytest.mark.parametrize("recoveries", [(), (Recovery(HandsFull, put_down_and_regrasp(PLATE)),)])
def test_a_step_without_a_hand_lets_the_one_go_on_that_has_it_in_use(
    recoveries: tuple[Recovery, ...], in_turns: bool
) -> None:
    two, script = partial(fetch_two, *recoveries, in_turns=in_turns), Script().performs("GraspingSomething")
    assert run_plan(two, script=script).failure is None
    assert explore(two, script=script, check=lambda run: run.value).complete


def test_a_step_that_does_not_reach_its_goal_is_repeated_after_the_one_that_let_it_go_first() -> None:
    two, script = partial(fetch_two, until=holding(PLATE)), Script().performs("GraspingSomething")
    script.on("GraspingSomething", does=lambda belief, _: belief.hold("plate1"))
    assert run_plan(two, script=script).belief.holding == ["plate1"]


def test_a_run_with_turns_is_replayed_and_resumed() -> None:
    two = partial(par, partial(bring, [], "a"), partial(bring, [], "b"))
    run = run_plan(two, resumable=True)
    assert replay(two, run).equal
    for records in range(3, len(run.trace.events)):
        part = RecordedRun.of(run.trace.events[:records])
        assert run_plan(two, resume=part).failure is None


def test_a_step_without_a_hand_fails_if_nobody_waits_with_one() -> None:
    async def take_plate() -> None:
        raise HandsFull(designator="plate1", what="plate1", held={"arm": CUP})

    async def fetch_plate() -> None:
        async with using("base", in_turns=True):
            await perform(action("http://example.org/#Taking", object_acted_on=PLATE), otherwise=take_plate)

    assert isinstance(run_plan(fetch_plate).failure, HandsFull)


def test_what_cannot_be_delivered_beside_what_another_step_holds_is_put_down_until_that_has_gone_on() -> None:
    log: Log = []

    async def bring_plate() -> None:
        async with using("base", in_turns=True):
            await give_turn()
            log.append("plate brought")

    async def fetch_cup() -> None:
        await perform(action("GraspingSomething", object_acted_on=CUP))

    async def bring_cup() -> None:
        async with using("base", in_turns=True):
            await fetch_cup()
            await with_failure_handling(deliver_cup, recovery)

    async def deliver_cup() -> None:
        if "plate brought" not in log:
            raise ObjectUndeliverable(what="cup1")
        log.append("cup brought")

    recovery = Recovery(ObjectUndeliverable, put_down_and_regrasp(CUP, fetch_cup), retries=1)
    script = Script().performs("GraspingSomething")
    script.on("GraspingSomething", does=lambda belief, _: belief.hold("cup1"))
    run = run_plan(partial(par, bring_plate, bring_cup), script=script)
    assert run.failure is None
    assert log == ["plate brought", "cup brought"]
    assert (run.attempts("SettingAsideAnObject"), run.attempts("GraspingSomething")) == (1, 2)


def test_a_step_that_must_not_be_repeated_is_not_repeated_for_want_of_a_hand() -> None:
    begun = []

    async def pour() -> None:
        begun.append("pouring")
        raise HandsFull(designator="plate1", what="plate1", held={"arm": CUP})

    async def pour_in_turn() -> None:
        async with using("base", in_turns=True):
            await perform(action("http://example.org/#Pouring", object_acted_on=PLATE), once=True, otherwise=pour)

    run = run_plan(partial(par, partial(bring, [], "a"), pour_in_turn))
    assert isinstance(run.failure, HandsFull)
    assert begun == ["pouring"]
