"""The runner of skills: in which order candidates are tried, how often, and what a skill fails with."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest

from executive.modules.runner import MOST, Skill
from planlang import VirtualHost, run
from planlang.failures import (
    GraspMissed,
    HandleNotReachable,
    LookingFailure,
    ManipulationPoseUnreachable,
    NavigationPoseUnreachable,
    PlanFailure,
)


class Recorder:
    """Records which parts of a skill are called; candidates in ``failing`` fail in their contact."""

    def __init__(self, *failing: int) -> None:
        self.failing, self.calls = set(failing), list[tuple[str, int]]()

    def part(self, name: str) -> Callable[[int], Awaitable[None]]:
        async def called(candidate: int) -> None:
            self.calls.append((name, candidate))

        return called

    async def contact(self, candidate: int) -> int:
        self.calls.append(("contact", candidate))
        if candidate in self.failing:
            raise GraspMissed(what=str(candidate))
        return candidate

    def tried(self) -> list[int]:
        return [candidate for name, candidate in self.calls if name == "contact"]


def result(skill: Skill[int, int]) -> Any:
    return run(skill.run, host=VirtualHost())


def test_the_first_candidate_that_succeeds_ends_the_skill_with_its_result() -> None:
    recorder = Recorder(1, 2)
    assert result(Skill(lambda: (1, 2, 3, 4), recorder.contact)) == 3
    assert recorder.tried() == [1, 2, 3]


def test_the_hand_leaves_the_thing_also_after_a_contact_that_failed() -> None:
    recorder = Recorder(1)
    result(Skill(lambda: (1, 2), recorder.contact, recorder.part("approach"), recorder.part("retreat")))
    assert recorder.calls == [(part, one) for one in (1, 2) for part in ("approach", "contact", "retreat")]


def test_without_an_approach_there_is_no_contact() -> None:
    async def approach(candidate: int) -> None:
        if candidate == 1:
            raise NavigationPoseUnreachable

    recorder = Recorder()
    assert result(Skill(lambda: (1, 2), recorder.contact, approach, recorder.part("retreat"))) == 2
    assert recorder.calls == [("contact", 2), ("retreat", 2)]


def test_a_skill_fails_with_the_failure_of_its_best_candidate() -> None:
    with pytest.raises(GraspMissed) as caught:
        result(Skill(lambda: (1, 2), Recorder(1, 2).contact))
    assert caught.value.what == "1"


def test_a_failure_of_the_skill_has_that_of_its_best_candidate_as_its_cause() -> None:
    async def otherwise(problem: PlanFailure | None, tried: int) -> PlanFailure:
        return HandleNotReachable(f"{tried} tried", what="leaf")

    with pytest.raises(HandleNotReachable, match="2 tried") as caught:
        result(Skill(lambda: (1, 2), Recorder(1, 2).contact, otherwise=otherwise))
    assert isinstance(caught.value.__cause__, GraspMissed)


def test_a_failure_that_no_other_candidate_can_cure_ends_the_skill() -> None:
    recorder = Recorder(1)
    with pytest.raises(GraspMissed):
        result(Skill(lambda: (1, 2), recorder.contact, failures=(ManipulationPoseUnreachable,)))
    assert recorder.tried() == [1]


def test_a_skill_without_a_candidate_fails() -> None:
    with pytest.raises(ManipulationPoseUnreachable):
        result(Skill(lambda: (), Recorder().contact))


def test_no_candidate_is_tried_again_and_at_most_so_many() -> None:
    recorder = Recorder(*range(20))
    with pytest.raises(GraspMissed):
        result(Skill(lambda: range(20), recorder.contact))
    assert recorder.tried() == list(range(MOST))


def test_candidates_are_made_anew_when_what_they_were_made_for_has_changed() -> None:
    believed = [0]

    async def between() -> None:
        believed[0] = 10

    recorder = Recorder(0, 1)
    assert (
        result(Skill(lambda: range(believed[0], 20), recorder.contact, between=between, believed=believed.copy)) == 10
    )
    assert recorder.tried() == [0, 10]


def test_a_world_that_changes_at_each_try_does_not_keep_a_skill_going() -> None:
    recorder = Recorder(1)
    with pytest.raises(GraspMissed):
        result(Skill(lambda: (1,), recorder.contact, believed=lambda: len(recorder.calls)))
    assert recorder.tried() == [1] * MOST


def test_steps_go_on_until_the_world_is_as_wanted() -> None:
    recorder = Recorder(1)
    skill = Skill(lambda: (1, 2, 3), recorder.contact)

    async def is_done() -> bool:
        return recorder.tried().count(2) == 2

    run(lambda: skill.until(is_done), host=VirtualHost())
    assert recorder.tried() == [1, 2, 1, 2]
    run(lambda: skill.until(is_done), host=VirtualHost())
    assert recorder.tried() == [1, 2, 1, 2], "nothing is left to do"


def test_steps_that_do_not_suffice_fail_after_as_many_tries() -> None:
    recorder = Recorder()

    async def is_done() -> bool:
        return False

    async def otherwise(problem: PlanFailure | None, tried: int) -> PlanFailure:
        assert problem is None
        return HandleNotReachable(f"{tried} tried", what="leaf")

    skill = replace(Skill(lambda: (1,), recorder.contact), otherwise=otherwise)
    with pytest.raises(HandleNotReachable, match=f"{MOST} tried"):
        run(lambda: skill.until(is_done), host=VirtualHost())
    assert recorder.tried() == [1] * MOST


def test_verification_knows_how_the_contact_failed_and_may_fail_otherwise() -> None:
    async def verify(candidate: int, problem: PlanFailure | None) -> None:
        if problem is not None:
            raise LookingFailure from problem

    with pytest.raises(LookingFailure):
        result(Skill(lambda: (1, 2), Recorder(1).contact, verify=verify))


def test_slow_searches_may_be_asynchronous_and_pause() -> None:
    async def searched() -> AsyncIterator[int | None]:
        yield None
        yield 1

    def paused() -> Iterator[int | None]:
        yield None
        yield 2

    recorder = Recorder()
    assert [result(Skill(search, recorder.contact)) for search in (searched, paused)] == [1, 2]
