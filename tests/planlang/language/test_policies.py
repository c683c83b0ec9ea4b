"""with_policies: inits, checks without polling, violation before an end of the body, clean_ups always."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import hypothesis
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from virtual_time import go

from planlang import *
from planlang.failures import GraspMissed, GraspSlipped, ObjectNotFound, PolicyViolated
from planlang.runs import with_paths
from tests.support.examples import examples


def notes(log: list[str], word: str, failure: Exception | None = None) -> Callable[[], Any]:
    """A branch that writes its word, then fails if it shall."""

    async def branch() -> str:
        log.append(f"{word} {now():g}")
        if failure is not None:
            raise failure
        return word

    return branch


def full(log: list[str], name: str, check: Any = None, **failing: Exception) -> Policy:
    """A policy whose parts write down that they ran."""
    init, recover, clean_up = (
        notes(log, f"{part} {name}", failing.get(part)) for part in ("init", "recover", "clean_up")
    )
    return Policy(name, check, init, recover, clean_up)


def test_the_result_of_the_body_is_returned_between_inits_in_order_and_clean_ups_in_reverse() -> None:
    log: list[str] = []
    policies = [full(log, "a", Fluent(False)), full(log, "b")]
    assert go(partial(with_policies, policies, notes(log, "body"))) == "body"
    assert log == ["init a 0", "init b 0", "body 0", "clean_up b 0", "clean_up a 0"]


def test_if_an_init_fails_the_clean_ups_of_those_before_it_run_and_its_failure_is_raised() -> None:
    log: list[str] = []
    failure = ObjectNotFound()
    policies = [full(log, "a"), full(log, "b"), full(log, "c", init=failure), full(log, "d")]
    with pytest.raises(ObjectNotFound) as caught:
        go(partial(with_policies, policies, notes(log, "body")))
    assert caught.value is failure
    assert log == ["init a 0", "init b 0", "init c 0", "clean_up b 0", "clean_up a 0"]


def test_a_check_that_is_true_on_entry_keeps_the_body_from_starting() -> None:
    log: list[str] = []
    with pytest.raises(PolicyViolated, match="policy a"):
        go(partial(with_policies, [full(log, "a", Fluent(True))], notes(log, "body")))
    assert log == ["init a 0", "recover a 0", "clean_up a 0"]


def test_an_init_can_make_a_check_false_in_time() -> None:
    closed = Fluent(False)

    async def close() -> None:
        closed.set(True)

    assert go(partial(with_policies, [Policy("door", ~closed, close)], notes([], "body"))) == "body"


def violated(log: list[str], at: float, body: Any, check: Any = None, **options: Any) -> None:
    """Run a body under three policies, the second of which is violated after ``at`` seconds."""
    danger = Fluent(False, "danger")

    async def outside() -> None:
        await sleep(at)
        danger.set(True)

    async def plan() -> None:
        policies = [full(log, "a", Fluent(False)), full(log, "b", check or danger), full(log, "c")]
        await par(partial(with_policies, policies, body), outside)

    go(plan, **options)


def test_a_violation_evaporates_the_body_then_recovers_then_cleans_up_in_reverse_then_raises() -> None:
    log: list[str] = []

    async def cleanup() -> None:
        await sleep(0.5)
        log.append(f"body cleaned up {now():g}")

    with pytest.raises(PolicyViolated) as caught:
        violated(log, 1, partial(unwind_protect, partial(sleep, 9), cleanup))
    assert caught.value.policy == "b"
    assert log[3:] == ["body cleaned up 1.5", "recover b 1.5", "clean_up c 1.5", "clean_up b 1.5", "clean_up a 1.5"]


@pytest.mark.parametrize("schedule", [None, *range(20)])
def test_a_violation_beats_an_end_of_the_body_at_the_same_decision(schedule: int | None) -> None:
    log: list[str] = []
    with pytest.raises(PolicyViolated):
        violated(log, 1, partial(sleep, 1), schedule=schedule)


def test_a_body_that_violates_a_policy_with_its_last_act_has_violated_it() -> None:
    danger = Fluent(False)

    async def body() -> None:
        danger.set(True)

    with pytest.raises(PolicyViolated):
        go(partial(with_policies, [Policy("no danger", danger)], body))


@pytest.mark.parametrize("schedule", [None, *range(20)])
def test_a_violation_counts_however_short_it_was_and_whoever_runs_first(schedule: int | None) -> None:
    danger = Fluent(False)

    async def body() -> None:
        danger.set(True)
        danger.set(False)
        await sleep(1)

    with pytest.raises(PolicyViolated):
        go(partial(with_policies, [Policy("no danger", danger)], body), schedule=schedule)


def test_a_failure_of_the_body_at_the_same_decision_is_a_sibling() -> None:
    danger = Fluent(False)

    async def body() -> None:
        danger.set(True)
        raise GraspMissed

    with pytest.raises(PolicyViolated) as caught:
        go(partial(with_policies, [Policy("a", danger), Policy("b", danger)], body))
    assert [(name, type(failure)) for name, failure in caught.value.siblings] == [
        ("b", PolicyViolated),
        ("body", GraspMissed),
    ]


def test_of_several_violated_policies_the_textually_first_recovers() -> None:
    log: list[str] = []
    danger = Fluent(False)

    async def body() -> None:
        danger.set(True)
        await sleep(1)

    with pytest.raises(PolicyViolated) as caught:
        go(partial(with_policies, [full(log, "a", danger), full(log, "b", danger)], body))
    assert caught.value.policy == "a"
    assert [line for line in log if line.startswith("recover")] == ["recover a 0"]


def test_a_failure_of_the_body_is_raised_as_itself_after_the_clean_ups_without_recovery() -> None:
    log: list[str] = []
    failure = GraspMissed()
    with pytest.raises(GraspMissed) as caught:
        go(partial(with_policies, [full(log, "a", Fluent(False))], notes(log, "body", failure)))
    assert caught.value is failure
    assert log == ["init a 0", "body 0", "clean_up a 0"]


def test_evaporated_from_outside_all_clean_ups_run_shielded() -> None:
    log: list[str] = []

    async def slow() -> None:
        await sleep(0.5)
        log.append(f"clean_up {now():g}")

    async def plan() -> None:
        policies = [Policy("a", Fluent(False), clean_up=slow), Policy("b", clean_up=slow)]
        await pursue(partial(with_policies, policies, partial(sleep, 9)), partial(sleep, 1))

    go(plan)
    assert log == ["clean_up 1.5", "clean_up 2"]


def test_all_clean_ups_run_even_if_one_fails_and_their_failures_are_attached() -> None:
    log: list[str] = []
    slipped, lost = GraspSlipped(), ObjectNotFound()
    policies = [full(log, "a", Fluent(True), recover=lost), full(log, "b", clean_up=slipped)]
    with pytest.raises(PolicyViolated) as caught:
        go(partial(with_policies, policies, notes(log, "body")))
    assert caught.value.cleanup_failures == (lost, slipped)
    assert log[-2:] == ["clean_up b 0", "clean_up a 0"]


def test_after_a_success_the_first_failure_of_a_clean_up_is_raised_with_the_others_attached() -> None:
    log: list[str] = []
    first, second = GraspSlipped(), ObjectNotFound()
    policies = [full(log, "a", clean_up=second), full(log, "b", clean_up=first)]
    with pytest.raises(GraspSlipped) as caught:
        go(partial(with_policies, policies, notes(log, "body")))
    assert caught.value is first
    assert first.cleanup_failures == (second,)


def test_a_programming_error_in_a_part_beats_failures_and_the_other_clean_ups_still_run() -> None:
    log: list[str] = []
    policies = [full(log, "a", Fluent(True)), full(log, "b", clean_up=KeyError("oops"))]
    with pytest.raises(KeyError, match="oops"):
        go(partial(with_policies, policies, notes(log, "body")))
    assert log[-2:] == ["clean_up b 0", "clean_up a 0"]


def test_a_programming_error_of_the_body_is_raised_after_the_clean_ups() -> None:
    log: list[str] = []
    policies = [full(log, "a", clean_up=KeyError("other"))]
    with pytest.raises(ZeroDivisionError):
        go(partial(with_policies, policies, notes(log, "body", ZeroDivisionError())))
    assert log == ["init a 0", "body 0", "clean_up a 0"]


def test_a_failing_clean_up_of_an_evaporated_body_is_attached_to_what_is_raised() -> None:
    slipped = GraspSlipped()

    async def fails() -> None:
        await sleep(1)
        raise GraspMissed

    policies = [full([], "a", clean_up=slipped)]
    with pytest.raises(GraspMissed) as caught:
        go(partial(par, partial(with_policies, policies, partial(sleep, 9)), fails))
    assert caught.value.cleanup_failures == (slipped,)


def test_evaporation_waits_for_the_recovery_and_the_clean_ups() -> None:
    log: list[str] = []

    async def slow(part: str) -> None:
        log.append(f"{part} from {now():g}")
        await sleep(2)
        log.append(f"{part} to {now():g}")

    policy = Policy("a", Fluent(True), recover=partial(slow, "recover"), clean_up=partial(slow, "clean_up"))

    async def plan() -> None:
        await pursue(partial(sleep, 1), partial(with_policies, [policy], partial(sleep, 9)))

    go(plan)
    assert log == ["recover from 0", "recover to 2", "clean_up from 2", "clean_up to 4"]


def test_an_endless_recovery_is_a_programming_error_and_the_clean_ups_run_all_the_same() -> None:
    log: list[str] = []
    policy = Policy("a", Fluent(True), recover=partial(sleep, 99), clean_up=notes(log, "clean_up"))
    with pytest.raises(CleanupOverrun):
        go(partial(with_policies, [policy], notes(log, "body")))
    assert log == ["clean_up 10"]


def test_failures_of_recovery_and_clean_ups_are_notes_on_what_is_raised_whatever_that_is() -> None:
    policies = [full([], "a", Fluent(True), recover=ObjectNotFound()), full([], "b", clean_up=GraspSlipped())]
    with pytest.raises(PolicyViolated) as violated:
        go(partial(with_policies, policies, notes([], "body")))
    assert [note.partition(":")[0] for note in violated.value.__notes__] == ["during cleanup"] * 2
    with pytest.raises(ZeroDivisionError) as crashed:
        go(partial(with_policies, policies[1:], notes([], "body", ZeroDivisionError())))
    assert [note.split(":")[1].strip() for note in crashed.value.__notes__] == ["GraspSlipped"]


def test_an_endless_clean_up_is_a_programming_error() -> None:
    with pytest.raises(CleanupOverrun):
        go(partial(with_policies, [Policy("a", clean_up=partial(sleep, 99))], notes([], "body")))


def test_a_function_as_check_is_called_when_a_fluent_it_reads_changes_and_never_otherwise() -> None:
    calls: list[float] = []
    left, right = Fluent(False), Fluent(0)

    def check() -> bool:
        calls.append(now())
        return left.value and right.value > 2

    async def body() -> None:
        await sleep(1)
        right.set(1)  # not read so far: left was false
        await sleep(1)
        left.set(True)
        await sleep(1)
        right.set(2)
        await sleep(1)
        left.set(False)
        await sleep(1)
        right.set(9)
        await sleep(1)
        left.set(True)
        await sleep(1)

    async def plan() -> None:
        with pytest.raises(PolicyViolated):
            await with_policies([Policy("a", check)], body)
        assert now() == 6

    go(plan)
    assert sorted(set(calls)) == [0, 2, 3, 4, 6]


def test_a_check_that_reads_no_fluent_is_refused_with_the_right_form() -> None:
    with pytest.raises(PlanStructureError, match=r"reads no fluent(.|\n)*wrong(.|\n)*right: .*Fluent\(read="):
        go(partial(with_policies, [Policy("a", lambda: False)], notes([], "body")))


def test_a_value_as_check_is_refused_with_the_right_form() -> None:
    with pytest.raises(TypeError, match=r"is False(.|\n)*wrong(.|\n)*right"):
        Policy("a", False)  # type: ignore[arg-type]


def test_two_policies_of_one_name_are_refused_with_the_right_form() -> None:
    with pytest.raises(PlanStructureError, match=r"two policies named 'a'(.|\n)*wrong(.|\n)*right"):
        go(partial(with_policies, [Policy("a"), Policy("a")], notes([], "body")))


def test_what_a_check_raises_is_raised_before_and_during_the_body() -> None:
    number = Fluent(1)

    async def body() -> None:
        await sleep(1)
        number.set(0)
        await sleep(1)

    with pytest.raises(ZeroDivisionError):
        go(partial(with_policies, [Policy("a", lambda: 1 / number.value > 2)], body))
    with pytest.raises(ZeroDivisionError):
        go(partial(with_policies, [Policy("a", 1 / number > 2)], body))


def test_a_world_fluent_as_check_is_looked_at_in_each_step() -> None:
    height = Fluent(read=lambda: 1 - now())

    async def plan() -> float:
        with pytest.raises(PolicyViolated):
            await with_policies([Policy("not too low", lambda: height.value < 0.5)], partial(sleep, 9))
        return now()

    assert go(plan) == pytest.approx(0.5, abs=1 / 120)


def test_a_violation_while_suspended_counts_after_waking_up_if_it_still_holds() -> None:
    for still, expected in ((True, "violated"), (False, "done")):
        danger = Fluent(False)

        async def guarded(danger: Fluent[bool] = danger) -> str:
            try:
                await with_policies([Policy("a", danger)], partial(sleep, 1))
            except PolicyViolated:
                return "violated"
            return "done"

        async def plan(danger: Fluent[bool] = danger, still: bool = still, guarded: Any = guarded) -> str:
            async def control() -> None:
                await sleep(0.5)
                async with task_suspended(task("guarded")):
                    danger.set(True)
                    await sleep(1)
                    danger.set(still)

            return (await par(partial(tag, "guarded", guarded), control))[0]

        assert go(plan) == expected


def test_parts_and_violation_are_in_the_trace() -> None:
    trace = Trace()
    with pytest.raises(PolicyViolated):
        go(partial(with_policies, [full([], "a", Fluent(True))], notes([], "body")), trace=trace)
    base = "with_policies/with_policies"
    paths = [e["path"] for e in with_paths(trace.events) if e["event"] == "ended" and e["path"] != "with_policies"]
    assert paths == [f"{base}/init a", f"{base}/recover a", f"{base}/clean_up a", base]
    assert [e["policy"] for e in trace.events if e["event"] == "policy violated"] == ["a"]


@settings(max_examples=examples(80), deadline=None)
@hypothesis.given(
    checks=st.lists(st.one_of(st.none(), st.integers(0, 5)), max_size=4),
    ends=st.integers(0, 5),
    fails=st.booleans(),
    bad_init=st.one_of(st.none(), st.integers(0, 3)),
    schedule=st.one_of(st.none(), st.integers(0, 1000)),
)
def test_random_policies_keep_the_order_of_their_parts(
    checks: list[int | None], ends: int, fails: bool, bad_init: int | None, schedule: int | None
) -> None:
    """Policies violated at random seconds (0: on entry) around a body that ends at a random second."""
    log: list[str] = []
    clock = Fluent(0)
    policies = [
        full(
            log,
            f"p{index}",
            None if at is None else clock >= at,
            **({"init": ObjectNotFound()} if index == bad_init else {}),
        )
        for index, at in enumerate(checks)
    ]

    async def body() -> None:
        await sleep(ends)
        if fails:
            raise GraspMissed

    async def ticks() -> None:
        for second in range(1, 7):
            await sleep(1)
            clock.set(second)

    async def plan() -> str:
        async def guarded() -> str:
            try:
                await with_policies(policies, body)
            except PlanFailure as failure:
                return f"{type(failure).__name__} {getattr(failure, 'policy', '')}".strip()
            return "done"

        return (await par(guarded, ticks))[0]

    begun = len(checks) if bad_init is None or bad_init >= len(checks) else bad_init
    first = min((at for at in checks if at is not None), default=99)
    outcome = go(plan, schedule=schedule)
    names = [line.split()[1] for line in log if line.startswith("clean_up")]
    assert names == [f"p{index}" for index in reversed(range(begun))]
    if begun < len(checks):
        assert outcome == "ObjectNotFound"
    elif first <= ends:
        assert outcome == f"PolicyViolated p{checks.index(first)}"
    else:
        assert outcome == ("GraspMissed" if fails else "done")


def test_a_drained_clean_up_ends_the_run_without_the_waits_of_the_others() -> None:
    policies = [full([], "a"), Policy("b", clean_up=partial(sleep, 5))]
    with pytest.raises(StepLimit):
        go(partial(with_policies, policies, notes([], "body")), max_steps=240)


def test_a_deadlock_under_policies_names_them() -> None:
    with pytest.raises(DeadlockError, match="waits for a violation of policy 'a'"):
        go(partial(with_policies, [Policy("a", Fluent(False))], partial(wait_for, Fluent(False))))
