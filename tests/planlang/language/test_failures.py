"""Failures: typed fields, messages, chains of causes; and a call without await fails a run that went well."""

from __future__ import annotations

import inspect
import pickle
import sys
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any, get_origin

import pytest
from virtual_time import go

from planlang import *
from planlang import (
    PlanFailure,
    VirtualHost,
    achieve,
    explain,
    failures,
    in_thread,
    par,
    plan,
    pursue,
    race,
    run,
    sleep,
    state_machine,
    unwind_protect,
    with_policies,
    with_requests,
)
from planlang import failures as taxonomy
from planlang.failures import (
    CompositeFailure,
    GraspMissed,
    LocationUnresolvable,
    ManipulationFailure,
    NavigationPoseUnreachable,
    ObjectLost,
    ObjectUnfetchable,
    ObjectUnreachable,
    TooHeavy,
)
from planlang.kernel import CutShort

CLASSES = [kind for _, kind in inspect.getmembers(failures, inspect.isclass) if issubclass(kind, PlanFailure)]


@pytest.mark.parametrize("kind", CLASSES, ids=lambda kind: kind.__name__)
def test_every_failure_can_be_raised_without_details_and_says_something(kind: type[PlanFailure]) -> None:
    assert str(kind())
    assert str(kind("in other words")) == "in other words"
    assert kind.__doc__


def test_the_message_is_built_from_the_fields() -> None:
    assert str(NavigationPoseUnreachable(target=(1.0, 2.5, 0.0), blocked_by="bed1")) == (
        "no path for the base: target x 1 y 2.5 yaw 0, blocked by bed1"
    )
    unresolvable = LocationUnresolvable(
        designator="in_reach_of(bottle1)",
        counts={"out of reach": 200, "in collision": 96},
        blocking={"bed1": 90, "cabinet1": 6},
    )
    assert str(unresolvable) == (
        "no place found for in_reach_of(bottle1) (296 candidates: 200 out of reach, 96 in collision; "
        "in the way: bed1 90, cabinet1 6)"
    )


def test_what_is_too_heavy_with_its_load_says_with_how_much_it_is_carried_or_that_not_even_empty() -> None:
    full = TooHeavy(what="pot1", mass=3.9, load=1.5, payload=3.0, hands=2)
    assert str(full).endswith("0.9 kg too much; with 0.6 kg in it or on it, it could be carried")
    heavy = TooHeavy(what="pot1", mass=3.901, load=0.001, payload=3.6, hands=2)
    assert str(heavy).endswith("0.301 kg too much; empty it would still be 0.3 kg too heavy")
    assert str(TooHeavy(what="pot1", mass=4.0, payload=1.5)).endswith("the hand carries 1.5 kg: 2.5 kg too much")


def test_fields_are_typed_and_named_and_inherited() -> None:
    failure = GraspMissed(arm="left", what="cup")
    assert isinstance(failure, ManipulationFailure)
    assert (failure.arm, failure.what, failure.blocked_by) == ("left", "cup", None)
    with pytest.raises(TypeError):
        GraspMissed(colour="red")  # type: ignore[call-arg]


def test_a_failure_caused_by_another_takes_over_the_fields_they_share() -> None:
    raised = ObjectUnfetchable.caused_by(GraspMissed(arm="left", what="cup"))
    assert raised.what == "cup"
    assert [type(link).__name__ for link in raised.chain()] == ["ObjectUnfetchable", "GraspMissed"]


def test_failures_are_compared_by_identity_and_can_be_pickled() -> None:
    failure = GraspMissed(arm="left")
    assert failure != GraspMissed(arm="left")
    copy = pickle.loads(pickle.dumps(failure))
    assert (type(copy), copy.arm, str(copy)) == (GraspMissed, "left", str(failure))


def test_an_explanation_shows_chain_places_siblings_and_members() -> None:
    async def misses(arm: str) -> None:
        raise GraspMissed(arm=arm)

    async def serve() -> None:
        try:
            await par(left=partial(misses, "left"), right=partial(misses, "right"), slow=partial(sleep, 1))
        except GraspMissed as missed:
            raise ObjectUnreachable(what="cup") from missed

    with pytest.raises(ObjectUnreachable) as caught:
        run(serve, host=VirtualHost())
    lines = explain(caught.value).splitlines()
    assert lines[0] == "ObjectUnreachable: the object cannot be reached: cup; the gripper closed on nothing: left arm"
    assert lines[1].startswith("  in serve (test_failures.py:")
    assert lines[2] == "  because of GraspMissed", "the reason is told once"
    assert lines[3].startswith("    in serve/par/left (test_failures.py:")
    assert lines[4] == "    at the same time, right: GraspMissed: the gripper closed on nothing: right arm"


def test_the_failure_before_a_failing_cleanup_is_explained_as_what_went_before() -> None:
    async def fails(failure: PlanFailure) -> None:
        raise failure

    for first in (GraspMissed(arm="left"), PlanFailure("odd")):  # the second has the text of the cleanup's failure
        body, cleanup = partial(fails, first), partial(fails, PlanFailure("odd"))
        with pytest.raises(PlanFailure) as caught:
            run(partial(unwind_protect, body, cleanup), host=VirtualHost())
        leads = [line for line in explain(caught.value).splitlines() if not line.strip().startswith("in ")]
        assert leads == ["PlanFailure: odd", f"  after {type(first).__name__}: {first}"]


def test_an_explanation_of_a_composite_failure_lists_its_branches() -> None:
    both = CompositeFailure(failures=(GraspMissed(), PlanFailure("odd")), names=("grasp", "other"))
    assert explain(both).splitlines()[1:] == [
        "  branch grasp: GraspMissed: the gripper closed on nothing",
        "  branch other: PlanFailure: odd",
    ]


def test_a_chain_that_leads_back_to_itself_ends() -> None:
    one, other = PlanFailure("one"), PlanFailure("other")
    one.__cause__, other.__cause__ = other, one
    assert list(one.chain()) == [one, other]


def test_where_carries_the_revision_of_the_belief(executive: Any) -> None:
    async def fails() -> None:
        executive.belief = 7
        raise PlanFailure("no")

    with pytest.raises(PlanFailure) as caught:
        run(fails, host=VirtualHost(), executive=executive)
    assert caught.value.where is not None
    assert caught.value.where.revision == 7


def test_the_first_line_of_an_explanation_says_what_was_measured_of_the_location_that_was_not_found() -> None:
    failure = ObjectUnreachable(what="cup1")
    failure.__cause__ = LocationUnresolvable(designator="in_reach_of(cup1)", figures="cup1 is at 2.23 m")
    assert explain(failure).splitlines()[0].endswith("cup1; cup1 is at 2.23 m")


def explained(figures: str, what: str = "cup1") -> list[str]:
    failure = ObjectUnreachable(what=what)
    failure.__cause__ = LocationUnresolvable(
        designator="in_reach_of(cup1)", figures=figures, counts={"out of reach": 3}
    )
    return explain(failure).splitlines()


def test_an_explanation_tells_the_reason_of_its_first_line_once() -> None:
    lines = explained("cup1 is at 2.23 m")
    assert (
        lines[1]
        == "  because of LocationUnresolvable: no place found for in_reach_of(cup1) (3 candidates: 3 out of reach)"
    )


def test_a_long_reason_without_clauses_is_not_in_the_first_line() -> None:
    first, below = explained("so " * 60 + "it is")
    assert first == "ObjectUnreachable: the object cannot be reached: cup1"
    assert "so so it is" in below


@pytest.mark.parametrize("words", [20, 30, 60])
def test_the_first_line_of_an_explanation_has_at_most_40_words_and_what_would_help(words: int) -> None:
    figures = f"cup1 is high; {'and so on ' * (words // 3)}; moved 0.2 m, cup1 could be reached"
    first, below = explained(figures)
    assert len(first.split()) <= 41, "with the class of the failure"
    assert first.endswith("; moved 0.2 m, cup1 could be reached")
    assert (figures in below) is not (figures in first)


def test_of_a_reason_that_is_too_long_as_many_of_the_last_clauses_are_told_as_fit() -> None:
    first, _ = explained(f"nothing was found {'that helps ' * 15}; cup1 is at 2.04 m, 0.58 m too high; up to 1.46 m")
    assert first.endswith("cannot be reached: cup1; cup1 is at 2.04 m, 0.58 m too high; up to 1.46 m")


def test_a_message_of_more_than_40_words_is_told_in_full_below() -> None:
    long = f"it is so: {'very ' * 30}high; it is so {'very ' * 30}wide"
    assert explain(PlanFailure(long)).splitlines() == [f"PlanFailure: {long.partition(';')[0]}", f"  in full: {long}"]
    first, full = explain(PlanFailure(f"it is {'very ' * 60}high")).splitlines()
    assert len(first.split()) == 42
    assert first.endswith(" ..."), "there is no clause at which it could end"
    assert full.endswith("very high")


def test_causes_that_are_no_plan_failures_and_failures_during_cleanup_are_explained() -> None:
    async def fails_in_cleanup() -> None:
        raise ObjectLost(what="plate")

    async def stuck() -> None:
        await unwind_protect(partial(sleep, 10), fails_in_cleanup)

    async def fails() -> None:
        await sleep(1)
        raise GraspMissed(what="cup") from OSError("gripper jammed")

    with pytest.raises(GraspMissed) as caught:
        go(partial(par, fails, stuck))
    lines = explain(caught.value).splitlines()
    assert [line.strip() for line in lines if "cleanup" in line] == [
        f"during cleanup: ObjectLost: {ObjectLost(what='plate')}"
    ]
    assert lines[-1].strip() == "because of OSError: gripper jammed"


TREE = """
PlanFailure
  LowLevelFailure
    NavigationFailure
      NavigationPoseUnreachable NavigationGoalNotReached NavigationGoalInCollision
    PerceptionFailure
      ObjectNotFound
        RecognitionModelMissing
      ObjectLost AmbiguousPerception StateUnknown
    LookingFailure
      LookingGoalUnreachable
    ManipulationFailure
      ManipulationPoseUnreachable ManipulationGoalNotReached ManipulationGoalInCollision ObjectNotTurned
      VesselEmpty AmountNotPoured
      GripperFailure
        GraspMissed GraspSlipped GripperGoalNotReached
      TorsoFailure
        TorsoGoalUnreachable TorsoGoalNotReached
    EnvironmentManipulationFailure
      ContainerStuck HandleNotReachable DeviceUnresponsive
    CommunicationFailure
      HandoverNotTaken
  HighLevelFailure
    ObjectUnreachable ObjectUnfetchable ObjectUndeliverable ObjectNowhereToBeFound EnvironmentUnreachable
  DesignatorFailure
    ObjectUnresolvable ActionUnresolvable MissingCapability LocationUnresolvable
      BehindClosedDoor TooHeavy HandsLacking HandsFull
  CompositeFailure Timeout BudgetExceeded BranchEvaporated PolicyViolated GoalNotAchieved TransitionMissing
"""


def test_the_failures_form_the_documented_tree_and_no_other() -> None:
    parents: dict[str, str] = {}
    above: list[tuple[int, str]] = []
    for line in TREE.strip().splitlines():
        depth = len(line) - len(line.lstrip())
        while above and above[-1][0] >= depth:
            above.pop()
        for name in line.split():
            parents[name] = above[-1][1] if above else "Exception"
        above.append((depth, line.split()[-1]))
    found = {
        name: cls.__bases__[0].__name__
        for name, cls in vars(taxonomy).items()
        if inspect.isclass(cls) and issubclass(cls, PlanFailure)
    }
    assert found == parents


def test_every_public_name_has_a_docstring_and_is_listed_once() -> None:
    import planlang

    assert len(planlang.__all__) == len(set(planlang.__all__))
    for name in planlang.__all__:
        thing = getattr(planlang, name)
        assert get_origin(thing) or not callable(thing) or inspect.getdoc(thing), name
    for construct in (race, achieve, state_machine, with_policies, with_requests):
        assert construct.__name__ in planlang.__all__


async def reach() -> None:
    await sleep(1)


@plan
async def serve(cup: str) -> None:
    await sleep(1)


async def dropped() -> None:
    reach()
    await sleep(1)


async def kept_in_a_name() -> None:
    x = reach()  # noqa: F841
    await sleep(1)


async def of_a_plan() -> None:
    serve("a")


async def of_a_construct() -> None:
    par(reach, reach)


async def in_a_branch() -> None:
    await pursue(dropped, partial(sleep, 9))


async def in_a_list() -> None:
    [reach()]


@pytest.mark.parametrize(
    ("body", "line", "name"),
    [
        (dropped, "reach()", "reach"),
        (kept_in_a_name, "x = reach()  # noqa: F841", "reach"),
        (of_a_plan, 'serve("a")', "serve"),
        (of_a_construct, "par(reach, reach)", "par"),
        (in_a_branch, "reach()", "reach"),
        (in_a_list, "[reach()]", "reach"),
    ],
)
def test_a_call_without_await_is_an_error_with_its_line(body: Callable[[], Any], line: str, name: str) -> None:
    with pytest.raises(PlanStructureError) as caught:
        go(body)
    first, wrong, right = str(caught.value).splitlines()
    assert first.startswith("test_failures.py:")
    assert first.endswith(f"calls {name}() without await, so nothing was done")
    assert (wrong, right) == (f"  wrong: {line}", f"  right: await {name}(...)")


def test_all_lines_are_named() -> None:
    async def body() -> None:
        reach()
        serve("b")

    with pytest.raises(PlanStructureError, match=r"calls reach\(\)") as caught:
        go(body)
    assert [note.rpartition(" calls ")[2] for note in caught.value.__notes__] == ["serve() without await"]


def test_code_without_a_source_is_named_by_file_and_line() -> None:
    space: dict[str, Any] = {"reach": reach}
    exec(compile("async def body():\n    reach()\n", "nowhere.py", "exec"), space)
    with pytest.raises(PlanStructureError, match=r"nowhere\.py:2 calls reach\(\)(.|\n)*wrong: reach\(\.\.\.\)"):
        go(space["body"])


def test_what_the_run_fails_with_comes_first_and_nothing_is_printed() -> None:
    async def body() -> None:
        reach()
        raise GraspMissed

    with pytest.raises(GraspMissed):
        go(body)


def test_what_outlives_the_run_is_pythons_warning() -> None:
    kept: list[Any] = []

    async def body() -> None:
        kept.append(reach())
        await sleep(1)

    go(body)
    with pytest.warns(RuntimeWarning, match="'reach' was never awaited"):
        kept.clear()


def test_what_was_made_before_the_run_is_pythons_warning() -> None:
    kept = [reach()]

    async def body() -> None:
        kept.clear()
        await sleep(1)

    with pytest.warns(RuntimeWarning, match="'reach' was never awaited"):
        go(body)


def test_other_warnings_and_those_of_other_threads_are_told_as_ever() -> None:
    def reading() -> None:
        reach()

    async def body() -> None:
        warnings.warn("mind the gap", UserWarning, stacklevel=1)
        await in_thread(reading)

    with pytest.warns() as told:
        go(body)
    assert [one.category for one in told] == [UserWarning, RuntimeWarning]


def test_a_run_leaves_filters_and_tracking_as_they_were() -> None:
    before = warnings.filters[:], warnings.showwarning, sys.get_coroutine_origin_tracking_depth()
    within: list[int] = []

    async def body() -> None:
        within.append(sys.get_coroutine_origin_tracking_depth())
        await in_thread(partial(go, partial(sleep, 1)))

    go(body)
    assert within[0] > 0
    assert (warnings.filters[:], warnings.showwarning, sys.get_coroutine_origin_tracking_depth()) == before


def test_a_cleanup_that_was_cut_short_is_warned_of_in_the_same_run() -> None:
    async def body() -> None:
        try:
            await sleep(9)
        finally:
            await sleep(1)

    with pytest.warns(CutShort):
        go(partial(pursue, body, partial(sleep, 1)))


def test_a_branch_that_returns_a_coroutine_is_told_what_to_return() -> None:
    async def body() -> Any:
        return reach()

    with pytest.raises(PlanStructureError) as caught:
        go(partial(par, body))
    assert str(caught.value).splitlines() == [
        "branch par/par/body returned reach() without await, so nothing was done",
        "  wrong: return reach(...)",
        "  right: return await reach(...)",
    ]
