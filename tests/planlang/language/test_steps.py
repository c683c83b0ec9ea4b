"""Steps in one call: `until`, `otherwise` and `recoveries` of perform, achieve and at_location."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import hypothesis
import pytest
from hypothesis import strategies as st
from virtual_time import go

from planlang import *
from planlang.failures import GoalNotAchieved, GraspMissed, GraspSlipped, ManipulationPoseUnreachable, ObjectUnfetchable
from planlang.runs import with_paths

CUP = an_object("Cup", "http://example.org/map#cup1")
NEAR_CUP = a_location(in_reach_of=CUP)
GRASP = action("GraspingSomething", object_acted_on=CUP)
RECOVERIES = [
    Recovery(GraspMissed, retries=2, otherwise=ObjectUnfetchable),
    Recovery((ManipulationPoseUnreachable, GoalNotAchieved), otherwise=Return("given up")),
]
ENDS = ("grasped", "nothing", "missed", "slipped", "unreachable")
FAILURES = {"missed": GraspMissed, "slipped": GraspSlipped, "unreachable": ManipulationPoseUnreachable}
Branch = Callable[[], Awaitable[Any]]


def grasping(executive: Any, ends: list[str]) -> Branch:
    """Grasps that end one after another like this; what follows these grasps nothing."""
    following = iter(ends)

    async def grasp(wanted: Action = GRASP) -> str:
        await sleep(0.5)
        end = next(following, "nothing")
        if end in FAILURES:
            raise FAILURES[end]()
        executive.facts["holding(cup1)"] = end == "grasped"
        return end

    return grasp


def told(plan: Branch, executive: Any) -> list[dict[str, Any]]:
    """Return what the trace says of a plan, but for the lines of the plan that it names."""
    trace = Trace()
    try:
        go(plan, executive, trace=trace)
    except PlanFailure as failure:
        trace.events.append({"event": "end", "failure": type(failure).__name__, "cause": repr(failure.__cause__)})
    return [{key: value for key, value in event.items() if key != "where"} for event in with_paths(trace.events)]


def in_one_call(grasp: Branch) -> Branch:
    step = partial(perform, GRASP, name="Grasp", otherwise=grasp, until=holding(CUP), recoveries=RECOVERIES)
    return partial(at_location, NEAR_CUP, step, *RECOVERIES, attempts=2)


def with_the_goal_outside(grasp: Branch) -> Branch:
    performed = partial(perform, GRASP, name="Grasp", otherwise=grasp)
    step = named(partial(achieve, holding(CUP), performed, *RECOVERIES))
    return partial(at_location, NEAR_CUP, step, *RECOVERIES, attempts=2)


def nested(grasp: Branch) -> Branch:
    achieved = partial(achieve, holding(CUP), partial(perform, GRASP, name="Grasp", otherwise=grasp))
    step = named(partial(with_failure_handling, achieved, *RECOVERIES))
    return partial(with_failure_handling, partial(at_location, NEAR_CUP, step, attempts=2), *RECOVERIES)


def test_a_step_in_one_call_is_its_constructs_nested_event_by_event(executive: Any, module: Any) -> None:
    def events(form: Callable[[Branch], Branch], ends: list[str], by_module: bool, held: bool) -> list[dict[str, Any]]:
        executive.__init__(facts={"holding(cup1)": held})
        grasp: Any = grasping(executive, ends)
        if by_module:
            executive.extra.append(module("hand", ("GraspingSomething",), grasp))
        return told(named(form(grasp)), executive)

    @hypothesis.given(st.lists(st.sampled_from(ENDS), max_size=6), st.booleans(), st.booleans())
    def check(ends: list[str], by_module: bool, held: bool) -> None:
        one, goal_outside, all_nested = (
            events(form, ends, by_module, held) for form in (in_one_call, with_the_goal_outside, nested)
        )
        assert one == goal_outside == all_nested
        assert any(event.get("name") == "achieve" for event in one)

    check()


def named(branch: Branch) -> Branch:
    """The branch as one that is called perform in the tree."""

    async def perform() -> Any:
        return await branch()

    return perform


def test_a_step_whose_goal_holds_asks_for_nothing_and_returns_none(executive: Any) -> None:
    executive.facts["holding(cup1)"] = True
    assert go(partial(perform, GRASP, until=holding(CUP)), executive) is None


def test_a_step_with_a_goal_and_recoveries_adds_a_level_for_each_and_no_more(executive: Any, module: Any) -> None:
    executive.extra.append(module("hand", ("GraspingSomething",), grasping(executive, ["missed", "grasped"])))

    async def serve() -> Any:
        return await perform(GRASP, until=holding(CUP), recoveries=RECOVERIES)

    trace = Trace()
    assert go(serve, executive, trace=trace) == "grasped"
    paths = [event["path"] for event in with_paths(trace.events) if event["event"] == "request"]
    above = "serve/with_failure_handling"
    assert paths == [f"{above}/achieve/GraspingSomething/hand", f"{above}/achieve#2/GraspingSomething/hand"]


def test_recoveries_of_a_place_run_with_the_base_free(executive: Any) -> None:
    seen: list[Any] = []

    async def look_around(failure: PlanFailure) -> Any:
        await perform(action("Translation-LocationChange", x=7.0))
        return RETRY

    async def grasp() -> str:
        seen.append(executive.base[0])
        if len(seen) == 1:
            raise GraspMissed
        return "grasped"

    recovery = Recovery(GraspMissed, look_around)
    assert go(partial(at_location, NEAR_CUP, grasp, recovery), executive) == "grasped"
    assert executive.log == ["at 1", "at 7", "at 1"]


def test_what_has_to_be_reached_is_the_same_in_each_attempt(executive: Any) -> None:
    attempts = iter([GraspMissed(), None])

    async def grasp() -> None:
        if failure := next(attempts):
            raise failure

    once = iter([a_location(in_center_of=CUP)])
    go(partial(at_location, NEAR_CUP, grasp, Recovery(GraspMissed), reaching=once), executive)
    assert len(executive.asked) == 2
    assert len(set(executive.asked)) == 1


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda given: perform(GRASP, recoveries=given), "perform"),
        (lambda given: achieve(Fluent(True), partial(sleep, 1), *given), "achieve"),
        (lambda given: at_location(NEAR_CUP, partial(sleep, 1), *given), "at_location"),
    ],
)
def test_recoveries_with_alternatives_are_refused_where_the_body_takes_no_keywords(
    call: Callable[[Any], Awaitable[Any]], name: str, executive: Any
) -> None:
    given = [Recovery(GraspMissed, alternatives={"grasp": lambda: ["top", "side"]})]
    with pytest.raises(ValueError, match=f"alternatives .* {name} passes none") as refused:
        go(partial(call, given), executive)
    assert "right: await with_failure_handling(body, Recovery(" in str(refused.value)


def test_a_goal_that_is_no_goal_is_told_in_the_words_of_the_step(executive: Any) -> None:
    with pytest.raises(TypeError, match="until of perform has to be a condition"):
        go(partial(perform, GRASP, until="holding"), executive)  # type: ignore[arg-type]
