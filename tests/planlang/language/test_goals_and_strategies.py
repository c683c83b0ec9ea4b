"""achieve, and the strategies that recoveries use."""

from __future__ import annotations

from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import (
    Action,
    Fluent,
    Recovery,
    Trace,
    a_location,
    a_posture,
    achieve,
    action,
    an_object,
    fetch_again,
    given,
    holding,
    holds,
    ignore,
    look_and_repeat,
    look_from_another_place,
    now,
    par,
    perform,
    pursue,
    put_down_and_regrasp,
    sleep,
    tag,
    task,
    wait_for,
    whenever,
    with_failure_handling,
)
from planlang import evaporate as evaporate_task
from planlang import recoveries as strategies
from planlang.advice import Change
from planlang.designators import located
from planlang.failure_wording import NO_WAY
from planlang.failures import (
    BranchEvaporated,
    GoalNotAchieved,
    GraspMissed,
    HandsFull,
    LocationUnresolvable,
    ObjectLost,
    ObjectNotFound,
    ObjectNowhereToBeFound,
    ObjectUnreachable,
    PlanFailure,
)
from planlang.misuse import PlanStructureError
from planlang.recoveries import find_strategy, recovery_strategy, registered_strategies
from tests.support.looking import BOTTLE, eyes
from tests.support.refusals import failing


def test_the_body_is_skipped_when_the_goal_holds_and_the_trace_says_so(executive: Any) -> None:
    async def never() -> None:
        pytest.fail("the goal holds")

    executive.facts["holding(bottle1)"] = True
    trace = Trace()
    assert go(partial(achieve, holding(BOTTLE), never), executive, trace=trace) is None
    assert [e["goal"] for e in trace.events if e["event"] == "skipped"] == ["holding(bottle1)"]


def test_after_the_body_the_goal_must_hold(executive: Any) -> None:
    async def grasps() -> str:
        executive.facts["holding(bottle1)"] = True
        return "grasped"

    async def does_nothing() -> None: ...

    assert go(partial(achieve, holding(BOTTLE), grasps), executive) == "grasped"
    executive.facts.clear()
    with failing(GoalNotAchieved, goal="holding(bottle1)"):
        go(partial(achieve, holding(BOTTLE), does_nothing), executive)


def test_a_goal_may_come_true_a_while_after_the_body() -> None:
    settled = Fluent(False, "settled")

    async def body() -> str:
        return "let go"

    async def settles() -> None:
        await sleep(1)
        settled.set(True)

    assert go(partial(par, partial(achieve, settled, body, within=2), settles))[0] == "let go"
    settled.set(False)
    with failing(GoalNotAchieved, goal="settled"):
        go(partial(par, partial(achieve, settled, body, within=0.5), settles))


def test_a_goal_may_be_a_plain_function() -> None:
    state = {"open": False}

    async def opens() -> None:
        state["open"] = True

    go(partial(achieve, lambda: state["open"], opens))
    assert state["open"]


def test_a_world_fluent_as_goal_is_read_anew_not_as_sampled() -> None:
    truth = [False]
    door: Fluent[bool] = Fluent(read=lambda: truth[0], name="door open")

    async def opens() -> None:
        assert door.value is False
        truth[0] = True

    go(partial(achieve, door, opens))


async def find() -> None:
    await perform(action("LookingForSomething", object_acted_on=BOTTLE))


def test_looking_from_another_place_goes_where_it_should_be_visible_and_repeats(executive: Any, module: Any) -> None:
    eyes(executive, module, 1.0)
    recovery = Recovery(ObjectNotFound, look_from_another_place(BOTTLE), retries=3, otherwise=ObjectNowhereToBeFound)
    go(partial(with_failure_handling, find, recovery), executive)
    assert executive.log == ["looks at 0", "looks at 0", "at 1", "looks at 1", "looks at 1"]
    assert str(executive.asked[0]) == "visible_from(bottle1)"


def test_not_finding_it_there_either_is_left_to_the_body(executive: Any, module: Any) -> None:
    eyes(executive, module)
    recovery = Recovery(ObjectNotFound, look_from_another_place(BOTTLE), retries=2, otherwise=ObjectNowhereToBeFound)
    with failing(ObjectNowhereToBeFound, what="bottle1"):
        go(partial(with_failure_handling, find, recovery), executive)
    assert [line for line in executive.log if line.startswith("looks")] == ["looks at 0"] * 2 + ["looks at 1"] * 5


def test_the_base_stays_where_the_thing_is_seen_at_the_second_look(executive: Any, module: Any) -> None:
    eyes(executive, module, 0.0)
    missed = [ObjectNotFound(what="bottle1")]

    async def body() -> None:
        if missed:
            raise missed.pop()

    recovery = Recovery(ObjectNotFound, look_from_another_place(BOTTLE))
    go(partial(with_failure_handling, body, recovery), executive)
    assert executive.log == ["looks at 0"]


def strategies_of(what: Any) -> dict[str, Any]:
    """Strategies that a Recovery may be given, by the failure that it ends in unless it says else."""
    return {
        "ObjectNowhereToBeFound": look_from_another_place(what),
        "ObjectUnfetchable": fetch_again(what),
        "": look_and_repeat(what),
    }


@pytest.mark.parametrize("last", strategies_of(BOTTLE))
def test_a_strategy_says_what_a_recovery_ends_in_unless_that_says_it_itself(last: str) -> None:
    do = strategies_of(BOTTLE)[last]
    left_out = Recovery(ObjectNotFound, do, retries=2).otherwise
    assert getattr(left_out, "__name__", "") == last
    assert Recovery(ObjectNotFound, do, otherwise=None).otherwise is None
    assert Recovery(ObjectNotFound, do, otherwise=ObjectUnreachable).otherwise is ObjectUnreachable


@pytest.mark.parametrize(
    ("says", "raised"),
    [({}, ObjectNowhereToBeFound), ({"otherwise": None}, ObjectNotFound), ({"otherwise": GraspMissed}, GraspMissed)],
)
def test_a_used_up_strategy_ends_in_its_own_failure_unless_the_recovery_says_else(
    executive: Any, module: Any, says: dict[str, Any], raised: type[Exception]
) -> None:
    eyes(executive, module)
    recovery = Recovery(ObjectNotFound, look_from_another_place(BOTTLE), **says)
    with pytest.raises(raised):
        go(partial(with_failure_handling, find, recovery), executive)


def test_a_strategy_about_no_object_may_say_what_it_ends_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(strategies, "_registered", dict(strategies._registered))

    async def waiting(failure: Any) -> Any: ...

    waiting.__qualname__ = waiting.__name__  # as at the top of a module
    assert recovery_strategy("WaitLong", otherwise=ObjectUnreachable)(waiting) is waiting
    assert Recovery(ObjectNotFound, waiting).otherwise is ObjectUnreachable
    assert [one.otherwise for one in registered_strategies() if one.name == "WaitLong"] == [ObjectUnreachable]


async def carried(executive: Any, lost: list[ObjectLost]) -> None:
    executive.log.append("carries")
    if lost:
        raise lost.pop()


@pytest.mark.parametrize(
    ("seen_from", "looks"), [(0.0, ["looks at 0"]), (1.0, ["looks at 0", "looks at 0", "at 1", "looks at 1"])]
)
def test_fetching_again_looks_here_first_tucks_the_arms_and_runs_what_grasps(
    executive: Any, module: Any, seen_from: float, looks: list[str]
) -> None:
    eyes(executive, module, seen_from)
    tucks = module("arm", ("Reaching",), partial(_says, executive, "tucks"), (), ("arm",))
    executive.extra.append(tucks)
    executive.retry_actions = [action("Reaching", to_location=a_posture("carrying"))]

    async def grasp() -> None:
        executive.log.append("grasps")

    recovery = Recovery(ObjectLost, fetch_again(BOTTLE, grasp))
    body = partial(carried, executive, [ObjectLost(what="bottle1")])
    go(partial(with_failure_handling, body, recovery), executive)
    assert executive.log == ["carries", looks[0], "tucks", *looks[1:], "grasps", "carries"]


async def _says(executive: Any, what: str, wanted: Action) -> None:
    executive.log.append(what)


def test_what_is_still_held_is_not_fetched_again_when_something_else_is_lost(executive: Any) -> None:
    executive.facts["holding(bottle1)"] = True
    body = partial(carried, executive, [ObjectLost(what="cup1")])
    with pytest.raises(ObjectLost, match="cup1"):
        go(partial(with_failure_handling, body, Recovery(ObjectLost, fetch_again(BOTTLE))), executive)
    assert executive.log == ["carries"]


def test_looking_and_repeating_looks_from_here(executive: Any, module: Any) -> None:
    eyes(executive, module, 0.0)
    missed = [GraspMissed()]

    async def grasp() -> str:
        if missed:
            raise missed.pop()
        return "grasped"

    plan = partial(with_failure_handling, grasp, Recovery(GraspMissed, look_and_repeat(BOTTLE)))
    assert go(plan, executive) == "grasped"
    assert executive.log == ["looks at 0"]


def test_looking_and_repeating_looks_where_it_may_be_if_it_is_not_seen_from_here(executive: Any, module: Any) -> None:
    eyes(executive, module)

    async def grasp() -> None:
        raise GraspMissed

    plan = partial(with_failure_handling, grasp, Recovery(GraspMissed, look_and_repeat(BOTTLE)))
    with pytest.raises(ObjectNotFound):
        go(plan, executive)
    assert executive.log == ["looks at 0"] * 2


CUP = an_object("Cup", "http://example.org/map#cup1")
FULL = HandsFull(what="cup1", held={"left": BOTTLE, "right": CUP})


def setting_aside(executive: Any, module: Any, *stuck: str) -> None:
    """An arm that puts down what it holds, but for some things."""

    async def put(wanted: Action) -> None:
        executive.log.append(f"puts {wanted.get('object_acted_on')} down")
        if str(wanted.get("object_acted_on")) in stuck:
            raise GraspMissed

    executive.extra.append(module("arm", ("SettingAsideAnObject",), put, needs=("arm",)))


def regrasping(executive: Any, failure: PlanFailure, again: Any = None) -> Any:
    """Run a body that fails once with a failure, with the recovery around it."""
    failures = [failure]

    async def body() -> str:
        executive.log.append("body")
        if failures:
            raise failures.pop()
        return "delivered"

    recovery = Recovery(PlanFailure, put_down_and_regrasp(BOTTLE, again))
    return go(partial(with_failure_handling, body, recovery), executive)


def test_what_cannot_be_delivered_is_put_down_and_grasped_again(executive: Any, module: Any) -> None:
    setting_aside(executive, module)
    executive.facts["holding(bottle1)"] = True

    async def again() -> None:
        executive.log.append("grasps")

    assert regrasping(executive, ObjectUnreachable(what="place"), again) == "delivered"
    assert executive.log == ["body", "puts bottle1 down", "grasps", "body"]
    executive.log.clear()
    assert regrasping(executive, ObjectUnreachable(what="place")) == "delivered", "the body grasps itself"
    assert executive.log == ["body", "puts bottle1 down", "body"]


def test_what_cannot_be_put_down_stays_held_and_the_failure_goes_outward(executive: Any, module: Any) -> None:
    setting_aside(executive, module, "bottle1")
    executive.facts["holding(bottle1)"] = True
    with failing(ObjectUnreachable, what="place"):
        regrasping(executive, ObjectUnreachable(what="place"))


def test_a_thing_that_is_not_held_is_not_put_down(executive: Any, module: Any) -> None:
    setting_aside(executive, module)
    with pytest.raises(ObjectUnreachable):
        regrasping(executive, ObjectUnreachable(what="place"))
    assert executive.log == ["body"]


def test_nothing_is_put_down_for_another_grip_where_somebody_stands_in_the_only_way(
    executive: Any, module: Any
) -> None:
    setting_aside(executive, module)
    executive.facts["holding(bottle1)"] = True
    failure = ObjectUnreachable(what="place")
    failure.__cause__ = LocationUnresolvable(counts={NO_WAY: 9}, changes=(Change("absent", True, "person1"),))
    with failing(ObjectUnreachable, what="place"):
        regrasping(executive, failure)
    assert executive.log == ["body"]


def test_the_first_of_what_full_hands_hold_that_can_be_is_put_down(executive: Any, module: Any) -> None:
    setting_aside(executive, module, "bottle1")
    assert regrasping(executive, FULL) == "delivered"
    assert executive.log == ["body", "puts bottle1 down", "puts cup1 down", "body"]


def test_full_hands_that_can_put_nothing_down_are_the_failure(executive: Any, module: Any) -> None:
    setting_aside(executive, module, "bottle1", "cup1")
    with pytest.raises(HandsFull):
        regrasping(executive, FULL)


def test_what_both_hands_hold_is_put_down_once_and_said_once(executive: Any, module: Any) -> None:
    setting_aside(executive, module, "bottle1")
    both = HandsFull(what="cup1", held={"right": BOTTLE, "left": BOTTLE})
    assert both.because() == "no hand is free for cup1: right and left hold bottle1; put it down first"
    with pytest.raises(HandsFull):
        regrasping(executive, both)
    assert executive.log == ["body", "puts bottle1 down"]


def test_ignore_goes_on_with_none() -> None:
    async def misses() -> None:
        raise GraspMissed

    assert go(partial(with_failure_handling, misses, Recovery(GraspMissed, ignore))) is None


def test_a_condition_as_a_fluent_is_true_while_the_executive_believes_it(executive: Any) -> None:
    async def watch() -> list[bool]:
        held = holds(holding(BOTTLE))
        before = held.value
        executive.facts["holding(bottle1)"] = True
        await sleep(1)
        return [before, held.value]

    assert go(watch, executive) == [False, True]


def test_being_somewhere_is_a_condition_too(executive: Any) -> None:
    async def watch() -> tuple[bool, str]:
        near = holds(a_location(near=BOTTLE))
        return near.value, str(near)

    assert go(watch, executive) == (False, str(located(a_location(near=BOTTLE))))


def test_a_place_that_stops_holding_ends_what_depends_on_it(executive: Any) -> None:
    here = a_location(near=BOTTLE)
    executive.facts[str(located(here))] = True

    async def leave() -> None:
        await sleep(2)
        executive.facts[str(located(here))] = False
        await sleep(10)

    async def watch() -> tuple[bool, float]:
        await pursue(partial(wait_for, ~holds(here)), leave)
        return holds(here).value, now()

    assert go(watch, executive) == (False, pytest.approx(2, abs=0.01))


def test_a_result_is_handed_on_if_it_is_the_kind_of_thing_that_is_needed() -> None:
    cup = an_object("Cup", "http://example.org/map#cup1")
    assert given(BOTTLE, cup) == BOTTLE
    assert given(BOTTLE, "cup") == BOTTLE
    assert given((1.0, 2.0), cup) == cup
    assert given(None, "cup") == "cup"


CUP = an_object("Cup", "http://example.org/map#cup1")


def test_an_object_that_can_be_seen_from_nowhere_is_nowhere_to_be_found(executive: Any, module: Any) -> None:
    eyes(executive, module)
    executive.places = []

    async def body() -> None:
        raise ObjectNotFound(what="bottle1")

    with pytest.raises(ObjectNowhereToBeFound) as caught:
        go(partial(with_failure_handling, body, Recovery(ObjectNotFound, look_from_another_place(BOTTLE))), executive)
    assert isinstance(caught.value.__cause__, ObjectUnreachable)


def test_whenever_ends_where_its_body_has_evaporated_it() -> None:
    bodies: list[int] = []

    async def body() -> None:
        bodies.append(1)
        evaporate_task(task("watching"))

    with pytest.raises(BranchEvaporated):
        go(partial(tag, "watching", partial(whenever, Fluent(True), body)))
    assert bodies == [1]


async def shout(failure: object) -> object: ...


@pytest.mark.parametrize(
    ("name", "options", "function", "message"),
    [
        ("", {}, shout, "a string with something in it"),
        ("Shout", {"moves_base": True}, shout, "has to be about an object"),
        ("Ignore", {}, shout, "planlang.recoveries.ignore is registered as Ignore already"),
        ("Repeat", {}, shout, "planlang is registered as Repeat already"),
        ("Shout", {}, lambda failure: None, "plans cannot import lambda"),
        ("Shout", {}, None, "plans cannot import None"),
        ("Shout", {"otherwise": "ObjectLost"}, shout, "otherwise of @recovery_strategy has to be None or a failure"),
    ],
)
def test_what_cannot_be_registered_is_refused(
    name: str, options: dict[str, Any], function: object, message: str
) -> None:
    with pytest.raises(PlanStructureError, match=message):
        recovery_strategy(name, **options)(function)  # type: ignore[type-var]
    assert "Shout" not in {strategy.name for strategy in registered_strategies()}


def test_a_module_that_is_imported_twice_registers_once() -> None:
    strategy = next(one for one in registered_strategies() if one.name == "Ignore")
    assert strategy.function is not None
    assert recovery_strategy("Ignore")(strategy.function) is strategy.function


def test_packages_are_asked_only_for_names_that_planlang_does_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    class Point:
        value = "my_robot.recoveries"

        def load(self) -> None:
            asked.append(self.value)
            if len(asked) == 1:
                raise ImportError("no arm is connected")

    monkeypatch.setattr(strategies, "entry_points", lambda group: [Point()] if group == strategies.GROUP else [])
    strategies._load_installed.cache_clear()
    try:
        assert find_strategy("LookAndRepeat") is not None
        assert asked == []
        with pytest.raises(ImportError, match="no arm") as raised:
            find_strategy("Dance")
        assert raised.value.__notes__ == [
            "while loading my_robot.recoveries, an entry point of the group planlang.recoveries"
        ]
        assert find_strategy("Dance") is None
        assert find_strategy("Sing") is None
        assert len(asked) == 2
    finally:
        strategies._load_installed.cache_clear()
