"""with_failure_handling: which recovery decides, how often, with which alternatives, and what is raised in the end."""

from __future__ import annotations

from functools import partial
from typing import Any

import hypothesis
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from virtual_time import go

from planlang import (
    PROPAGATE,
    RETRY,
    PlanFailure,
    Recovery,
    RecoveryResult,
    Return,
    Trace,
    now,
    par,
    sleep,
    tag,
    task,
    task_suspended,
    unwind_protect,
    with_failure_handling,
)
from planlang import failures as taxonomy
from planlang.advice import Change
from planlang.failures import (
    CompositeFailure,
    GraspMissed,
    GripperFailure,
    LocationUnresolvable,
    LowLevelFailure,
    NavigationFailure,
    ObjectNotFound,
    ObjectNowhereToBeFound,
    ObjectUnfetchable,
)
from planlang.language.recovery import advised_changes, matches
from planlang.misuse import WrongValue
from tests.support.examples import examples


class Body:
    """Fails with one failure after another, then succeeds; counts its runs."""

    def __init__(self, *failures: PlanFailure, duration: float = 0.0) -> None:
        self.failures = list(failures)
        self.duration = duration
        self.runs = 0

    async def __call__(self) -> str:
        self.runs += 1
        await sleep(self.duration)
        if self.failures:
            raise self.failures.pop(0)
        return "done"


def test_a_retry_runs_the_body_again_and_its_result_is_returned() -> None:
    body = Body(GraspMissed(), GraspMissed())
    assert go(partial(with_failure_handling, body, Recovery(GraspMissed, retries=2))) == "done"
    assert body.runs == 3


def test_when_the_attempts_are_used_up_the_failure_goes_outward() -> None:
    body = Body(*[GraspMissed(f"number {n}") for n in range(5)])
    with pytest.raises(GraspMissed, match="number 2"):
        go(partial(with_failure_handling, body, Recovery(GraspMissed, retries=2)))
    assert body.runs == 3


def test_attempts_zero_only_escalates() -> None:
    body = Body(GraspMissed(what="cup"))
    with pytest.raises(ObjectUnfetchable, match="cup") as caught:
        go(partial(with_failure_handling, body, Recovery(GraspMissed, retries=0, otherwise=ObjectUnfetchable)))
    assert isinstance(caught.value.__cause__, GraspMissed)
    assert body.runs == 1


def test_otherwise_may_be_a_function_of_the_failure_or_a_value() -> None:
    def lost(failure: PlanFailure) -> PlanFailure:
        return ObjectNowhereToBeFound(f"gave up after: {failure}")

    with pytest.raises(ObjectNowhereToBeFound, match="gave up after: dark"):
        go(
            partial(
                with_failure_handling,
                Body(ObjectNotFound("dark")),
                Recovery(ObjectNotFound, retries=0, otherwise=lost),
            )
        )
    plan = partial(
        with_failure_handling, Body(ObjectNotFound()), Recovery(ObjectNotFound, retries=0, otherwise=Return(3))
    )
    assert go(plan) == 3


def test_the_first_matching_recovery_in_textual_order_decides_subclasses_included() -> None:
    log: list[str] = []

    def note(word: str) -> Any:
        async def do(failure: PlanFailure) -> Any:
            log.append(word)
            return RETRY

        return do

    body = Body(GraspMissed(), ObjectNotFound())
    go(
        partial(
            with_failure_handling,
            body,
            Recovery(GripperFailure, note("gripper")),
            Recovery(LowLevelFailure, note("any")),
            Recovery(GraspMissed, note("never reached")),
        )
    )
    assert log == ["gripper", "any"]


def test_each_recovery_has_its_own_counter_and_an_exhausted_one_still_decides() -> None:
    body = Body(GraspMissed(), ObjectNotFound(), GraspMissed("the second"))
    with pytest.raises(GraspMissed, match="the second"):
        go(
            partial(
                with_failure_handling,
                body,
                Recovery(GraspMissed, retries=1),
                Recovery(ObjectNotFound, retries=1),
                Recovery(LowLevelFailure, retries=9),
            )
        )
    assert body.runs == 3


def test_the_counters_are_per_entry() -> None:
    async def plan() -> int:
        runs = 0
        for _ in range(3):
            body = Body(GraspMissed())
            await with_failure_handling(body, recovery)
            runs += body.runs
        return runs

    recovery = Recovery(GraspMissed, retries=1)
    assert go(plan) == 6


def test_the_recovery_runs_after_the_body_is_fully_unwound() -> None:
    log: list[str] = []

    async def fails() -> None:
        raise GraspMissed

    async def cleanup() -> None:
        await sleep(1)
        log.append("clean")

    async def do(failure: PlanFailure) -> Any:
        log.append("recovery")
        return Return(None)

    body = partial(par, fails, partial(unwind_protect, partial(sleep, 10), cleanup))
    go(partial(with_failure_handling, body, Recovery(GraspMissed, do)))
    assert log == ["clean", "recovery"]


def test_return_leaves_with_a_value_and_propagate_lets_the_failure_go() -> None:
    async def leave(failure: PlanFailure) -> Any:
        return Return("instead")

    async def let_go(failure: PlanFailure) -> Any:
        return PROPAGATE

    assert go(partial(with_failure_handling, Body(GraspMissed()), Recovery(GraspMissed, leave))) == "instead"
    with pytest.raises(GraspMissed):
        go(partial(with_failure_handling, Body(GraspMissed()), Recovery(GraspMissed, let_go)))


def test_any_other_decision_is_a_type_error_that_names_the_three() -> None:
    async def forgets(failure: PlanFailure) -> Any:
        return None

    with pytest.raises(TypeError, match=r"RETRY, PROPAGATE or Return\(value\)"):
        go(partial(with_failure_handling, Body(GraspMissed()), Recovery(GraspMissed, forgets)))


def test_a_recovery_that_decides_at_once_is_a_type_error_that_shows_how_to_write_it() -> None:
    at_once: Any = lambda failure: RETRY  # noqa: E731
    with pytest.raises(TypeError) as caught:
        go(partial(with_failure_handling, Body(GraspMissed()), Recovery(GraspMissed, at_once)))
    assert str(caught.value) == (
        "do of the Recovery for GraspMissed returned RETRY without being async; write it with async def\n"
        "  wrong: Recovery(GraspMissed, lambda: ...)\n"
        "  right: async def do(failure): ...; return RETRY"
    )


def test_a_failure_of_the_recovery_goes_outward_only_with_its_cause() -> None:
    async def breaks(failure: PlanFailure) -> Any:
        raise ObjectNotFound("while recovering")

    body = Body(GraspMissed("first"))
    with pytest.raises(ObjectNotFound) as caught:
        go(partial(with_failure_handling, body, Recovery(GraspMissed, breaks), Recovery(ObjectNotFound)))
    assert [str(link) for link in caught.value.chain()] == ["while recovering", "first"]
    assert body.runs == 1


async def retreat() -> None:
    await sleep(1)


async def retreats(failure: PlanFailure) -> RecoveryResult:
    await sleep(1)
    return RETRY


def test_a_recovery_function_that_does_not_take_the_failure_is_refused_when_the_recovery_is_made() -> None:
    with pytest.raises(TypeError, match=r"retreat does not take the failure") as caught:
        Recovery(GraspMissed, retreat)  # type: ignore[arg-type]
    assert str(caught.value).splitlines()[1:] == [
        "  wrong: Recovery(GraspMissed, retreat)",
        "  right: async def retreat(failure): ...; return RETRY",
    ]
    with pytest.raises(TypeError, match=r"right: async def do\(failure\): \.\.\.; return RETRY"):
        Recovery(GraspMissed, lambda: retreat())  # type: ignore
    assert Recovery(GraspMissed, retreats).do is retreats


def test_no_recovery_handles_a_programming_error() -> None:
    async def wrong() -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        go(partial(with_failure_handling, wrong, Recovery(PlanFailure, retries=3)))
    with pytest.raises(TypeError, match="ZeroDivisionError is not a subclass of PlanFailure"):
        Recovery(ZeroDivisionError)  # type: ignore[arg-type]


def test_after_its_time_a_recovery_no_longer_retries() -> None:
    body = Body(*[GraspMissed()] * 10, duration=1.0)

    async def plan() -> float:
        with pytest.raises(GraspMissed):
            await with_failure_handling(body, Recovery(GraspMissed, retries=9, within=2.5))
        return now()

    assert go(plan) == 3.0
    assert body.runs == 3


def test_a_failure_in_the_very_step_in_which_the_time_is_over_is_in_time() -> None:
    body = Body(*[GraspMissed()] * 10, duration=1.0)
    with pytest.raises(GraspMissed):
        go(partial(with_failure_handling, body, Recovery(GraspMissed, retries=9, within=2.0)))
    assert body.runs == 3


def test_the_time_of_a_recovery_stands_still_while_suspended() -> None:
    body = Body(GraspMissed(), duration=1.0)

    async def plan() -> Any:
        handle = task("work")

        async def control() -> None:
            await sleep(0.5)
            async with task_suspended(handle):
                await sleep(10)

        recovering = partial(with_failure_handling, body, Recovery(GraspMissed, within=2.0))
        return (await par(partial(tag, "work", recovering), control))[0]

    assert go(plan) == "done"


def test_alternatives_are_taken_one_per_retry_and_used_up() -> None:
    tried: list[tuple[str, str]] = []

    async def body(grasp: str, arm: str = "right") -> str:
        tried.append((grasp, arm))
        if arm == "right" and grasp != "top":
            raise GraspMissed(grasp)
        return grasp

    recovery = Recovery(GraspMissed, retries=9, alternatives={"grasp": lambda: ["front", "side", "top"]})
    assert go(partial(with_failure_handling, body, recovery)) == "top"
    assert tried == [("front", "right"), ("side", "right"), ("top", "right")]
    two = Recovery(
        GraspMissed, retries=9, alternatives={"grasp": lambda: iter(["front", "side"])}, otherwise=ObjectUnfetchable
    )
    with pytest.raises(ObjectUnfetchable) as caught:
        go(partial(with_failure_handling, body, two))
    assert str(caught.value.__cause__) == "side"


def test_a_fresh_iterable_of_alternatives_is_made_per_entry() -> None:
    seen: list[int] = []

    async def body(n: int) -> None:
        seen.append(n)
        if len(seen) % 2:
            raise GraspMissed

    recovery = Recovery(GraspMissed, alternatives={"n": lambda: iter([1, 2])})

    async def plan() -> None:
        await with_failure_handling(body, recovery)
        await with_failure_handling(body, recovery)

    go(plan)
    assert seen == [1, 2, 1, 2]


def test_a_composite_failure_matches_a_class_if_every_leaf_does() -> None:
    inner = CompositeFailure(failures=(GraspMissed(), GraspMissed()), names=("a", "b"))
    mixed = CompositeFailure(failures=(inner, ObjectNotFound()), names=("c", "d"))
    assert matches(inner, GraspMissed)
    assert not matches(mixed, GraspMissed)
    assert matches(mixed, (GraspMissed, ObjectNotFound))
    assert matches(mixed, LowLevelFailure)
    assert not matches(CompositeFailure(), GraspMissed)
    assert matches(CompositeFailure(), CompositeFailure)


def test_every_attempt_failure_and_decision_is_in_the_trace() -> None:
    trace = Trace()
    body = Body(GraspMissed("one"), GraspMissed("two"))
    with pytest.raises(ObjectUnfetchable):
        go(
            partial(with_failure_handling, body, Recovery(GraspMissed, retries=1, otherwise=ObjectUnfetchable)),
            trace=trace,
        )
    told = [
        (e["event"], e.get("attempt") or e["decision"], e.get("failure", {}).get("message"))
        for e in trace.events
        if e["event"] in ("attempt", "recovery")
    ]
    assert told == [
        ("attempt", 1, None),
        ("recovery", "retry", "one"),
        ("attempt", 2, None),
        ("recovery", "used up", "two"),
    ]


async def hopeless() -> None:
    raise GraspMissed(what="cup")


def test_alternatives_without_a_value_for_the_first_run_are_refused() -> None:
    async def body(grasp: str) -> None: ...

    with pytest.raises(ValueError, match="at least one value"):
        go(partial(with_failure_handling, body, Recovery(PlanFailure, alternatives={"grasp": list})))


def test_a_recovery_may_raise_the_failure_itself_again() -> None:
    async def again(failure: PlanFailure) -> Any:
        raise failure

    with pytest.raises(GraspMissed) as caught:
        go(partial(with_failure_handling, hopeless, Recovery(PlanFailure, again)))
    assert caught.value.__cause__ is None


KINDS = (GraspMissed, NavigationFailure, taxonomy.ManipulationFailure, taxonomy.ObjectNotFound)


@settings(max_examples=examples(200), deadline=None)
@hypothesis.given(
    recoveries=st.lists(
        st.tuples(st.sampled_from(KINDS), st.integers(0, 3), st.sampled_from(["retry", "propagate", "return"])),
        max_size=4,
    ),
    outcomes=st.lists(st.one_of(st.none(), st.sampled_from(KINDS)), min_size=14, max_size=14),
)
def test_recoveries_do_what_the_table_of_counters_says(recoveries: Any, outcomes: Any) -> None:
    runs = 0

    async def body() -> str:
        nonlocal runs
        runs += 1
        kind = outcomes[runs - 1]
        if kind is not None:
            raise kind
        return "done"

    async def decide(word: str, failure: PlanFailure) -> Any:
        return {"retry": RETRY, "propagate": PROPAGATE, "return": Return("left")}[word]

    def model() -> tuple[int, Any]:
        left = [attempts for _, attempts, _ in recoveries]
        for number, kind in enumerate(outcomes, 1):
            if kind is None:
                return number, "done"
            match = next((n for n, entry in enumerate(recoveries) if issubclass(kind, entry[0])), None)
            if match is None or not left[match] or recoveries[match][2] == "propagate":
                return number, kind
            if recoveries[match][2] == "return":
                return number, "left"
            left[match] -= 1
        raise AssertionError

    made = [Recovery(kind, partial(decide, word), retries=attempts) for kind, attempts, word in recoveries]
    try:
        outcome = go(partial(with_failure_handling, body, *made))
    except PlanFailure as failure:
        outcome = type(failure)
    assert (runs, outcome) == model()
    assert runs <= 1 + sum(attempts for _, attempts, _ in recoveries)


def test_attempts_is_read_as_the_former_name_of_retries() -> None:
    assert Recovery(GraspMissed, attempts=2) == Recovery(GraspMissed, retries=2)
    with pytest.raises(WrongValue, match="former name of retries"):
        Recovery(GraspMissed, retries=3, attempts=2)


def test_the_first_failure_that_states_changes_advises_them() -> None:
    change = Change("absent", True, "cup1")
    links = [GraspMissed(), LocationUnresolvable(changes=(change,)), LocationUnresolvable()]
    assert advised_changes(links) == (change,)
    assert advised_changes([]) == ()
